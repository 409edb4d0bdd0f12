"""States know their time: records that do not follow on from a state are refused."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import numpy as np
import pytest

from reobserve import InputError, KalmanFilter, LinearModel
from reobserve.observers.high_gain import HighGainObserver
from reobserve.observers.levant import LevantDifferentiator
from reobserve.systems.triangular_text import triangular_model

PERIOD = 0.1


def high_gain() -> tuple[Any, Any]:
    observer = HighGainObserver(
        triangular_model(["a", "b"], ["0", "-sin(a)"], "1"), rho=1.0, sampling_period=PERIOD
    )
    return observer, observer.init([0.0, 0.0])


def levant() -> tuple[Any, Any]:
    observer = LevantDifferentiator(L=1.0, order=1, sampling_period=PERIOD)
    return observer, observer.init([0.0, 0.0])


def kalman() -> tuple[Any, Any]:
    model = LinearModel([[1.0]], C=[[1.0]], Q=1.0, R=1.0, sampling_period=PERIOD)
    return KalmanFilter(model), KalmanFilter(model).init([0.0], 1.0)


def uneven() -> tuple[Any, Any]:
    model = LinearModel.from_ode(
        [[0.0]], C=[[1.0]], density=1.0, R=1.0, sampling_period=PERIOD
    )  # fmt: skip
    return KalmanFilter(model), KalmanFilter(model).init([0.0], 1.0)


def record(observer: Any, rows: int = 10) -> tuple[Any, Any]:
    y = np.sin(np.arange(float(rows)))
    return y, np.zeros(rows) if observer.inputs else None


@pytest.mark.parametrize("make", [high_gain, levant, kalman])
@pytest.mark.parametrize("begin", [60.0, 1000.5, 0.0, 1000.9])
def test_gap_overlap_and_clock_set_back_are_refused(make: Any, begin: float) -> None:
    observer, state = make()
    y, u = record(observer)
    timestamps = PERIOD * np.arange(10.0)
    first = observer.run(y, u, start=state, time=1000.0 + timestamps)
    assert first.end.time == pytest.approx(1000.9)
    with pytest.raises(InputError, match=r"time: goes from 1000\.9 to"):
        observer.run(y, u, start=first.end, time=begin + timestamps)
    for kept in (first.end, copy.deepcopy(first.end), pickle.loads(pickle.dumps(first.end))):
        for given in (None, 1001.0 + timestamps):
            assert observer.run(y, u, start=kept, time=given).time == pytest.approx(
                1001.0 + timestamps
            )


@pytest.mark.parametrize("make", [high_gain, levant, kalman, uneven])
def test_time_after_steps_without_goes_on_from_their_count(make: Any) -> None:
    observer, state = make()
    y, u = record(observer)
    for k in range(3):
        state, one = observer.step(state, y[k], None if u is None else u[k])
    assert one.time == pytest.approx(0.2)
    control = None if u is None else u[3]
    for wrong in (0.57, 0.2, 70.0):
        with pytest.raises(InputError, match=r"time: (goes from 0.2|begins at)"):
            observer.step(state, y[3], control, time=wrong)
    state, one = observer.step(state, y[3], control, time=0.3)
    assert state.time == one.time == 0.3
    again = observer.step(state, y[3], control)
    assert again[1].time == pytest.approx(0.4)
