"""Plants, priors and process noise up to 1e20 times R: no filter returns a variance below zero.

Where digits are lost there is a warning or an error, and who does what it says has neither.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from mpmath import inverse, matrix, workdps
from numpy.typing import NDArray
from scipy.linalg import expm

from reobserve import (
    IMM,
    AugmentedKalmanFilter,
    ExtendedKalmanFilter,
    FaultBank,
    GridFilter,
    KalmanFilter,
    LinearModel,
    NonlinearModel,
    UnscentedKalmanFilter,
)
from reobserve.core.errors import DivergenceError
from reobserve.observers.gaussian_state import REMEDY, VagueStartWarning

Array = NDArray[np.float64]

SMALL = 1e10  # times R: what `REMEDY` allows


class Plant(NamedTuple):
    """A drawn plant and its record."""

    A: Array
    C: Array
    E: Array
    y: Array
    r: float

    @classmethod
    def draw(cls, seed: int) -> Plant:
        draw = np.random.default_rng(seed)
        n = int(draw.integers(1, 5))
        m = int(draw.integers(1, min(n, 3) + 1))
        rates = draw.standard_normal((n, n))
        rates -= np.eye(n) * (np.linalg.eigvals(rates).real.max() - draw.choice([-1, -0.1, 0, 0.1]))
        chain = np.eye(n) + 0.1 * np.diag(np.ones(n - 1), 1)
        A = chain if draw.random() < 0.2 else expm(rates * 10 ** draw.uniform(-2, 0))
        C = np.eye(m, n) if draw.random() < 0.3 else draw.standard_normal((m, n))
        r = 10 ** draw.uniform(-6, 6)
        y = draw.standard_normal((15, m)) * r**0.5
        return cls(A, C, draw.standard_normal((n, 1)), y, r)

    def model(self, q: float) -> LinearModel:
        n, m = self.C.shape[::-1]
        return LinearModel(
            self.A, C=self.C, Q=q * self.r * np.eye(n), R=self.r * np.eye(m), sampling_period=0.1,
            check=False,
        )  # fmt: skip


def kalman(one: Plant, q: float, p: float) -> Any:
    observer = KalmanFilter(one.model(q))
    return observer, observer.init(np.zeros(len(one.A)), p * one.r)


def augmented(one: Plant, q: float, p: float) -> Any:
    observer = AugmentedKalmanFilter(one.model(1.0), fault_matrix=one.E, random_walk=q * one.r)
    return observer, observer.init(np.zeros(len(one.A)), one.r, unknown_input_covariance=p * one.r)


def faults(one: Plant, q: float, p: float) -> Any:
    sizes = {"drift": 0.01 * (q * one.r) ** 0.5, "jump": (q * one.r) ** 0.5}
    observer = FaultBank(one.model(1.0), fault_matrix=one.E, **sizes, jump_rate=0.1, jump_time=0.5)
    return observer, observer.init(np.zeros(len(one.A)), one.r, fault_covariance=p * one.r)


def bank(one: Plant, q: float, p: float) -> Any:
    modes = [KalmanFilter(one.model(noise)) for noise in (1.0, q)]
    observer = IMM(modes, [[0.9, 0.1], [0.1, 0.9]])
    return observer, observer.init(np.zeros(len(one.A)), p * one.r)


def grid(one: Plant, q: float, p: float) -> Any:
    def make(value: float) -> LinearModel:
        return one._replace(C=value * one.C).model(q)

    observer = GridFilter.of_parameter(make, grid=[0.5, 1.0, 2.0], jump_rate=0.1)
    return observer, observer.init(np.zeros(len(one.A)), p * one.r)


@cache
def pendulum(q: float) -> NonlinearModel:
    """A pendulum whose torque is a state."""
    model = NonlinearModel(
        ["a + 0.1*b", "b - 0.5*sin(a) + 0.1*d"], ["a"], 1.0, 1.0, state_names=["a", "b"],
        parameters={"d": 0.0}, sampling_period=0.1,
    )  # fmt: skip
    return model.with_parameter_states({"d": q})


def extended(one: Plant, q: float, p: float, kind: Any = ExtendedKalmanFilter) -> Any:
    observer = kind(pendulum(q))
    return observer, observer.init(np.zeros(3), np.diag([1.0, 1.0, p]))


def unscented(one: Plant, q: float, p: float) -> Any:
    return extended(one, q, p, UnscentedKalmanFilter)


LINEAR = (kalman, augmented, faults, bank, grid)
Made = Callable[[Plant, float, float], Any]


def attempt(make: Made, one: Plant, q: float, p: float, *, steps: bool) -> tuple[Any, bool]:
    """The run, or None if it stops, and whether there was a warning; nothing is below zero."""
    observer, state = make(one, q, p)
    y = one.y if make in LINEAR else one.y[:, :1] / one.r**0.5
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            run = observer.run(y, start=state)
            check(run)
            if steps:
                for row in y:
                    state, estimate = observer.step(state, row)
                    check(estimate)
        except DivergenceError as error:
            run = None
            cause = REMEDY in str(error) or "too precise" in str(error) or "Cholesky" in str(error)
            assert cause or make in LINEAR[2:]
    assert {one.category for one in said} <= {VagueStartWarning}
    return run, bool(said)


def check(run: Any) -> None:
    for name in run:
        if name.endswith("covariance"):
            assert not (run[name].diagonal(0, -2, -1) < 0).any()
        if name.endswith("variance") and not name.endswith("covariance"):
            assert not (run[name] < 0).any()


def exact(filter_: KalmanFilter, start: Array, y: Array) -> tuple[Array, Array]:
    """The mean and the covariance after the last row, with 50 digits."""
    with workdps(50):
        A, C, Q, R = (matrix(getattr(filter_.model, name).tolist()) for name in "ACQR")
        x, P = matrix([0.0] * len(start)), matrix(start.tolist())
        for k, row in enumerate(y):
            if k:
                x, P = A * x, A * P * A.T + Q
            K = P * C.T * inverse(C * P * C.T + R)
            x, P = x + K * (matrix(row.tolist()) - C * x), P - K * C * P
        return np.array(x.tolist(), float)[:, 0], np.array(P.tolist(), float)


def compare(make: Made, one: Plant, q: float, p: float, run: Any) -> None:
    """Check the last row against 50 digits, in its standard deviations."""
    observer, state = make(one, q, p)
    whole = KalmanFilter(observer.whole)
    x, P = exact(whole, state.posterior.covariance, one.y)
    n = len(one.A)
    deviations = np.sqrt(np.diag(P))[:n]
    assert np.abs((run["state"][-1] - x[:n]) / deviations).max() < 1e-2
    apart = (run["covariance"][-1] - P[:n, :n]) / np.outer(deviations, deviations)
    assert np.abs(apart).max() < 1e-2


POWERS = st.floats(-2, 20)


@pytest.mark.parametrize("make", [*LINEAR, extended, unscented])
@given(seed=st.integers(0, 2**32 - 1), q=POWERS, p=POWERS, steps=st.booleans())
@example(seed=0, q=20.0, p=20.0, steps=False)
def test_no_variance_is_below_zero(
    make: Made, seed: int, q: float, p: float, *, steps: bool
) -> None:
    one = Plant.draw(seed)
    run, said = attempt(make, one, 10**q, 10**p, steps=steps)
    if run is None or said:
        small = min(10**q, SMALL), min(10**p, SMALL)
        run, said = attempt(make, one, *small, steps=steps)
        assert run is not None
        assert not said
        if make in (kalman, augmented):
            compare(make, one, *small, run)


def turning(degrees: float) -> Array:
    """An oscillator over one sample."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, s], [-s, c]])


@pytest.mark.parametrize("kind", [KalmanFilter, ExtendedKalmanFilter, IMM])
@given(degrees=st.integers(1, 90), missing=st.booleans(), power=st.integers(-9, 9))
@example(degrees=3, missing=False, power=0)
def test_variance_that_is_zero_to_rounding_stops_nothing(
    kind: Any, degrees: int, power: int, *, missing: bool
) -> None:
    """The position is known, and the velocity turns into it and back."""
    A, scale = turning(degrees), 10.0**power
    model: Any = LinearModel(A, C=[[1.0, 0.0]], Q=0.0, R=0.01 * scale, check=False)
    if kind is ExtendedKalmanFilter:
        parameters = {"c": float(A[0, 0]), "s": float(A[0, 1])}
        model = NonlinearModel(
            ["c*a + s*b", "c*b - s*a"], ["a"], 0.0, 0.01 * scale, state_names=["a", "b"],
            parameters=parameters,
        )  # fmt: skip
    filter_ = KalmanFilter(model) if kind is not ExtendedKalmanFilter else kind(model)
    if kind is IMM:
        filter_ = IMM([filter_, filter_], [[0.9, 0.1], [0.1, 0.9]])
    y = np.full((100, 1), np.nan if missing else 0.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", VagueStartWarning)  # of a variance that is nearly zero
        run = filter_.run(y, start=filter_.init([0.0, 0.0], np.diag([0.0, scale])))
    check(run)
    if kind is KalmanFilter:
        P = np.diag([0.0, scale])
        for k in range(100):
            P = A @ P @ A.T if k else P
            K = P[:, 0] / (P[0, 0] + 0.01 * scale)
            P = P if missing else P - np.outer(K, P[0])
        assert run["covariance"][-1] == pytest.approx(P, abs=1e-12 * scale)


def test_model_in_innovation_form_that_is_known_stops_nothing() -> None:
    model = LinearModel([[0.9]], C=[[1.0]], Q=0.3 * 0.3 * 0.3, R=0.3)
    filter_ = KalmanFilter(model)
    check(filter_.run(np.zeros(20), start=filter_.init([0.0], 0.0), S=[[0.09]]))


def test_sigma_points_of_negative_weight_are_no_rounding() -> None:
    model = NonlinearModel(["a**2"], ["a"], 1e-3, 1.0, state_names=["a"])
    filter_ = UnscentedKalmanFilter(model, kappa=-0.9, beta=-5.0)
    with pytest.raises(DivergenceError, match="no longer positive semidefinite"):
        filter_.run(np.zeros(5), start=filter_.init([0.0], 4.0))
