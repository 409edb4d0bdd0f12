"""A search finds the same objective where states and outputs have other units."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from reobserve import KalmanFilter, LinearModel, tune
from reobserve.tuning.search import Tuned

Array = NDArray[np.float64]

A = np.array([[1.0, 0.1], [-0.2, 0.95]])
rng = np.random.default_rng(4)


def records() -> list[tuple[Array, Array]]:
    """Truths and measurements of position and rate."""
    found = []
    for _ in range(2):
        x, rows = np.array([1.0, 0.0]), []
        for _ in range(60):
            x = A @ x + [0.02, 0.1] * rng.standard_normal(2)
            rows.append(x)
        truth = np.array(rows)
        found.append((truth, truth + 0.3 * rng.standard_normal(truth.shape)))
    return found


RECORDS = records()


def found(x: Array, y: Array) -> Tuned:
    """Noise that is best where states and outputs have the units x and y."""
    C = np.diag(x / y)

    def make(settings: dict[str, float]) -> Any:
        Q = [settings["place"], settings["rate"]]
        return KalmanFilter(LinearModel(A * x / x[:, None], C=C, Q=Q, R=0.09 / y**2))

    def score(one: Any, record: tuple[Array, Array]) -> float:
        truth, measured = record
        run = one.run(measured / y, start=one.init(truth[0] / x, 1.0 / x**2))
        error = (run["state"] * x - truth) / truth.std(axis=0)
        return float(np.sqrt(np.mean(error**2)))

    ranges = {
        name: (1e-6 / unit**2, 1.0 / unit**2)
        for name, unit in zip(("place", "rate"), x, strict=True)
    }
    return tune(make, ranges, RECORDS, score, 32, 3)


@cache
def wanted() -> float:
    """The objective in units of one."""
    return found(np.ones(2), np.ones(2)).objective


units = st.lists(st.floats(-9.0, 9.0), min_size=4, max_size=4)


@given(units)
@settings(max_examples=4)
def test_objective_is_that_of_other_units(powers: list[float]) -> None:
    one = 10.0 ** np.array(powers)
    other = found(one[:2], one[2:]).objective
    assert abs(other / wanted() - 1.0) < 0.01
