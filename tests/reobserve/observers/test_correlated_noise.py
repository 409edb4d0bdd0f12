"""S = E[w v'] inside the loops: of what a row was corrected by, and of nothing else."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from reobserve import (
    IMM,
    AugmentedKalmanFilter,
    ExtendedKalmanFilter,
    InputError,
    KalmanFilter,
    LinearModel,
    NonlinearModel,
    UnscentedKalmanFilter,
    rts_smoother,
)
from reobserve.systems.periods import wrapped
from tests.reobserve.observers.by_row import differing, remembered

Array = NDArray[np.float64]

CROSS = np.array([[2e-5, 0.0], [1e-5, 2e-4]])
ODD: dict[str, Any] = {"Q": [1e-6, 1e-5], "R": [[1e-2, 4e-3], [4e-3, 4e-2]]}
MODEL = LinearModel([[1, 0.1], [0, 1]], C=[[1, 0], [0.2, 1]], **ODD, sampling_period=0.1)
TEXT = NonlinearModel(
    ["x + 0.1*v", "v - 0.02*sin(x)"], ["x", "x*v/5 + v"], **ODD, state_names=["x", "v"],
    sampling_period=0.1,
)  # fmt: skip
MIX = [[0.9, 0.1], [0.2, 0.8]]
LOOSE = replace(MODEL, Q=4 * MODEL.Q)
KINDS: dict[str, Callable[..., Any]] = {
    "Kalman": lambda **rules: KalmanFilter(MODEL, **rules),
    "augmented": lambda **rules: AugmentedKalmanFilter(
        MODEL, fault_matrix=[[0], [1]], random_walk=1e-6, **rules
    ),
    "EKF": lambda **rules: ExtendedKalmanFilter(TEXT, **rules),
    "bank": lambda **rules: IMM([KalmanFilter(MODEL), KalmanFilter(LOOSE)], MIX, **rules),
}


def record(rows: int = 40, seed: int = 0) -> Array:
    rng = np.random.default_rng(seed)
    truth = np.column_stack([0.02 * np.arange(rows), np.full(rows, 0.2)])
    return np.asarray(truth @ MODEL.C.T + rng.normal(size=truth.shape) @ np.diag([0.1, 0.2]))


@pytest.mark.parametrize("kind", KINDS)
@given(
    rejected=st.sets(st.tuples(st.integers(1, 39), st.integers(0, 1)), max_size=6),
    size=st.sampled_from([-1e6, 30.0, 100.0]), by_row=st.booleans(),
)  # fmt: skip
@example(rejected={(4, 0), (4, 1)}, size=100.0, by_row=False)
@settings(max_examples=8)
def test_a_rejected_measurement_is_a_missing_one_to_the_bit(
    kind: str, rejected: set[tuple[int, int]], size: float, by_row: bool
) -> None:
    gated = KINDS[kind](gate=12.0)
    y, holes = record(), record()
    for row, output in rejected:
        y[row, output] += size
        holes[row, output] = np.nan
    S = CROSS * np.linspace(-0.8, 0.8, 40)[:, None, None] if by_row else CROSS
    start = gated.init([0, 0], 1.0)
    found, wanted = gated.run(y, start=start, S=S), gated.run(holes, start=start, S=S)
    assert found.outliers == len({row for row, _ in rejected})
    assert differing(found.estimates, wanted.estimates) == (["outlier"] if rejected else [])
    ends = [remembered(run.end) for run in (found, wanted)]
    assert set(differing(*ends)) <= {"sample"}
    assert not differing(*(_held(run.end) for run in (found, wanted)))


def _held(state: Any) -> dict[str, Array]:
    parts = state.held if type(state.held) is tuple else (state.held,)
    return {f"{name}{j}": rows for j, part in enumerate(parts) for name, rows in part.items()}


def test_identical_modes_are_one_filter() -> None:
    y = record()
    y[[7, 20], [0, 1]] += 80.0
    y[12] = y[30, 1] = np.nan
    one = KalmanFilter(MODEL, gate=12.0)
    bank = IMM([KalmanFilter(MODEL)] * 3, np.full((3, 3), 1 / 3), gate=12.0)
    run = bank.run(y, start=bank.init([0, 0], 1.0), S=CROSS)
    alone = one.run(y, start=one.init([0, 0], 1.0), S=CROSS)
    for name in ("state", "covariance", "log_likelihood"):
        np.testing.assert_allclose(run[name], alone[name], rtol=1e-12, atol=1e-14)


def test_it_makes_estimates_better_and_the_covariance_honest() -> None:
    """20 000 rows with 2 % outliers."""
    rng, rows = np.random.default_rng(1), 20_000
    A, Q, R, S = 0.95, 0.04, 0.25, 0.08
    w, v = rng.multivariate_normal([0, 0], [[Q, S], [S, R]], rows).T
    x = np.zeros(rows)
    for k in range(rows - 1):
        x[k + 1] = A * x[k] + w[k]
    y = x + v + np.where(rng.random(rows) < 0.02, rng.choice([-20.0, 20.0], rows), 0.0)
    one = KalmanFilter(LinearModel([[A]], C=[[1]], Q=Q, R=R), gate=5.0)
    start = one.init([0], 0.4)
    found, ignored = one.run(y, start=start, S=[[S]]), one.run(y, start=start)
    errors = [np.sqrt(np.mean((run["state"][:, 0] - x) ** 2)) for run in (found, ignored)]
    predicted = np.sqrt(found["variance"].mean())
    assert found.outliers == pytest.approx(400, abs=60)
    assert errors[0] == pytest.approx(predicted, rel=0.02)
    assert errors[0] < 0.99 * errors[1]


def plain_extended(y: Array, S: Array, gate: float) -> tuple[Array, Array]:
    """The extended filter: x = f(x) + J e(k|k), P = (A - J C) P (A - J C)' + Q - J S'."""
    x, P, R, states, covariances = np.zeros(2), np.eye(2), TEXT.R, [], []

    def h(x: Array) -> tuple[Array, Array]:
        value = np.array([x[0], x[0] * x[1] / 5 + x[1]])
        return value, np.array([[1.0, 0.0], [x[1] / 5, x[0] / 5 + 1]])

    for k, row in enumerate(y):
        expected, C = h(x)
        e, whole = row - expected, C @ P @ C.T + R
        seen = ~np.isnan(e) & ~(np.abs(e) > gate * np.sqrt(whole.diagonal()))
        K = P @ C[seen].T @ np.linalg.inv(whole[np.ix_(seen, seen)])
        x, M = x + K @ e[seen], np.eye(2) - K @ C[seen]
        P = M @ P @ M.T + K @ R[np.ix_(seen, seen)] @ K.T
        states.append(x)
        covariances.append(P)
        after, C = h(x)
        J = S[k][:, seen] @ np.linalg.inv(R[np.ix_(seen, seen)])
        F = np.array([[1.0, 0.1], [-0.02 * np.cos(x[0]), 1.0]]) - J @ C[seen]
        x = np.array([x[0] + 0.1 * x[1], x[1] - 0.02 * np.sin(x[0])]) + J @ (row - after)[seen]
        P = F @ P @ F.T + TEXT.Q - J @ S[k][:, seen].T
    return np.array(states), np.array(covariances)


def test_extended_filter_is_the_one_written_plainly() -> None:
    y, S = record(), CROSS * np.linspace(-0.9, 0.9, 40)[:, None, None]
    y[9] = y[15, 0] = np.nan
    y[22, 1] += 50.0
    one = ExtendedKalmanFilter(TEXT, gate=12.0)
    run = one.run(y, start=one.init([0, 0], 1.0), S=S)
    states, covariances = plain_extended(y, S, 12.0)
    np.testing.assert_allclose(run["state"], states, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(run["covariance"], covariances, rtol=1e-9, atol=1e-14)


def test_extended_filter_of_a_linear_model_is_the_linear_one() -> None:
    text = NonlinearModel(
        ["x + 0.1*v", "v"], ["x", "x/5 + v"], **ODD, state_names=["x", "v"], sampling_period=0.1
    )
    one, other, y = KalmanFilter(MODEL), ExtendedKalmanFilter(text), record()
    wanted = one.run(y, start=one.init([0, 0], 1.0), S=CROSS)
    found = other.run(y, start=other.init([0, 0], 1.0), S=CROSS)
    for name in wanted:
        np.testing.assert_allclose(found[name], wanted[name], rtol=1e-9, atol=1e-13)
    smooth, exact = rts_smoother(found), rts_smoother(wanted)
    np.testing.assert_allclose(smooth["covariance"], exact["covariance"], rtol=1e-9, atol=1e-14)


# --- Smoothers ------------------------------------------------------------------------------------


def spoilt() -> tuple[Array, Array]:
    y, holes = record(), record()
    for row, output in ((5, 0), (11, 0), (11, 1), (30, 1)):
        y[row, output] += 90.0
        holes[row, output] = np.nan
    return y, holes


@pytest.mark.parametrize("kind", ["Kalman", "EKF"])
def test_smoother_of_a_gated_run_is_that_of_a_run_with_holes(kind: str) -> None:
    y, holes = spoilt()
    gated, plain = KINDS[kind](gate=12.0), KINDS[kind]()
    run = gated.run(y, start=gated.init([0, 0], 1.0), S=CROSS)
    wanted = plain.run(holes, start=plain.init([0, 0], 1.0), S=CROSS)
    for lag in (None, 4):
        found = rts_smoother(run, lag=lag)
        exact = rts_smoother(wanted, lag=lag)
        assert not differing(found.estimates, exact.estimates)
    many = gated.run(np.array([y, y]), start=gated.init([0, 0], 1.0), S=CROSS)
    again = rts_smoother(many.record(1))
    assert not differing(again.estimates, rts_smoother(run).estimates)


@pytest.mark.parametrize("rules", [{"gate": 6.0, "outliers": "inflate"}, {"noise_memory": 2.0}])
def test_smoother_knows_the_noise_that_rows_were_corrected_by(rules: dict[str, Any]) -> None:
    """As of a filter that is given it, with S of the same correlations where R is estimated."""
    y, S, one, plain = spoilt()[0], np.tile(CROSS, (40, 1, 1)), KINDS["Kalman"], KINDS["Kalman"]()
    if "noise_memory" in rules:
        y = record()
    filter_ = one(**rules)
    run = filter_.run(y, start=filter_.init([0, 0], 1.0), S=CROSS)
    R = np.tile(MODEL.R, (40, 1, 1))
    if "noise_memory" in rules:
        before = np.vstack([MODEL.R.diagonal(), run["noise_variance"][:-1]])
        ratio = np.sqrt(before / MODEL.R.diagonal())
        R, S = R * ratio[:, :, None] * ratio[:, None, :], S * ratio[:, None, :]
    else:
        spread = run["innovation_covariance"].diagonal(axis1=1, axis2=2)
        for row, output in np.argwhere(run["outlier"]):
            own = (run["innovation"][row, output] / run["outlier"][row, output]) ** 2
            R[row, output, output] += spread[row, output] - own
    wanted = plain.run(y, start=plain.init([0, 0], 1.0), R=R, S=S)
    np.testing.assert_allclose(run["state"], wanted["state"], rtol=1e-9, atol=1e-12)
    found, exact = rts_smoother(run), rts_smoother(wanted)
    np.testing.assert_allclose(found["state"], exact["state"], rtol=1e-8, atol=1e-11)
    np.testing.assert_allclose(found["covariance"], exact["covariance"], rtol=1e-8, atol=1e-14)


# --- Angles ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("banked", [False, True])
def test_an_angle_that_goes_round_is_the_one_that_goes_on(banked: bool) -> None:
    rng, S = np.random.default_rng(2), [[0.02], [0.3]]
    straight = 100.0 + 2.5 * np.arange(300) + rng.normal(0, 2.0, 300)

    def made(**turns: Any) -> Any:
        models = [
            LinearModel([[1, 0.1], [0, 1]], C=[[1, 0]], Q=q, R=4.0, sampling_period=0.1, **turns)
            for q in ([1e-2, 1.0], [1e-2, 9.0])
        ]
        filters = [KalmanFilter(model) for model in models]
        return IMM(filters, MIX) if banked else filters[0]

    one, other = made(), made(state_periods=[360, None], output_periods=[360])
    wanted = one.run(straight, start=one.init([100, 20], 10.0), S=S)
    found = other.run(straight % 360, start=other.init([100, 20], 10.0), S=S)
    np.testing.assert_allclose(found["state"], wrapped(wanted["state"], [360, 0]), atol=1e-9)
    np.testing.assert_allclose(found["covariance"], wanted["covariance"], rtol=1e-9, atol=1e-12)
    if not banked:
        smooth = rts_smoother(found)
        exact = rts_smoother(wanted)
        np.testing.assert_allclose(smooth["state"], wrapped(exact["state"], [360, 0]), atol=1e-9)


# --- Refused --------------------------------------------------------------------------------------


def test_sigma_points_and_gaps_take_no_correlated_noise() -> None:
    y = record()
    unscented = UnscentedKalmanFilter(TEXT)
    with pytest.raises(InputError, match=r"^S: is not taken by UnscentedKalmanFilter, beside y"):
        unscented.run(y, start=unscented.init([0, 0], 1.0), S=CROSS)
    model = NonlinearModel.from_ode(
        ["v", "-sin(x)"], ["x"], density=[1e-3, 1e-2], R=1e-2, state_names=["x", "v"],
        sampling_period=0.1,
    )  # fmt: skip
    one = ExtendedKalmanFilter(model)
    start, S, late = one.init([0, 0], 1.0), [[1e-4], [1e-3]], [0.0, 0.1, 0.4]
    assert np.isfinite(one.run(y[:3, 0], start=start, S=S, time=[0.0, 0.1, 0.15])["state"]).all()
    with pytest.raises(InputError, match=r"^S: must be left out where rows are more than a samp"):
        one.run(y[:3, 0], start=start, S=S, time=late)
    with pytest.raises(InputError, match=r"^S: is more than Q and R allow: with it \[\[Q, S\]"):
        one.run(y[:3, 0], start=start, S=[[1e-1], [0.0]])
