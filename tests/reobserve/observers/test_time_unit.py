"""What is a density in time: the same plant with times in another unit has the same estimates."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from reobserve import (
    AugmentedKalmanFilter,
    ExtendedKalmanFilter,
    GridFilter,
    KalmanFilter,
    LinearModel,
    NonlinearModel,
    UnscentedKalmanFilter,
)

PERIOD = 0.05  # [s]; with ``unit`` 1000 times are in milliseconds, and rates per millisecond


def lag(unit: float) -> LinearModel:
    return LinearModel.from_ode(
        [[-1.3 / unit]], [[1.3 / unit]], [[1]], density=1e-3 / unit, R=1e-2,
        sampling_period=PERIOD * unit,
    )  # fmt: skip


def augmented(unit: float) -> tuple[Any, Any]:
    plant = lag(unit)
    one = AugmentedKalmanFilter(plant, fault_matrix=plant.B, random_walk=0.02 / unit)
    return one, one.init([0.0], 0.1)


def grid_of_delays(unit: float) -> tuple[Any, Any]:
    one = GridFilter.of_delay(
        lag(unit), delays=unit * PERIOD * np.array([0.0, 1.0, 1.5, 4.0]),
        random_walk=0.003 * unit, jump_rate=0.1 / unit,
    )  # fmt: skip
    return one, one.init([0.0], 0.1)


def grid_of_values(unit: float) -> tuple[Any, Any]:
    def make(gain: float) -> LinearModel:
        plant = lag(unit)
        return LinearModel(
            plant.A, gain * plant.B, plant.C, Q=plant.Q, R=plant.R,
            sampling_period=plant.sampling_period,
        )  # fmt: skip

    one = GridFilter.of_parameter(
        make, grid=np.linspace(0.5, 2.0, 6), random_walk=0.01 / unit,
        rates=np.array([-0.1, 0.0, 0.1]) / unit, switch_rate=0.2 / unit,
    )  # fmt: skip
    return one, one.init([0.0], 0.1)


def parameter(unit: float, kind: Any, with_density: bool) -> tuple[Any, Any]:
    noise: dict[str, float] = (
        {"density": 1e-3 / unit} if with_density else {"Q": 1e-3 * PERIOD}
    )  # Q is of a sample
    model = NonlinearModel.from_ode(
        ["(u - a*x)/unit"], ["x"], R=1e-2, sampling_period=PERIOD * unit, substeps=2,
        state_names=["x"], input_names=["u"], parameters={"a": 1.0, "unit": unit}, **noise,
    )  # fmt: skip
    one = kind(model.with_parameter_states({"a": 0.02 / unit}))
    return one, one.init([0.0, 1.0], [0.1, 0.3])


CASES: dict[str, Callable[[float], tuple[Any, Any]]] = {
    "kalman": lambda unit: (KalmanFilter(lag(unit)), KalmanFilter(lag(unit)).init([0.0], 0.1)),
    "augmented": augmented,
    "delays": grid_of_delays,
    "values": grid_of_values,
    "EKF": lambda unit: parameter(unit, ExtendedKalmanFilter, False),
    "EKF with a density": lambda unit: parameter(unit, ExtendedKalmanFilter, True),
    "UKF": lambda unit: parameter(unit, UnscentedKalmanFilter, False),
}
RNG = np.random.default_rng(4)
Y, U = RNG.normal(size=60), np.sign(RNG.normal(size=60))


@pytest.mark.parametrize("power", [-6, -1, 3, 5])
@pytest.mark.parametrize("case", CASES)
def test_unit_of_time_leaves_estimates_alone(case: str, power: int) -> None:
    unit = 10.0**power
    (one, start), (other, begun) = CASES[case](1.0), CASES[case](unit)
    run, scaled = one.run(Y, U, start=start), other.run(Y, U, start=begun)
    assert scaled.time == pytest.approx(unit * run.time, rel=1e-12)
    for name in run.estimates:
        size = {"parameter": unit, "parameter_variance": unit**2}.get(name, 1.0)
        size = size if case == "delays" else 1.0
        assert scaled[name] == pytest.approx(size * run[name], rel=1e-7, abs=1e-9 * size), name
