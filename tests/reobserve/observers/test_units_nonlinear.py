"""Extended and unscented filters and their smoother in units of states and outputs far apart."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from reobserve import ExtendedKalmanFilter, NonlinearModel, UnscentedKalmanFilter, rts_smoother

Array = NDArray[np.float64]

# Of a pendulum with a drifting bias of its rate: states angle, rate and bias.
START = np.array([0.0, 0.4, 0.0])
P0, Q, R = np.diag([0.3, 0.2, 0.01]), np.diag([1e-4, 1e-3, 1e-5]), np.diag([1e-2, 4e-2])
P0[0, 1] = P0[1, 0] = 0.1
NAMES = ("pa", "pw", "pb", "qa", "qs")

rng = np.random.default_rng(5)
y = np.stack([np.sin(0.3 * np.arange(30)), 0.3 + np.cos(0.3 * np.arange(30))], axis=1)
y += 0.1 * rng.standard_normal(y.shape)
y[4, 0], y[9:11] = np.nan, np.nan


def step(x: Array, u: Array, p: Array) -> Array:
    """The next state, where p are the sizes of units of states."""
    a, w, b = x[0] * p[0], x[1] * p[1], x[2] * p[2]
    a_next = a + 0.1 * w + 0.02 * math.tanh(3.0 * a)
    b_next = 0.9 * b + 0.02 * math.tanh(5.0 * b)
    return np.array([a_next / p[0], (w - 0.9 * math.sin(a) - 0.01 * w * w) / p[1], b_next / p[2]])


def output(x: Array, u: Array, p: Array) -> Array:
    """The position, and the rate with its bias."""
    a, w, b = x[0] * p[0], x[1] * p[1], x[2] * p[2]
    return np.array([math.sin(a) / p[3], (w + b) / p[4]])


def of_text(**options: Any) -> NonlinearModel:
    tanh, other = (f"0.02*(1 - 2/(exp({rate}) + 1))" for rate in ("6*(a*pa)", "10*(b*pb)"))
    return NonlinearModel(
        [
            f"a + (0.1*(w*pw) + {tanh})/pa", "w - (0.9*sin(a*pa) + 0.01*(w*pw)**2)/pw",
            f"0.9*b + {other}/pb",
        ],
        ["sin(a*pa)/qa", "(w*pw + b*pb)/qs"], state_names=["a", "w", "b"], **options,
    )  # fmt: skip


def of_python(**options: Any) -> NonlinearModel:
    return NonlinearModel(step, output, states=3, outputs=2, **options)


MODELS: dict[str, Callable[..., NonlinearModel]] = {"text": of_text, "function": of_python}
FILTERS: dict[str, Any] = {"extended": ExtendedKalmanFilter, "unscented": UnscentedKalmanFilter}


def estimates(kind: str, model: str, x: Array, s: Array) -> dict[str, Array]:
    """Filtered and smoothed estimates in units of the record, found in units x and s."""
    one = FILTERS[kind](
        MODELS[model](
            Q=Q / np.outer(x, x), R=R / np.outer(s, s),
            parameters=dict(zip(NAMES, [*x, *s], strict=True)),
        )
    )  # fmt: skip
    run = one.run(y / s, start=one.init(START / x, P0 / np.outer(x, x)))
    smoothed = rts_smoother(run)
    found = {"filtered": run, "smoothed": smoothed}
    return {
        f"{name} {part}": np.array(estimate[part] * scale)
        for name, estimate in found.items()
        for part, scale in (("state", x), ("covariance", np.outer(x, x)))
    }


units = st.lists(st.floats(-9.0, 9.0), min_size=5, max_size=5)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("kind", FILTERS)
@given(units)
def test_estimates_are_those_of_other_units(kind: str, model: str, powers: list[float]) -> None:
    one = 10.0 ** np.array(powers)
    wanted = estimates(kind, "text", np.ones(3), np.ones(2))
    found = estimates(kind, model, one[:3], one[3:])
    for name, values in wanted.items():
        size = np.abs(values).max(axis=0)
        np.testing.assert_array_less(np.abs(found[name] - values) / size, 1e-6, err_msg=name)


@pytest.mark.parametrize("variance", [1e-6, 1.0, 1e4, 1e8])
@pytest.mark.parametrize("mean", [0.0, 1e-12])
def test_differences_near_zero_keep_digits_beside_a_large_output(
    mean: float, variance: float
) -> None:
    options: Any = {"states": 1, "outputs": 1, "Q": 1e-4, "R": 1e-2}

    def f(x: Array) -> Array:
        return np.array([0.9 * x[0] + 0.4])

    def h(x: Array) -> Array:
        return np.array([1e3 + math.sin(x[0])])

    models = (
        NonlinearModel(f, h, **options),
        NonlinearModel(
            f, h, F=lambda x: np.array([[0.9]]), H=lambda x: np.array([[math.cos(x[0])]]), **options
        ),
    )
    rows = 1e3 + np.sin([0.1, 0.4, 0.7])
    found, wanted = (
        one.run(rows, start=one.init([mean], variance))["state"]
        for one in map(ExtendedKalmanFilter, models)
    )
    assert found == pytest.approx(wanted, rel=1e-8)
