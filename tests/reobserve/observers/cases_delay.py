"""Records with known truth for observers of delays, derivatives and normal forms.

On a ramp the plant x' = -x + u(t - tau) has the closed-form solution x = w (t - tau - 1), the
Taylor expansion is exact, and so is linear interpolation.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from reobserve.observers.extended_high_gain import ExtendedHighGainObserver
from reobserve.observers.high_gain import HighGainObserver
from reobserve.observers.levant import LevantDifferentiator
from reobserve.observers.normal_form import IdentityObserver, TransformedObserver
from tests.reobserve.observers.case import Case
from tests.reobserve.observers.small_plants import first_order_lag, pendulum, pendulum_slope
from tests.reobserve.observers.test_normal_form_observers import form, plant

Array = NDArray[np.float64]

PERIOD, DELAY, SLOPE, BOUNDS = 0.02, 0.6, 0.7, (0.0, 1.0)


def high_gain() -> Case:
    """The pendulum under a held torque that jumps at every fourth sample."""
    model = pendulum()
    u = np.repeat(np.random.default_rng(5).normal(0.0, 0.3, 50), 4)
    x = np.empty((len(u), 2))
    x[0] = 0.3, -0.2
    for k in range(len(u) - 1):
        x[k + 1] = solve_ivp(
            lambda _, v, k=k: pendulum_slope(v, u[k]), (0, PERIOD), x[k],
            method="DOP853", rtol=1e-10, atol=1e-12,
        ).y[:, -1]  # fmt: skip
    observer = HighGainObserver(model, rho=5.0, sampling_period=PERIOD)
    return Case(
        observer, x[:, 0], u, observer.init(x[0]), {"state": x}, {"state": 2e-3}, 0, 50.0, 1e308
    )


def _ramp(rows: int) -> tuple[Array, Array, Array]:
    """Times, u and x."""
    time = PERIOD * np.arange(rows)
    return time, SLOPE * time, SLOPE * (time - DELAY - 1.0)


def extended(alone: bool) -> Case:
    """The ramp with or without its slope; the initial delay is wrong."""
    time, u, x = _ramp(600)
    observer = ExtendedHighGainObserver(
        first_order_lag(), rho=3.0, order=1, delay_bounds=BOUNDS, sampling_period=PERIOD
    )
    known = u if alone else np.column_stack([u, np.full_like(u, SLOPE)])
    truth = {"state": x[:, None], "delay": np.full_like(time, DELAY)}
    bounds = {"state": 1e-6, "delay": 1e-6}
    return Case(observer, x, known, observer.init(x[:1], delay=0.3), truth, bounds, 400, 1e4, 1e308)


def levant() -> Case:
    """A parabola with exactly representable numbers, tracked to the last bit."""
    time = np.arange(400) / 64
    truth = np.column_stack([1.0 + 4.0 * time - 6.0 * time**2, 4.0 - 12.0 * time, 0 * time - 12.0])
    observer = LevantDifferentiator(L=4.0, sampling_period=1 / 64)
    start = observer.init(truth[0])
    return Case(
        observer, truth[:, 0], None, start, {"derivatives": truth}, {"derivatives": 1e-12}, 0, 1e6,
        None,
    )  # fmt: skip


def normal_form(kind: str) -> Case:
    """Van der Pol's oscillator with the injection that makes the error linear."""
    steps, step = 500, 0.01
    x = plant(step, steps)[::2]
    series = form(with_cubic=True)
    observer: Any = IdentityObserver(series, order=4, gain="jacobian", sampling_period=step)
    truth = {"state": x}
    if kind == "transformed":
        observer = TransformedObserver(series, order=4, sampling_period=step)
        truth["coordinates"] = np.column_stack([x[:, 0], x[:, 1] + x[:, 0] ** 3 / 3])
    bounds = dict.fromkeys(truth, 2e-4)
    return Case(observer, x[:, 0], None, observer.init(x[0]), truth, bounds, 0, 100.0)


CASES: dict[str, Callable[[], Case]] = {
    "high gain": high_gain,
    "extended high gain": lambda: extended(False),
    "extended high gain, u alone": lambda: extended(True),
    "differentiator": levant,
    "normal form, identity": lambda: normal_form("identity"),
    "normal form, transformed": lambda: normal_form("transformed"),
}
