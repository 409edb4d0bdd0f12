"""Observers that cannot be exported, each with the reason."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reobserve.codegen.programs.filters import filter_program
from reobserve.core.errors import InputError
from reobserve.estimation.export_command import exported, run
from reobserve.estimation.families.program import program_of
from reobserve.observers.kalman import Gain, KalmanFilter, gain_function
from reobserve.observers.nonlinear_filter import ExtendedKalmanFilter
from reobserve.systems.linear import LinearModel
from reobserve.systems.nonlinear import NonlinearModel
from tests.reobserve.codegen import cases

DESIGN, _ = cases.designed("kalman")
KALMAN = KalmanFilter(cases.model())
ONE = LinearModel([[0.9]], C=[[1.0]], Q=1.0, R=1.0)
ONE_STATE = KalmanFilter(ONE).init([0.0], 1.0)


class Own(KalmanFilter):
    """A user-defined observer."""


@gain_function
def _changing(
    cross: Any, factor: Any, innovation: Any, error: Any, parameters: Any, gain: Any
) -> None:
    innovation[0] *= 0.5
    gain[0, 0] = 0.1 * innovation[0]


class Changing(KalmanFilter):
    """A filter whose gain function changes the copy of an array that it reads."""

    @property
    def method(self) -> Gain:
        return Gain(_changing.compiled, np.empty(0))


def bank(*filters: Any) -> Callable[[], Any]:
    return lambda: program_of(*cases.bank(*filters))


def columns(name: str, y: int, u: int) -> Callable[[], Any]:
    return lambda: program_of(*cases.observer_of(name), (y, u))


def written(f: Any, h: Any = "x") -> Any:
    model = NonlinearModel(f, h, 1.0, 1.0, states=1, outputs=1, state_names=["x"])
    made = ExtendedKalmanFilter(model)
    return made, made.init([0.0], 1.0)


ONE_KIND = "observer: cannot be exported: its filters must all be Kalman filters, or all SVSFs of"
REFUSED: dict[str, tuple[Callable[[], Any], str]] = {
    "another language": (
        lambda: run(Path("d.json"), "java", Path()),
        "to: 'java' must be c",
    ),
    "a name from a digit on": (
        lambda: exported(DESIGN, "2nd"),
        "name: '2nd' must be an identifier of C",
    ),
    "a name of another alphabet": (
        lambda: exported(DESIGN, "größe"),
        "name: 'größe' must be an identifier of C",
    ),
    "no observer": (lambda: program_of(3), "observer: 3 must be an observer"),  # type: ignore[arg-type]
    "a user-defined observer": (
        lambda: program_of(Own(cases.model())),
        "observer: a Own cannot be exported; ",
    ),
    "columns of another number": (columns("kalman", 1, 1), "columns: (1, 1) must be (2, 1), or 1"),
    "inputs of another number": (columns("extended", 1, 2), "columns: (1, 2) must be (1, 3), or 1"),
    "a gain function that changes an array": (
        lambda: filter_program(Changing(ONE), ONE_STATE).code,
        "observer: cannot be exported: ",
    ),
    "a bank of two kinds": (bank(KALMAN, KALMAN, cases.switching("pseudo")), ONE_KIND),
    "a bank of two laws": (
        bank(*map(cases.switching, ("pseudo", "weighted", "pseudo"))),
        ONE_KIND,
    ),
    "a function of Python": (
        lambda: program_of(*written(lambda x: x)),
        "observer: of a model with f as a function cannot be exported; give it as text",
    ),
    "a gain that settles": (
        lambda: program_of(*cases.extended(initial_matrix=np.eye(3))),
        "observer: with an initial_matrix cannot be exported: its gain is another at each sample",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_observer_that_cannot_be_exported_is_reported(case: str) -> None:
    call, said = REFUSED[case]
    with pytest.raises(InputError) as error:
        call()
    assert str(error.value).startswith(said)
