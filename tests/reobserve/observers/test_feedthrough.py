"""The convention y(k) = C x(k) + D u(k), checked with records from python-control."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import control
import numpy as np
import pytest

from reobserve.observers.augmented_kalman import AugmentedKalmanFilter
from reobserve.observers.fixed_gain import steady_kalman
from reobserve.observers.imm import IMM
from reobserve.observers.kalman import KalmanFilter
from reobserve.observers.smooth_variable_structure import SmoothVariableStructureFilter
from reobserve.systems.linear import LinearModel

PERIOD = 0.1
A = [[0.9, 0.2, 0.0], [-0.1, 0.8, 0.1], [0.0, 0.3, 0.7]]
B = [[0.1, 0.0], [0.0, 0.5], [0.2, 0.3]]
C = [[1.0, 0.0, 0.0], [0.0, 1.0, 1.0]]
D = [[0.7, -1.2], [0.0, 2.0]]
START = [1.0, -2.0, 0.5]
MODEL = LinearModel(A, B, C, D, Q=0.01, R=0.1, sampling_period=PERIOD)

FILTERS: dict[str, Callable[[LinearModel], Any]] = {
    "Kalman filter": KalmanFilter,
    "fixed gain": steady_kalman,
    "SVSF": lambda model: SmoothVariableStructureFilter(
        model, boundary_layer=0.1, convergence_rate=0.1
    ),
    "augmented Kalman filter": lambda model: AugmentedKalmanFilter(
        model, fault_matrix=np.ones((3, 1)), random_walk=1e-4
    ),
    "IMM": lambda model: IMM([KalmanFilter(model)], [[1.0]]),
}


@pytest.mark.parametrize("build", FILTERS.values(), ids=FILTERS)
def test_system_with_feedthrough_is_tracked_without_innovations(
    build: Callable[[LinearModel], Any],
) -> None:
    plant = control.ss(A, B, C, D, PERIOD)
    k = np.arange(200)
    u = np.array([np.sin(0.02 * k**1.5), np.cos(0.3 * k)])
    done = control.forced_response(plant, inputs=u, initial_state=START, return_states=True)
    made = build(MODEL)
    run = made.run(done.outputs.T, u.T, start=made.init(START, 0.5))
    assert np.abs(done.outputs).max() > 1.0
    assert np.abs(run["innovation"]).max() < 1e-12
    assert np.abs(run["state"] - done.states.T).max() < 1e-12


def test_matrices_are_optional() -> None:
    short = LinearModel(A, C=C, Q=0.01, R=0.1)
    assert (short.inputs, short.B.shape, short.D.shape) == (0, (3, 0), (2, 0))
    undriven = LinearModel(A, B, C, Q=0.01, R=0.1)
    assert not undriven.D.any()
