"""Measurements without noise, against a filter in 50 digits, and what refuses them."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from reobserve import (
    IMM,
    AugmentedKalmanFilter,
    DivergenceError,
    ExtendedKalmanFilter,
    InputError,
    KalmanFilter,
    LinearModel,
    NonlinearModel,
    UnscentedKalmanFilter,
    rts_smoother,
    steady_kalman,
)

Array = NDArray[np.float64]

ROWS = 8
A = np.array([[0.9, 0.3], [-0.2, 0.8]])


def linear(C: Array, R: Any) -> LinearModel:
    return LinearModel(A, C=C, Q=[0.2, 0.1], R=R)


def texts(C: Array, R: Any) -> NonlinearModel:
    names = [f"c{o}{a}" for o in range(len(C)) for a in (0, 1)]
    h = [f"c{o}0*a + c{o}1*b" for o in range(len(C))]
    return NonlinearModel(
        ["0.9*a + 0.3*b", "0.8*b - 0.2*a"], h, [0.2, 0.1], R, state_names=["a", "b"],
        parameters=dict(zip(names, C.ravel().tolist(), strict=True)),
    )  # fmt: skip


FILTERS: dict[str, Callable[[Array, Any], Any]] = {
    "kalman": lambda C, R: KalmanFilter(linear(C, R)),
    "extended": lambda C, R: ExtendedKalmanFilter(texts(C, R)),
    "unscented": lambda C, R: UnscentedKalmanFilter(texts(C, R)),
}


def exact(C: Array, R: Array, P: Array, y: Array) -> tuple[Array, Array]:
    """Means and covariances of the filter in 50 digits."""
    means, covariances = np.empty((ROWS, 2)), np.empty((ROWS, 2, 2))
    with mpmath.workdps(50):
        a, c, r, q = (mpmath.matrix(each.tolist()) for each in (A, C, R, np.diag([0.2, 0.1])))
        x, p = mpmath.zeros(2, 1), mpmath.matrix(P.tolist())
        for k in range(ROWS):
            if k:
                x, p = a * x, a * p * a.T + q
            gain = p * c.T * (c * p * c.T + r) ** -1
            x, p = x + gain * (mpmath.matrix(y[k].tolist()) - c * x), p - gain * c * p
            means[k] = [float(v) for v in x]
            covariances[k] = np.array([[float(p[i, j]) for j in (0, 1)] for i in (0, 1)])
    return means, covariances


@pytest.mark.parametrize("kind", FILTERS)
@settings(max_examples=12, deadline=None)
@given(
    angle=st.integers(0, 30).map(lambda i: 0.1 * i), second=st.floats(0.4, 1.5),
    spread=st.floats(0.1, 10.0),
    noise=st.sampled_from([(0.0, 0.0), (0.0, 0.3), (0.4, 0.0)]), both=st.booleans(),
    seed=st.integers(0, 1000),
)  # fmt: skip
@example(angle=0.0, second=np.pi / 2, spread=1.0, noise=(0.0, 0.0), both=True, seed=1)
def test_filters_are_those_of_exact_arithmetic(
    kind: str, angle: float, second: float, spread: float, noise: Any, both: bool, seed: int
) -> None:
    angles = np.array([angle, angle + second])[: 1 + both]
    C, R = np.column_stack([np.cos(angles), np.sin(angles)]), np.diag(noise[: 1 + both])
    rng = np.random.default_rng(seed)
    root, y = rng.normal(size=(2, 2)), rng.normal(size=(ROWS, len(C)))
    P = root @ root.T + spread * np.eye(2)
    P = 0.5 * (P + P.T)
    observer = FILTERS[kind](C, R)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # what is measured exactly is no vague start
        run = observer.run(y, start=observer.init([0.0, 0.0], P))
    means, covariances = exact(C, R, P, y)
    assert run["state"] == pytest.approx(means, abs=1e-10)
    assert run["covariance"] == pytest.approx(covariances, abs=1e-10)
    assert run["variance"].min() >= 0.0
    smoothed = rts_smoother(run)["variance"]
    assert smoothed.min() >= 0.0


def test_banks_and_faults_take_exact_measurements() -> None:
    y = np.array([[0.3], [0.1], [np.nan], [-0.2]])
    kalman = KalmanFilter(linear(np.array([[1.0, 0.0]]), 0.0))
    sought = kalman.run(y, start=kalman.init([0.0, 0.0], 1.0))
    bank = IMM([kalman, kalman], transition=[[0.9, 0.1], [0.1, 0.9]])
    assert bank.run(y, start=bank.init([0.0, 0.0], 1.0))["state"] == pytest.approx(sought["state"])
    augmented = AugmentedKalmanFilter(kalman.model, fault_matrix=[[0.0], [1.0]], random_walk=0.1)
    whole = KalmanFilter(augmented.whole)
    found = augmented.run(y, start=augmented.init([0.0, 0.0], 1.0))
    other = whole.run(y, start=whole.init(np.zeros(3), 1.0))
    assert np.array_equal(found["state"], other["state"][:, :2])


@pytest.mark.parametrize("kind", FILTERS)
def test_measurement_that_tells_nothing_new_stops_the_filter(kind: str) -> None:
    """Both outputs are the same state, without noise: S is singular."""
    observer = FILTERS[kind](np.array([[1.0, 0.0], [1.0, 0.0]]), 0.0)
    with pytest.raises(DivergenceError, match="is not finite and positive definite"):
        observer.run(np.zeros((3, 2)), start=observer.init([0.0, 0.0], 1.0))


EXACT = linear(np.array([[1.0, 0.0]]), 0.0)
NOISY = KalmanFilter(linear(np.array([[1.0, 0.0]]), 0.1))
S = np.array([[0.01], [0.0]])
DIVIDES: dict[str, Callable[[], Any]] = {
    "S": lambda: KalmanFilter(EXACT).run([0.0, 0.1], start=NOISY.init([0, 0], 1), S=0 * S),
    "S and R by row": lambda: NOISY.run([0, 1], start=NOISY.init([0, 0], 1), S=S, R=[0.1, 0.0]),
    "S of a bank": lambda: bank_of(KalmanFilter(EXACT)).run(
        [0.0, 0.1], start=bank_of(NOISY).init([0.0, 0.0], 1.0), S=0 * S
    ),
    "noise_memory": lambda: KalmanFilter(EXACT, noise_memory=10.0),
    "noise_memory of a nonlinear filter": lambda: ExtendedKalmanFilter(
        texts(np.eye(2), [0.1, 0.0]), noise_memory=10.0
    ),
    "steady gain": lambda: steady_kalman(EXACT),
}


def bank_of(kalman: KalmanFilter) -> IMM:
    return IMM([kalman, kalman], transition=[[0.9, 0.1], [0.1, 0.9]])


@pytest.mark.parametrize("call", DIVIDES.values(), ids=DIVIDES)
def test_what_divides_by_noise_refuses_it(call: Callable[[], Any]) -> None:
    with pytest.raises(InputError, match=r"^R(\[1\])?: must be positive definite, .*d\^2 / 12$"):
        call()


def test_noise_beside_correlated_noise_is_checked_as_without() -> None:
    start = NOISY.init([0.0, 0.0], 1.0)
    for R in ([[1.0], [2.0, 3.0]], "little", [0.1, 0.2, 0.3]):
        with pytest.raises(InputError, match=r"^R: "):
            NOISY.run([0.0, 1.0], start=start, S=S, R=R)
    for R in (0.1, [0.1], [[0.1]], [0.1, 0.1], [[[0.1]], [[0.1]]]):
        found = NOISY.run([0.0, 1.0], start=start, S=S, R=R)["state"]
        assert np.array_equal(found, NOISY.run([0.0, 1.0], start=start, S=S)["state"])
