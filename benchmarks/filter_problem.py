"""The modes, the banks of filters and the record that all benchmarks of filters share."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from reobserve.core.discretisation import zero_order_hold
from reobserve.observers.gaussian_filter import GaussianFilter
from reobserve.observers.imm import IMM
from reobserve.observers.kalman import KalmanFilter
from reobserve.observers.smooth_variable_structure import SmoothVariableStructureFilter
from reobserve.systems.linear import LinearModel
from reobserve_papers.signals.random_streams import random_stream

Array = NDArray[np.float64]

TRANSITION = 0.97 * np.eye(3) + 0.01
LAYER, CONVERGENCE_RATE = 5.0, 0.1  # psi [m/s^2] and gamma of the SVSF

_PERIOD = 0.05
_MODES = ((40.0, 0.8), (20.0, 0.8), (40.0, 6.0))  # spring [N/m] and damper [N s/m] to the wall
_PROCESS = np.diag([1e-6, 1e-6, 1e-4, 1e-4])
_MEASUREMENT = 1.0


def models() -> list[LinearModel]:
    """Two masses of 1 kg in a row: sound, with a soft spring, and with a stiff damper.

    The states are two positions and two velocities, the input is a force on the first mass, and
    its acceleration is measured, so that no matrix but B of continuous time has a row of zeros.
    """
    found = []
    for spring, damper in _MODES:
        A = np.array(
            [
                [0.0, 0.0, 1.0, 0.0],
                [0.0, 0.0, 0.0, 1.0],
                [-spring - 30.0, 30.0, -damper - 0.5, 0.5],
                [30.0, -30.0, 0.5, -0.5],
            ]
        )
        B = np.array([[0.0], [0.0], [1.0], [0.0]])
        held = zero_order_hold(A, B, _PERIOD)
        found.append(
            LinearModel(*held, A[2:3], B[2:3], Q=_PROCESS, R=_MEASUREMENT, sampling_period=_PERIOD)
        )
    return found


def banks() -> dict[str, IMM]:
    """A bank of Kalman filters and one of SVSFs, by the names of their C functions."""
    kalman: list[GaussianFilter] = [KalmanFilter(model) for model in models()]
    switching: list[GaussianFilter] = [
        SmoothVariableStructureFilter(
            model, boundary_layer=LAYER, convergence_rate=CONVERGENCE_RATE
        )
        for model in models()
    ]
    return {
        "kalman": IMM(kalman, TRANSITION),
        "switching": IMM(switching, TRANSITION),
    }


def record(steps: int) -> tuple[Array, Array, NDArray[np.intp]]:
    """Measurements, shape (k, 1), controls, (k + 1, 1), and the mode in each step.

    A control is held over the step to each row; the next one stands in that row's measurement.
    """
    stream = random_stream(0, "benchmark", "filters")
    arrays = [model.arrays for model in models()]
    controls = 5.0 * np.repeat(stream.standard_normal(steps // 10 + 1), 10)[: steps + 1, np.newaxis]
    process = stream.standard_normal((steps, 4)) * np.sqrt(np.diag(_PROCESS))
    noise = stream.standard_normal((steps, 1)) * np.sqrt(_MEASUREMENT)
    samples = stream.random(steps)
    thresholds = np.cumsum(TRANSITION, axis=1)
    measurements, modes = np.empty((steps, 1)), np.empty(steps, dtype=np.intp)
    x, mode = np.zeros(4), 0
    for k in range(steps):
        mode = min(int(np.searchsorted(thresholds[mode], samples[k])), 2)
        modes[k] = mode
        A, B, C, D, _, _ = arrays[mode]
        x = A @ x + B @ controls[k] + process[k]
        measurements[k] = C @ x + D @ controls[k + 1] + noise[k]
    return measurements, controls, modes
