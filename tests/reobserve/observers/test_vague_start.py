"""Vague starts: correct, or a warning that names the covariance; probabilities of far-off modes."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

from reobserve import (
    IMM,
    ExtendedKalmanFilter,
    KalmanFilter,
    LinearModel,
    NonlinearModel,
    rts_smoother,
)
from reobserve.observers.gaussian_state import VagueStartWarning

MOTION = LinearModel([[1.0, 1.0], [0.0, 1.0]], C=[[1.0, 0.0]], Q=0.0, R=1.0)
Y = [1.0, 3.0, 2.0, 5.0, 4.0]


@pytest.mark.parametrize("start", [1e13, [1.0, 1e15], 1e17])
def test_start_that_loses_digits_is_said(start: float) -> None:
    kalman = KalmanFilter(MOTION)
    said = r"covariance: the variance of state \d falls from"
    with pytest.warns(VagueStartWarning, match=said) as warned:
        run = kalman.run(Y, start=kalman.init([0.0, 0.0], start))
    assert {one.filename for one in warned} == {__file__}  # the line that called
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert (rts_smoother(run)["variance"] >= 0).all()


@pytest.mark.parametrize("others", [KalmanFilter, ExtendedKalmanFilter])
@pytest.mark.parametrize("modes", [[1e15, 1e15], [1.0, 1e15]])
def test_start_of_a_bank_that_loses_digits_is_said(others: Any, modes: list[float]) -> None:
    pendulum = NonlinearModel(["a + b", "b"], ["a"], Q=0.0, R=1.0, state_names=["a", "b"])
    filters = [others(MOTION if others is KalmanFilter else pendulum)] * 2
    bank = IMM(filters, [[0.9, 0.1], [0.1, 0.9]])
    state = bank.init([0.0, 0.0], [one * np.eye(2) for one in modes])
    with pytest.warns(VagueStartWarning, match="covariance: the variance of state 1") as warned:
        bank.run(Y, start=state)
    with pytest.warns(VagueStartWarning):
        bank.step(state, [1.0])
    assert [one.filename for one in warned] == [__file__]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        bank.run(Y, start=bank.init([0.0, 0.0], 1e8))


def test_start_of_one_of_many_records_is_said() -> None:
    kalman = KalmanFilter(MOTION)
    states = [kalman.init([0.0, 0.0], start) for start in (1.0, 1e17, 1.0)]
    said = r"the variance of state 1 falls from 1e\+17 to 1 at row 0"
    with pytest.warns(VagueStartWarning, match=said) as warned:
        kalman.run(np.array([Y, Y, Y])[:, :, None], start=states)
    assert [one.filename for one in warned] == [__file__]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        kalman.run(np.array([Y, Y])[:, :, None], start=[states[0], states[2]])


def test_precise_measurements_in_one_of_many_records_are_said() -> None:
    one = LinearModel(np.eye(2), C=[[1.0, 1.0], [1.0, 1.0 + 1e-7]], Q=0.0, R=1e-14)
    kalman = KalmanFilter(one)
    states = [kalman.init([0.0, 0.0], start) for start in (1e-12, 1.0, 1e-12)]
    said = r"measurements of the same are far more precise than their prediction at row 0"
    with pytest.warns(VagueStartWarning, match=said) as warned:
        kalman.run(np.ones((3, 2, 2)), start=states)
    assert [one.filename for one in warned] == [__file__]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        kalman.run(np.ones((2, 2, 2)), start=[states[0], states[2]])


def test_usual_start_is_least_squares_without_a_warning() -> None:
    kalman = KalmanFilter(MOTION)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = kalman.run(Y, start=kalman.init([0.0, 0.0], 1e8))
        smoothed = rts_smoother(run)
    slope, offset = np.polyfit(np.arange(5.0), Y, 1)
    assert run["state"][-1] == pytest.approx([offset + 4 * slope, slope], rel=1e-6)
    assert smoothed["state"][:, 0] == pytest.approx(offset + slope * np.arange(5.0), rel=1e-6)


@pytest.mark.parametrize("far", [1.0, 1e7, 2e8, -1e9, 1e12])
def test_probabilities_of_modes_sum_to_one(far: float) -> None:
    models = [LinearModel([[0.9]], C=[[1.0]], Q=q, R=1.0) for q in (0.1, 1.0, 2.0)]
    bank = IMM([KalmanFilter(one) for one in models], np.full((3, 3), 1 / 3))
    run = bank.run([far, 0.0, 1.0], start=bank.init([0.0], 1.0))
    assert run["probability"].sum(axis=1) == pytest.approx(1.0, abs=1e-12)
