"""Smoothed estimates against many digits: vague starts, growing states and singular noise."""

from __future__ import annotations

import pickle
import warnings
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from mpmath import mp
from numpy.typing import NDArray

from reobserve import (
    AugmentedKalmanFilter,
    ExtendedKalmanFilter,
    KalmanFilter,
    LinearModel,
    NonlinearModel,
    SmoothVariableStructureFilter,
    UnscentedKalmanFilter,
    rts_smoother,
)
from reobserve.core.errors import InputError

Array = NDArray[np.float64]
Exact = NDArray[Any]


def exact(values: Any) -> Exact:
    """Numbers with the digits of mpmath."""
    return np.vectorize(lambda one: mp.mpf(float(one)), otypes=[object])(np.asarray(values))


def inverse(matrix: Exact) -> Exact:
    return np.array(mp.inverse(mp.matrix(matrix.tolist())).tolist(), dtype=object)


def gain(cross: Exact, spread: Exact) -> Exact:
    """C P^+ of a positive semidefinite P: by its largest part that can be inverted."""
    rest, taken, least = spread.copy(), [], mp.mpf(10) ** (-mp.dps * 2 // 3)
    found = 0 * cross
    while True:
        left = [
            rest[i, i] / spread[i, i] if i not in taken and spread[i, i] > 0 else mp.mpf(0)
            for i in range(len(spread))
        ]
        pivot = int(np.argmax(left))
        if left[pivot] <= least:
            break
        taken.append(pivot)
        rest = rest - np.outer(rest[:, pivot], rest[pivot]) / rest[pivot, pivot]
    if taken:
        found[:, taken] = cross[:, taken] @ inverse(spread[np.ix_(taken, taken)])
    return found


def filtered(model: LinearModel, P0: Any, y: Array) -> list[tuple[Exact, Exact]]:
    """Means and covariances after each row, from a mean of zero."""
    A, C, Q, R = (exact(matrix) for matrix in (model.A, model.C, model.Q, model.R))
    x, P = exact(np.zeros(model.states)), exact(P0 * np.eye(model.states))
    every = []
    for k, row in enumerate(exact(y)):
        if k:
            x, P = A @ x, A @ P @ A.T + Q
        S = C @ P @ C.T + R
        K = P @ C.T @ inverse(S)
        x, P = x + K @ (row - C @ x), P - K @ S @ K.T
        every.append((x, P))
    return every


def smoothed(model: LinearModel, every: list[tuple[Exact, Exact]]) -> tuple[Exact, Exact]:
    """Means, (k, n), and covariances, (k, n, n), from those of the filter."""
    A, Q = exact(model.A), exact(model.Q)
    found = [every[-1]]
    for x, P in every[-2::-1]:
        ahead = A @ P @ A.T + Q
        G = gain(P @ A.T, ahead)
        later, spread = found[-1]
        found.append((x + G @ (later - A @ x), P + G @ (spread - ahead) @ G.T))
    return np.array([x for x, _ in found[::-1]]), np.array([P for _, P in found[::-1]])


def errors(run: Any, means: Exact, covariances: Exact, floor: Any = 0.0) -> tuple[float, float]:
    """Of means in deviations, and of variances beside themselves, or beside ``floor``."""
    variances = covariances.diagonal(axis1=1, axis2=2)
    sizes = np.maximum(variances, floor)
    sizes = np.where(sizes > 0, sizes, mp.mpf(1))
    deviations = np.vectorize(mp.sqrt, otypes=[object])(sizes)
    return (
        float(np.abs((run["state"] - means) / deviations).max()),
        float(np.abs((run["variance"] - variances) / sizes).max()),
    )


MODELS: dict[str, dict[str, Any]] = {
    "constant velocity": {"A": [[1, 1], [0, 1]], "C": [[1, 0]], "Q": 0.0},
    "velocity that drifts": {"A": [[1, 1], [0, 1]], "C": [[1, 0]], "Q": 1e-3},
    "constant acceleration": {"A": [[1, 1, 0.5], [0, 1, 1], [0, 0, 1]], "C": [[1, 0, 0]], "Q": 0.0},
    "noise of one direction": {
        "A": [[1, 0.1, 0.005], [0, 1, 0.1], [0, 0, 1]], "C": [[1, 0, 0]], "Q": [0.0, 0.0, 1e-3],
    },
    "oscillator": {"A": [[0.8, 0.6], [-0.6, 0.8]], "C": [[1, 0]], "Q": 1e-4},
    "two sensors": {"A": [[0.9, 0.2], [0, 0.8]], "C": [[1, 0], [1, 1]], "Q": [1e-2, 0.0]},
}  # fmt: skip


@pytest.mark.parametrize("start", [1e4, 1e8, 1e10, 1e12])
@pytest.mark.parametrize("name", MODELS)
def test_vague_starts_are_smoothed(name: str, start: float) -> None:
    """To what the filter's covariances hold of 16 digits; by itself to half of these losses."""
    model = LinearModel(**MODELS[name], R=1.0, check=False)
    one, y = KalmanFilter(model), np.random.default_rng(4).normal(size=(20, len(model.C)))
    run = one.run(y, start=one.init(np.zeros(model.states), start))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = rts_smoother(run)
    with mp.workdps(60):
        known = filtered(model, start, y)
        assert max(errors(found, *smoothed(model, known))) < 1e-13 + 1e-14 * start
        rounded = list(zip(exact(run["state"]), exact(run["covariance"]), strict=True))
        assert max(errors(found, *smoothed(model, rounded))) < 1e-13 + 1e-14 * start**0.5


@pytest.mark.parametrize("coupled", [False, True])
@pytest.mark.parametrize("growth", [1.1, 1.2, 1.5])
def test_states_that_grow_without_noise_are_smoothed(growth: float, coupled: bool) -> None:
    A, C = ([[growth, 1.0], [0.0, 0.5]], [[1.0, 0.0]]) if coupled else ([[growth]], [[1.0]])
    model = LinearModel(A, C=C, Q=0.0, R=1.0)
    one, y = KalmanFilter(model), np.random.default_rng(5).normal(size=(80, 1))
    run = one.run(y, start=one.init(np.zeros(len(A)), 1.0))
    found = rts_smoother(run)
    variances = []
    for digits in (700, 1400):
        with mp.workdps(digits):
            means, covariances = smoothed(model, filtered(model, 1.0, y))
            variances.append(covariances.diagonal(axis1=1, axis2=2).astype(float))
            assert errors(found, means, covariances)[1] < 1e-11
            size = float(np.abs(means).max())
            np.testing.assert_allclose(found["state"], means.astype(float), atol=1e-13 * size)
    assert np.array_equal(*variances)
    late = rts_smoother(run, lag=30)["variance"]
    assert (late > 0).all()


@settings(max_examples=4)
@given(seed=st.integers(0, 2**32 - 1))
@example(seed=0)
@example(seed=2288)
def test_drawn_models_with_singular_noise_are_smoothed(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(1, 5)), int(rng.integers(1, 3))
    A = rng.normal(size=(n, n))
    A /= max(1.0, np.abs(np.linalg.eigvals(A)).max())
    if rng.random() < 0.3:
        A[:, 0] = 0.0  # singular
    G = rng.normal(size=(n, rng.integers(0, n)))
    model = LinearModel(A, C=rng.normal(size=(m, n)), Q=G @ G.T, R=0.1, check=False)
    one, y = KalmanFilter(model), rng.normal(size=(6, m))
    run = one.run(y, start=one.init(np.zeros(n), 10.0))
    found = rts_smoother(run)
    assert (found["variance"] >= 0).all()
    with mp.workdps(60):
        means, covariances = smoothed(model, filtered(model, 10.0, y))
        floor = 1e-8 * run["variance"]
        off, share = errors(found, means, covariances, floor)
    assert off < 1e-5
    assert share < 0.03  # what decays to the rounding of P has a part in 256 of error


def pendulum(kind: Any, **options: Any) -> Any:
    return kind(
        NonlinearModel.from_ode(
            ["w", "-4*sin(a) - 0.1*w"], ["a"], state_names=["a", "w"], density=[0.0, 1e-9],
            R=1e-4, sampling_period=0.1, **options,
        )
    )  # fmt: skip


@settings(max_examples=15)
@given(
    kind=st.sampled_from([ExtendedKalmanFilter, UnscentedKalmanFilter]),
    start=st.sampled_from([1e-12, 1e-4, 1.0, 1e4]), gap=st.booleans(), seed=st.integers(0, 99),
)  # fmt: skip
def test_no_variance_of_a_nonlinear_filter_is_smoothed_below_zero(
    kind: Any, start: float, gap: bool, seed: int
) -> None:
    one, rng = pendulum(kind), np.random.default_rng(seed)
    time = np.cumsum(rng.integers(1, 4 if gap else 2, 60)) * 0.1
    y = 0.3 * np.cos(2 * time) + 0.01 * rng.normal(size=60)
    run = one.run(y, start=one.init([0.3, 0.0], [1e-4, start]), time=time)
    for lag in (None, 5):
        found = rts_smoother(run, lag=lag)
        assert (found["variance"] >= 0).all()
        assert (found["variance"] <= run["variance"] * (1 + 1e-9)).all()
        assert np.linalg.eigvalsh(found["covariance"]).min() > -1e-12 * start


def test_extended_filter_has_the_estimates_of_the_linear_one_after_a_vague_start() -> None:
    y = np.random.default_rng(2).normal(size=(20, 1))
    model = LinearModel([[1, 1], [0, 1]], C=[[1, 0]], Q=1e-3, R=1.0)
    text = NonlinearModel(["a + b", "b"], ["a"], 1e-3, 1.0, state_names=["a", "b"])
    filters = KalmanFilter(model), ExtendedKalmanFilter(text)
    found = [rts_smoother(one.run(y, start=one.init([0.0, 0.0], 1e10))) for one in filters]
    np.testing.assert_allclose(found[0]["variance"], found[1]["variance"], rtol=1e-5)
    np.testing.assert_allclose(found[0]["state"], found[1]["state"], rtol=1e-4, atol=1e-5)


# --- Runs -----------------------------------------------------------------------------------------

CROSS = "state_unknown_input_covariance"
MODEL = LinearModel(
    [[1, 0.1], [0, 0.95]], [[0], [0.1]], [[1, 0]], Q=[1e-4, 1e-2], R=1e-2, sampling_period=0.1
)
FILTERS: dict[str, Any] = {
    "linear": KalmanFilter(MODEL),
    "gated": KalmanFilter(MODEL, gate=3.0),
    "augmented": AugmentedKalmanFilter(MODEL, fault_matrix=[[0.0], [0.1]], random_walk=1e-3),
    "extended": pendulum(ExtendedKalmanFilter),
    "unscented": pendulum(UnscentedKalmanFilter),
}


def record(name: str) -> tuple[Array, Array | None, dict[str, Any]]:
    rng = np.random.default_rng(8)
    y = np.cumsum(0.1 * rng.normal(size=(3, 25, 1)), axis=1)
    y[0, 4] = y[1, 7:9] = np.nan
    u = None if name in ("extended", "unscented") else rng.normal(size=(3, 25, 1))
    return y, u, {"keep": CROSS} if name == "augmented" else {}


def same(one: Any, other: Any) -> None:
    assert list(one) == list(other)
    for name in one:
        assert np.array_equal(one[name], other[name], equal_nan=True), name


@pytest.mark.parametrize("lag", [None, 4])
@pytest.mark.parametrize("name", FILTERS)
def test_many_records_and_pickles_have_the_bits_of_one(name: str, lag: int | None) -> None:
    one, (y, u, keep) = FILTERS[name], record(name)
    many = one.run(y, u, start=one.init([0.1, 0.0], 1.0), **keep)
    found = rts_smoother(many, lag=lag)
    again = rts_smoother(pickle.loads(pickle.dumps(many)), lag=lag)
    assert found["covariance"].shape == many["covariance"].shape
    for r in range(3):
        alone = one.run(y[r], None if u is None else u[r], start=one.init([0.1, 0.0], 1.0), **keep)
        wanted = rts_smoother(alone, lag=lag)
        same(found.record(r), wanted)
        same(again.record(r), wanted)
        same(rts_smoother(many.record(r), lag=lag), wanted)


def test_many_records_with_correlated_noise_have_the_bits_of_one() -> None:
    one, (y, u, _) = FILTERS["linear"], record("linear")
    start, S = one.init([0.1, 0.0], 1.0), [[1e-4], [1e-3]]
    found = rts_smoother(one.run(y, u, start=start, S=S))
    for r in range(3):
        same(found.record(r), rts_smoother(one.run(y[r], u[r], start=start, S=S)))


def test_pieces_of_a_record_are_smoothed_by_what_led_to_their_rows() -> None:
    """The last piece as in the whole record, and the first up to its own end."""
    one, (y, u, _) = FILTERS["linear"], record("linear")
    A = np.linspace(0.9, 1.0, 25)[:, None, None] * MODEL.A
    start = one.init([0.1, 0.0], 1.0)
    first = one.run(y[0, :10], u[0, :10], start=start, A=A[:10])
    second = one.run(y[0, 10:], u[0, 10:], start=first.end, A=A[10:])
    whole, found = rts_smoother(one.run(y[0], u[0], start=start, A=A)), rts_smoother(second)
    for name in ("state", "covariance"):
        assert np.array_equal(found[name], whole[name][10:])
    assert np.array_equal(rts_smoother(first)["state"][-1], first["state"][-1])


def test_changed_arguments_change_nothing() -> None:
    one, (y, u, _) = FILTERS["linear"], record("linear")
    A, S = np.tile(MODEL.A, (25, 1, 1)), np.tile([[1e-4], [1e-3]], (25, 1, 1))
    run = one.run(y[0], u[0], start=one.init([0.1, 0.0], 1.0), A=A, S=S)
    wanted = rts_smoother(run)
    for each in (A, S, y, u):
        each[:] = 7.0
    same(rts_smoother(run), wanted)


def test_records_that_diverge_are_smoothed_up_to_there() -> None:
    one = KalmanFilter(LinearModel([[1e200]], C=[[1.0]], Q=1.0, R=1.0))
    y = np.zeros((3, 4, 1))
    y[0], y[2, 0] = np.nan, 1e300
    many = one.run(y, start=one.init([1e100], 0.0), on_divergence="return")
    found = rts_smoother(many)
    for r in range(3):
        good = many.record(r)
        assert found.record(r)["state"].shape == good["state"].shape
        if len(good):
            same(found.record(r), rts_smoother(good))


@pytest.mark.parametrize("count", [1, 2])
def test_runs_of_a_row_or_two_are_smoothed(count: int) -> None:
    one, (y, u, _) = FILTERS["linear"], record("linear")
    run = one.run(y[0, :count], u[0, :count], start=one.init([0.1, 0.0], 1.0))
    found = rts_smoother(run, lag=1)
    assert np.array_equal(found["covariance"][-1], run["covariance"][-1])
    same(found, rts_smoother(run))


def test_what_is_no_run_of_a_kalman_filter_is_refused() -> None:
    one, (y, u, _) = FILTERS["linear"], record("linear")
    start = one.init([0.1, 0.0], 1.0)
    run = one.run(y[0], u[0], start=start)
    svsf = SmoothVariableStructureFilter(MODEL, boundary_layer=10.0, convergence_rate=0.1)
    said = r"^run: .* must be one of a Kalman filter, extended or unscented or augmented, of a row"
    others: list[Any] = [
        rts_smoother(run),
        svsf.run(y[0], u[0], start=svsf.init([0.1, 0.0], 1.0)),
        svsf.run(y, u, start=svsf.init([0.1, 0.0], 1.0)),
        run["state"],
        None,
    ]
    for other in others:
        with pytest.raises(InputError, match=said):
            rts_smoother(other)
    bare = FILTERS["augmented"]
    for measured in (y[0], y):
        pieces = bare.run(measured, u[0], start=bare.init([0.1, 0.0], 1.0))
        with pytest.raises(
            InputError, match=rf'has no {CROSS}: run the filter with keep=\["{CROSS}'
        ):
            rts_smoother(pieces)
