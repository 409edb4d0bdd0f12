"""Measurements far more precise than their prediction, against 50 digits: right, or it is said.

Deviations, and differences of means, are counted in standard deviations after the last row.
"""

from __future__ import annotations

import warnings
from typing import Any, NamedTuple

import numpy as np
import pytest
from mpmath import matrix, workdps
from numpy.typing import NDArray

from reobserve import ExtendedKalmanFilter, KalmanFilter, LinearModel, NonlinearModel
from reobserve.core.errors import DivergenceError
from reobserve.observers.gaussian_state import VagueStartWarning

Array = NDArray[np.float64]
NAN = np.nan


class Problem(NamedTuple):
    """Constant states, or those of A, that begin at zero."""

    C: list[list[float]]
    R: list[float]
    P: Array
    y: list[list[float]]
    A: Array = np.eye(2)


def exact(one: Problem) -> tuple[Array, Array]:
    """The mean and the covariance after the last row."""
    with workdps(50):
        A, P, x = matrix(one.A.tolist()), matrix(one.P.tolist()), matrix([0.0, 0.0])
        for k, row in enumerate(one.y):
            if k:
                x, P = A * x, A * P * A.T
            for c, r, value in scalars(one, row):
                S = (c * P * c.T)[0] + r
                K = P * c.T / S
                x, P = x + K * (value - (c * x)[0]), P - K * S * K.T
        return np.array(x.tolist(), float)[:, 0], np.array(P.tolist(), float)


def scalars(one: Problem, row: list[float]) -> list[tuple[Any, float, float]]:
    """Measurements one by one, which is the same where their noise is uncorrelated."""
    parts = zip(one.C, one.R, row, strict=True)
    return [(matrix([c]), r, value) for c, r, value in parts if not np.isnan(value)]


def linear(one: Problem) -> Any:
    return KalmanFilter(LinearModel(one.A, C=one.C, Q=0.0, R=one.R))


def extended(one: Problem) -> Any:
    f, h = ([f"{row[0]!r}*a + {row[1]!r}*b" for row in rows] for rows in (one.A.tolist(), one.C))
    return ExtendedKalmanFilter(NonlinearModel(f, h, 0.0, one.R, state_names=["a", "b"]))


FILTERS = {"Kalman": linear, "extended Kalman": extended}


def compare(kind: str, one: Problem) -> tuple[float, float]:
    """How far the mean and the covariance are off."""
    filter_ = FILTERS[kind](one)
    run = filter_.run(one.y, start=filter_.init([0.0, 0.0], one.P))
    x, P = exact(one)
    deviations = np.sqrt(np.diag(P))
    apart = (run["covariance"][-1] - P) / np.outer(deviations, deviations)
    return np.abs((run["state"][-1] - x) / deviations).max(), np.abs(apart).max()


def equal(R: float) -> Problem:
    """Two equal sensors of a state."""
    e = R**0.5
    return Problem([[1.0, 0.0], [1.0, 0.0]], [R, R], np.eye(2), [[1.0, 1 + e], [1 - e, 1.0]])


def near(R: float) -> Problem:
    """Two sensors that differ by a little of another state, of which they tell something."""
    e = R**0.5
    return Problem([[1.0, 1.0], [1.0, 1 + e]], [R, R], np.eye(2), [[1.0, 1 + e]])


def unequal(R: float) -> Problem:
    """A precise and a usual sensor of a state."""
    return Problem([[1.0, 0.0], [1.0, 0.0]], [R, 1.0], np.eye(2), [[1.0, 1.5], [1.0, 0.3]])


def bierman(e: float, *, at_once: bool) -> Problem:
    """Bierman 1977, page 96: y1 = a + e b, y2 = a + b after a start of deviation 1 / e."""
    y = [[1.0, 2.0]] if at_once else [[1.0, NAN], [NAN, 2.0]]
    return Problem([[1.0, e], [1.0, 1.0]], [1.0, 1.0], np.eye(2) / e**2, y)


@pytest.mark.parametrize("kind", FILTERS)
@pytest.mark.parametrize("power", [2, 4, 6, 8, 10, 12, 14, 15, 16, 18, 20, 24])
@pytest.mark.parametrize("problem", [equal, near, unequal])
def test_precise_sensors_are_right_or_it_is_said(kind: str, problem: Any, power: int) -> None:
    refused = ""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            mean, covariance = compare(kind, problem(10.0**-power))
        except DivergenceError as error:
            refused = str(error)
    if refused:
        assert power >= 15
        assert problem is not unequal
        assert "measurements of the same are too precise" in refused
        return
    assert all(one.category is VagueStartWarning for one in said)
    assert said or max(mean, 100 * covariance) < 1e-3
    if problem is unequal:  # these are right where digits would be lost, too
        assert max(mean, 1e6 * covariance) < 1e-6
    if power <= 10:
        assert mean < 1e-4
        assert not said


@pytest.mark.parametrize("kind", FILTERS)
@pytest.mark.parametrize("at_once", [True, False])
@pytest.mark.parametrize("e", [1e-3, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-12])
def test_example_of_bierman_is_right(kind: str, at_once: bool, e: float) -> None:
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        mean, covariance = compare(kind, bierman(e, at_once=at_once))
    assert mean < 1e-14
    assert covariance < max(1e-9, 1e-15 / e)
    assert bool(said) == (e < 1e-6)  # a variance falls by more than 1e12


@pytest.mark.parametrize("kind", FILTERS)
@pytest.mark.parametrize("R", [0.1, 1e-4])
@pytest.mark.parametrize("start", [[1.0, 1.0], [1.0, 1e-5], [1.0, 1e5], [3.0, -7e-9], [0.1, 0.3]])
def test_start_of_rank_one_is_right(kind: str, start: list[float], R: float) -> None:
    A = np.array([[1.0, 0.1], [-0.2, 0.9]])
    x, y = np.array(start), []
    for _ in range(4):
        y.append([x[0]])
        x = A @ x
    mean, covariance = compare(kind, Problem([[1.0, 0.0]], [R], np.outer(start, start), y, A))
    assert mean < 1e-6
    assert covariance < 1e-6
