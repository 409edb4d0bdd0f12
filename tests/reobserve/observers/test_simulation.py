"""Simulated records: against plain loops with the same draws, exact moments, and filters."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from reobserve import (
    DivergenceError,
    ExtendedKalmanFilter,
    InputError,
    KalmanFilter,
    LinearModel,
    NonlinearModel,
    simulate,
)
from tests.reobserve.observers.by_row import MODEL, random_rows

Array = NDArray[np.float64]

ROWS = 40
SPRING = LinearModel.from_ode(
    [[0.0, 1.0], [-2.0, -0.4]], [[0.0], [1.0]], [[1.0, 0.0], [0.0, 1.0]], [[0.1], [0.0]],
    R=[0.05, 0.0], density=[0.0, 0.3], sampling_period=0.1, state_names=["position", "rate"],
    output_names=["gauge", "rate"], input_names=["force"],
)  # fmt: skip
TEXT = NonlinearModel.from_ode(
    ["rate", "-stiffness*sin(angle) - 0.4*rate + torque"], ["angle", "rate*stiffness/5"],
    R=[0.05, 0.0], density=[0.0, 0.3], sampling_period=0.1, state_names=["angle", "rate"],
    input_names=["torque"], parameters={"stiffness": 5.0}, substeps=2,
    state_periods=[2 * np.pi, None], output_periods=[2 * np.pi, None],
)  # fmt: skip
U = np.sin(np.arange(ROWS))[:, None]
TIMES = np.cumsum(np.where(np.arange(ROWS) % 3, 0.1, 0.27)) - 0.27  # up to three parts of a period


def normals(seed: int, n: int, m: int, steps: int) -> tuple[Array, Array, Array]:
    """The numbers that a record is drawn with: of the first state, v and w."""
    rng = np.random.default_rng(seed)
    return rng.standard_normal(n), rng.standard_normal((ROWS, m)), rng.standard_normal((steps, n))


def root(P: Array) -> Array:
    """A lower factor with columns of zeros where P is singular: of the part that is not."""
    some = np.flatnonzero(np.diag(P) > 0)
    out = np.zeros_like(P)
    out[np.ix_(some, some)] = np.linalg.cholesky(P[np.ix_(some, some)])
    return out


@pytest.mark.parametrize("by_row", [False, True])
def test_linear_record_is_that_of_a_plain_loop(by_row: bool) -> None:
    rows = random_rows(ROWS)
    del rows["S"]
    given = rows if by_row else {}
    matrices = {name: [rows[name][k] if by_row else getattr(MODEL, name) for k in range(ROWS)]
                for name in "ABCDQR"}  # fmt: skip
    u = np.random.default_rng(2).normal(size=(ROWS, 2))
    P = np.array([[2.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 0.0]])
    found = simulate(MODEL, ROWS, [1.0, 2.0, 3.0], P, u, seed=5, **given)
    z, v, w = normals(5, 3, 2, ROWS - 1)
    x = np.array([1.0, 2.0, 3.0]) + root(P) @ z
    for k in range(ROWS):
        A, B, C, D, Q, R = (matrices[name][k] for name in "ABCDQR")
        assert found["state"][k] == pytest.approx(x, rel=1e-10, abs=1e-10)
        y = C @ x + D @ u[k] + root(R) @ v[k]
        assert found["y"][k] == pytest.approx(y, rel=1e-10, abs=1e-10)
        if k < ROWS - 1:
            x = A @ x + B @ u[k] + root(Q) @ w[k]
    assert np.array_equal(found["u"], u)
    again = simulate(MODEL, ROWS, [1.0, 2.0, 3.0], P, u, seed=5, **given)
    assert all(np.array_equal(found[name], again[name]) for name in found)


def turned(angle: Any) -> Any:
    return (angle + np.pi) % (2 * np.pi) - np.pi


@pytest.mark.parametrize("uneven", [False, True])
def test_nonlinear_record_is_that_of_a_plain_loop(uneven: bool) -> None:
    stiffness = np.linspace(4.0, 6.0, ROWS)
    found = simulate(
        TEXT, ROWS, [3.0, 1.0], 0.0, U, seed=3, parameters={"stiffness": stiffness},
        time=TIMES if uneven else None,
    )  # fmt: skip
    gaps = np.diff(TIMES) if uneven else np.full(ROWS - 1, 0.1)
    parts = np.ceil(gaps / 0.1 - 1e-3).astype(int)
    _, v, w = normals(3, 2, 2, parts.sum())
    x, place = np.array([3.0, 1.0]), 0
    for k in range(ROWS):
        assert turned(found["state"][k, 0] - x[0]) == pytest.approx(0.0, abs=1e-9)
        assert found["state"][k, 1] == pytest.approx(x[1], rel=1e-9, abs=1e-9)
        gauge = turned(found["y"][k, 0] - x[0] - np.sqrt(0.05) * v[k, 0])
        assert gauge == pytest.approx(0.0, abs=1e-9)
        assert found["y"][k, 1] == pytest.approx(x[1] * stiffness[k] / 5, rel=1e-9, abs=1e-9)
        if k == ROWS - 1:
            break
        for _ in range(parts[k]):
            h = gaps[k] / parts[k] / 2
            for _ in range(2):
                slopes: list[Array] = []
                for ahead in (0.0, 0.5, 0.5, 1.0):
                    a, r = x + (ahead * h * slopes[-1] if slopes else 0.0)
                    slopes.append(np.array([r, -stiffness[k] * np.sin(a) - 0.4 * r + U[k, 0]]))
                x = x + h / 6 * (slopes[0] + 2 * slopes[1] + 2 * slopes[2] + slopes[3])
            x[1] += np.sqrt(0.3 * 2 * h) * w[place, 1]
            place += 1
    assert np.abs(found["state"][:, 0]).max() <= np.pi
    assert np.abs(found["y"][:, 0]).max() <= np.pi


def test_moments_of_many_records_are_those_of_the_recursion() -> None:
    """Means within 5 standard errors, and covariances: both follow the model exactly."""
    many, mean, P = 4000, np.array([1.0, -0.5]), np.array([[0.5, 0.2], [0.2, 0.3]])
    time = TIMES[:12]
    found = simulate(SPRING, 12, mean, P, U[:12], seed=7, records=many, time=time)
    rows = SPRING.by_row({}, 12, {}, np.concatenate([[0.1], np.diff(time)]))
    for k in range(12):
        if k:
            A, B, Q = rows["A"][k], rows["B"][k], rows["Q"][k]
            mean, P = A @ mean + B @ U[k - 1], A @ P @ A.T + Q
        y = SPRING.C @ mean + SPRING.D @ U[k]
        S = SPRING.C @ P @ SPRING.C.T + SPRING.R
        for drawn, centre, spread in (("state", mean, P), ("y", y, S)):
            values = found[drawn][:, k]
            deviations = np.sqrt(np.diag(spread))
            assert np.abs(values.mean(axis=0) - centre).max() < 5 * deviations.max() / many**0.5
            # var of s_ij = (P_ij^2 + P_ii P_jj) / N
            errors = np.sqrt((spread**2 + np.outer(deviations, deviations) ** 2) / many)
            assert (np.abs(np.cov(values.T) - spread) < 5 * errors).all()


FILTERS: dict[str, Callable[[], Any]] = {
    "linear": lambda: KalmanFilter(SPRING), "extended": lambda: ExtendedKalmanFilter(TEXT)
}  # fmt: skip


@pytest.mark.parametrize("kind", FILTERS)
def test_filters_are_as_consistent_as_they_say(kind: str) -> None:
    """NIS and NEES over records are within the 1e-6 tails of chi-squared, or nearly so (EKF)."""
    observer = FILTERS[kind]()
    mean, P = [0.5, 0.0], 0.01
    true = simulate(observer.model, ROWS, mean, P, U, seed=11, records=200, time=TIMES, missing=0.2)
    run = observer.run(true["y"], true["u"], start=observer.init(mean, P), time=TIMES)
    nis, count, nees = 0.0, 0, []
    for r in range(200):
        for k in range(ROWS):
            there = ~np.isnan(true["y"][r, k])
            e, S = run["innovation"][r, k][there], run["innovation_covariance"][r, k]
            nis += float(e @ np.linalg.solve(S[np.ix_(there, there)], e)) if there.any() else 0.0
            count += there.sum()
        error = run["state"][r, -1] - true["state"][r, -1]
        nees.append(error[0] ** 2 / run["variance"][r, -1, 0])
    slack = 1.0 if kind == "linear" else 1.05
    low, high = stats.chi2.interval(1 - 2e-6, count)
    assert low / slack < nis < high * slack
    low, high = stats.chi2.interval(1 - 2e-6, 200)
    assert low / slack < sum(nees) < high * slack
    assert 0.18 < np.isnan(true["y"]).mean() < 0.22
    assert true.missing.shape == (200,)


def test_what_is_missing_changes_nothing_else() -> None:
    whole = simulate(SPRING, ROWS, [0, 0], 1.0, U, seed=1)
    mask = np.arange(ROWS) % 3 == 0
    for missing in (0.3, mask, np.column_stack([mask, ~mask])):
        found = simulate(SPRING, ROWS, [0, 0], 1.0, U, seed=1, missing=missing)
        lost = np.isnan(found["y"])
        assert np.array_equal(found["state"], whole["state"])
        assert np.array_equal(found["y"][~lost], whole["y"][~lost])
        if missing is mask:
            assert np.array_equal(lost, np.column_stack([mask, mask]))
            assert found.missing == mask.sum()


def test_frames_and_dates_are_those_of_the_model() -> None:
    pd = pytest.importorskip("pandas")
    dates = pd.date_range("2026-01-01", periods=ROWS, freq="100ms")
    push = pd.DataFrame({"speed": 0.0, "force": U[:, 0]})
    found = simulate(SPRING, ROWS, [0, 0], 1.0, push, seed=1, time=dates)
    table = found.to_pandas()
    assert table.index.equals(dates)
    assert list(table) == ["state_position", "state_rate", "y_gauge", "y_rate", "u_force"]
    assert table["y_gauge"].tolist() == found["y_gauge"].tolist()
    plain = simulate(SPRING, ROWS, [0, 0], 1.0, U, seed=1)
    assert found["state"] == pytest.approx(plain["state"], abs=1e-5)  # seconds since 1970
    assert found.time == pytest.approx(plain.time + dates[0].timestamp())
    many = simulate(SPRING, ROWS, [0, 0], 1.0, U, seed=1, records=3)
    assert many.record(2)["y"].shape == (ROWS, 2)


@cache
def wild() -> NonlinearModel:
    return NonlinearModel(["a*a"], ["a"], 0.0, 1.0, state_names=["a"])


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "model": ({"model": "spring"}, "model: 'spring' must be of type NonlinearModel"),
    "no rows": ({"rows": 0}, "rows: 0 must be a whole number, from 1 to"),
    "seed": ({"seed": 1.5}, "seed: 1.5 must be a whole number"),
    "mean": ({"mean": [1.0]}, "mean: has shape (1,), must be a list of 2 numbers"),
    "covariance": ({"covariance": -1.0}, "covariance: must be positive semidefinite"),
    "no input": ({"u": None}, "u: is left out, must have shape (40, 1)"),
    "input of other length": ({"u": U[:3]}, "u: has 3 rows, must have 40 like y"),
    "share": ({"missing": 1.0}, "missing: 1.0 must be a share from 0 to below 1, or an array of"),
    "mask": ({"missing": np.zeros(3, bool)}, "missing: array([False, False, False]) must be a sh"),
    "words": ({"missing": "few"}, "missing: 'few' must be a share from 0 to below 1"),
    "records": ({"records": 0}, "records: 0 must be a whole number, from 1 to"),
    "too many": ({"records": 10**7}, "records: 10000000 must be a whole number, from 1 to 250000"),
    "times": ({"time": np.zeros(ROWS)}, "time: must increase, does not at row 1"),
    "Q": ({"Q": -1.0}, "Q: must be positive semidefinite"),
    "parameters": ({"parameters": {"k": 1.0}}, "parameters: is not taken by KalmanFilter"),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_other_arguments_are_refused(kind: str) -> None:
    changed, said = REFUSED[kind]
    arguments = {"model": SPRING, "rows": ROWS, "mean": [0.0, 0.0], "u": U, "seed": 1} | changed
    with pytest.raises(InputError) as error:
        simulate(**arguments)
    assert str(error.value).startswith(said)


def test_state_beyond_numbers_is_said_with_its_time() -> None:
    with pytest.raises(DivergenceError, match=r"simulate diverged: .* up to t = 8 s and not after"):
        simulate(wild(), 20, [10.0], seed=1)
    model = LinearModel([[1e200]], C=[[1]], Q=0.0, R=0.0)
    with pytest.raises(DivergenceError, match=r"up to t = 1 s and not after"):
        simulate(model, 5, [1.0], seed=1)
