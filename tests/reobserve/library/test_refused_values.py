"""Values of the right type that make no sense: one sentence each, naming the argument."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from reobserve import ILO, IMM, KalmanFilter, LinearModel
from reobserve.core.errors import InputError
from reobserve.estimation.families.poles import as_pole_list
from reobserve.observers.fixed_step import run_on_halves
from reobserve.synthesis.high_gain_design import high_gain, lyapunov_matrix
from reobserve.synthesis.ilo_certificate import certify
from reobserve.systems.rigid_body import RigidBody

KALMAN = KalmanFilter(LinearModel([[1.0]], [[1.0]], [[1.0]], Q=1.0, R=1.0, sampling_period=0.1))
BANK = IMM([KALMAN, KALMAN], [[0.9, 0.1], [0.1, 0.9]])
LEARNING = ILO(
    RigidBody(np.diag([1.0, 2.0, 3.0])),
    K1=0.9,
    K2=5.0,
    observer_gain=5.0,
    update_interval=0.1,
    sampling_period=0.1,
)
ZERO, TWO = np.zeros(3), np.zeros((2, 3))


def bank_state(**changed: Any) -> Callable[[], Any]:
    return lambda: BANK.step(replace(BANK.init([0.0], 1.0), **changed), [0.0], [0.0])


LOGARITHMS = "start.log_probabilities: must be 2 logarithms of probabilities"
REFUSED: list[tuple[Callable[[], Any], str]] = [
    (bank_state(log_probabilities=np.zeros(3)), LOGARITHMS),
    (bank_state(log_probabilities=np.array([np.nan, 0.0])), LOGARITHMS),
    (bank_state(log_probabilities=np.full(2, -np.inf)), LOGARITHMS),
    (bank_state(count=-1), "start.count: -1 must be a whole number, 0 or more"),
    (bank_state(count=True), "start.count: True must be a whole number, 0 or more"),
    (lambda: IMM([KALMAN, KalmanFilter], np.eye(2)), "filters[1]: an object of type ABCMeta must"),
    (lambda: run_on_halves(LEARNING, TWO, start=LEARNING.init(ZERO)), "y: has shape (2, 3), must"),
    (
        lambda: run_on_halves(LEARNING, TWO[:1], start=LEARNING.init(ZERO), y_before=TWO),
        "y_before: has shape (2, 3), must be (1, 3)",
    ),
    (lambda: as_pole_list("poles", -3.0), "poles: -3.0 must be a list of poles, as [-2, -3]"),  # type: ignore[arg-type]
    (lambda: lyapunov_matrix(501, 1.0), "size: 501 must be a whole number, from 1 to 500"),
    (lambda: high_gain(0, 1.0), "size: 0 must be a whole number, from 1 to 500"),
    (lambda: certify(1.0, 1.0, 0.5, 0.0), "K2: must not be zero, the estimate would never change"),
    (lambda: certify(1.0, 1.0, 0.5, 0.1, eta=-1.0), "eta: -1 must not be below zero"),
]  # fmt: skip


@pytest.mark.parametrize(("call", "said"), REFUSED)
def test_invalid_value_is_refused_naming_the_argument(call: Callable[[], Any], said: str) -> None:
    with pytest.raises(InputError) as error:
        call()
    assert str(error.value).startswith(said)


def test_largest_high_gain_is_accepted() -> None:
    assert np.isfinite(lyapunov_matrix(500, 1.0)).all()
