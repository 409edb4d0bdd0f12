"""Numbers and signals that no plant can be simulated with, each refused naming the argument."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from reobserve.core.errors import InputError
from reobserve.systems.polynomial import PolynomialSystem
from reobserve_papers.plants.delayed_input import check_delay
from reobserve_papers.plants.pendulum import pendulum
from reobserve_papers.plants.polynomial import PolynomialPlant
from reobserve_papers.plants.satellite import Satellite
from reobserve_papers.signals.inputs import Signal, Term
from reobserve_papers.signals.signal_shapes import Constant

WHEELS = Satellite(np.diag([1.0, 2.0, 3.0]))
PLANE = PolynomialPlant(PolynomialSystem.from_expressions(["b", "-a"], ["a"], ["a", "b"], 3))


def steady(axes: int) -> Signal:
    return Signal(axes, (Term(0, 0.0, np.inf, Constant(0.5)),))


REFUSED: list[tuple[Callable[[], Any], str]] = [
    (
        lambda: check_delay("delay", steady(1), (0.0, 1.0), 0.5, 5e7),
        "horizon: 5e+07 s is 1e+08 steps, must be 1e+08 at most",
    ),
    (
        lambda: check_delay("delay", steady(1), (0.0, 1.0), 0.5, 1e300),
        "horizon: 1e+300 s is 2e+300 steps, must be 1e+08 at most",
    ),
    (
        lambda: pendulum(9.81, 1e-200, 1e-200, 0.1),
        "mass: 1e-200 kg at 1e-200 m is so small that rates overflow",
    ),
    (lambda: PLANE.output(1.0), "states: has shape (), must end in 2"),
    (lambda: PLANE.output(np.zeros((4, 3))), "states: has shape (4, 3), must end in 2"),
    (
        lambda: WHEELS.simulate(np.zeros(3), steady(1), steady(3), 0.1, 2),
        "control: has 1 axes, must have 3",
    ),
    (
        lambda: WHEELS.simulate(np.zeros(3), steady(3), steady(2), 0.1, 2),
        "fault: has 2 axes, must have 3",
    ),
]


@pytest.mark.parametrize(("call", "said"), REFUSED)
def test_invalid_simulation_arguments_are_refused(call: Callable[[], Any], said: str) -> None:
    with pytest.raises(InputError) as error:
        call()
    assert str(error.value) == said
