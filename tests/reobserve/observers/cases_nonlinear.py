"""Records with known truth for filters on nonlinear models: a driven pendulum."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.observers.imm import IMM
from reobserve.observers.nonlinear_filter import ExtendedKalmanFilter, UnscentedKalmanFilter
from reobserve.systems.nonlinear import NonlinearModel
from tests.reobserve.observers.case import Case

Array = NDArray[np.float64]

PERIOD, ROWS = 0.05, 400
NOISE = {"Q": 1e-8, "R": 1e-8}


def text_model(length: float = 0.5) -> NonlinearModel:
    """The pendulum as a differential equation in text; angle and acceleration are measured."""
    acceleration = "torque - gravity/length*sin(angle) - 0.3*rate"
    return NonlinearModel.from_ode(
        ["rate", acceleration], ["angle", acceleration], **NOISE, sampling_period=PERIOD,
        substeps=2, state_names=("angle", "rate"), input_names=("torque",),
        output_names=("encoder", "accelerometer"),
        parameters={"gravity": 9.81, "length": length},
    )  # fmt: skip


def acceleration(x: Array, u: Array) -> float:
    """The acceleration of the pendulum."""
    return float(u[0]) - 9.81 / 0.5 * math.sin(x[0]) - 0.3 * float(x[1])


def semi_implicit_step(x: Array, u: Array) -> list[float]:
    """A step of the pendulum in Python that numba cannot compile, as it calls another function."""
    rate = float(x[1]) + PERIOD * acceleration(x, u)
    return [float(x[0]) + PERIOD * rate, rate]


def measure(x: Array) -> Array:
    """The angle, in Python that numba compiles."""
    return x[:1]


def called_model() -> NonlinearModel:
    """A model with one compiled and one interpreted Python function."""
    return NonlinearModel(
        semi_implicit_step, measure, **NOISE, states=2, inputs=1, outputs=1, sampling_period=PERIOD
    )


def torque() -> Array:
    """Pulses of many lengths, held from row to row, shape (k, 1)."""
    k = np.arange(ROWS)
    return 4.0 * np.sign(np.sin(0.002 * k**1.6 + 0.3))[:, None]


def true_step(x: Array, u: Array, steps: int = 2) -> Array:
    """Two Runge-Kutta steps of the pendulum, by numpy."""

    def slope(x: Array) -> Array:
        return np.array([x[1], u[0] - 9.81 / 0.5 * np.sin(x[0]) - 0.3 * x[1]])

    h = PERIOD / steps
    for _ in range(steps):
        k1 = slope(x)
        k2 = slope(x + 0.5 * h * k1)
        k3 = slope(x + 0.5 * h * k2)
        k4 = slope(x + h * k3)
        x = x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return x


def _case(observer: Any, step: Callable[..., Any], output: Callable[..., Any]) -> Case:
    u = torque()
    rows = [np.array([0.4, -0.2])]
    for held in u[:-1]:
        rows.append(np.asarray(step(rows[-1], held)))
    x = np.array(rows)
    y = np.array([output(*row) for row in zip(x, u, strict=True)])
    start = observer.init([0.3, 0.0], 0.1)
    return Case(observer, y, u, start, {"state": x}, {"state": 1e-6}, 200, 1e3)


def _both(x: Array, u: Array) -> list[float]:
    return [x[0], acceleration(x, u)]


def extended() -> Case:
    """The model as text."""
    return _case(ExtendedKalmanFilter(text_model()), true_step, _both)


def unscented() -> Case:
    """The model as text."""
    return _case(UnscentedKalmanFilter(text_model(), alpha=0.5), true_step, _both)


def extended_called() -> Case:
    """The model in Python, with Jacobians by differences."""
    return _case(ExtendedKalmanFilter(called_model()), semi_implicit_step, lambda x, u: measure(x))


def unscented_called() -> Case:
    """The model in Python."""
    return _case(UnscentedKalmanFilter(called_model()), semi_implicit_step, lambda x, u: measure(x))


def bank() -> Case:
    """Two extended filters, one of them with the plant's model."""
    filters = [ExtendedKalmanFilter(text_model()), ExtendedKalmanFilter(text_model(1.5))]
    return _case(IMM(filters, [[0.99, 0.01], [0.01, 0.99]]), true_step, _both)


CASES: dict[str, Callable[[], Case]] = {
    "extended Kalman filter": extended,
    "unscented Kalman filter": unscented,
    "extended Kalman filter, functions": extended_called,
    "unscented Kalman filter, functions": unscented_called,
    "IMM of extended Kalman filters": bank,
}
