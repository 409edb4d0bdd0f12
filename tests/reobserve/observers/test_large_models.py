"""Large models: loops in another order give the bits of plain ones."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from reobserve import (
    IMM,
    ExtendedKalmanFilter,
    KalmanFilter,
    LinearModel,
    NonlinearModel,
    SmoothVariableStructureFilter,
    rts_smoother,
)
from reobserve.core.large_matrices import COLUMNS, mirror, multiply_rows, write_product
from reobserve.observers import kalman

Array = NDArray[np.float64]


def model(n: int, m: int, seed: int) -> LinearModel:
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, n)) / (1.2 * np.sqrt(n))
    Q = rng.normal(size=(n, n)) / n
    return LinearModel(
        A, rng.normal(size=(n, 1)), rng.normal(size=(m, n)), Q=Q @ Q.T, R=np.diag([9.0] * m)
    )


def same(one: Any, other: Any) -> bool:
    return all(one[name].tobytes() == other[name].tobytes() for name in one.estimates)


def both(run: Any, monkeypatch: pytest.MonkeyPatch) -> tuple[Any, Any]:
    """A run in blocks, and one by plain loops."""
    blocks = run()
    with monkeypatch.context() as patched:
        patched.setattr(kalman, "LARGE", 10**9)
        return blocks, run()


@given(n=st.integers(8, 40), m=st.integers(1, 5), seed=st.integers(0, 10**6))
@example(n=8, m=1, seed=0)
@example(n=23, m=2, seed=1)
def test_products_have_the_bits_of_plain_sums(n: int, m: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    L, R, start = rng.normal(size=(3, n, n))
    C, rows, panel = rng.normal(size=(m, n)), np.empty((n, m)), np.empty((n, COLUMNS))
    for begun, lower, transposed in itertools.product((None, start), (False, True), (False, True)):
        out = np.empty((n, n))
        write_product(L, R, transposed, begun, out, lower, panel)
        wanted = np.zeros((n, n)) if begun is None else begun.copy()
        for i in range(n):  # term by term, as a sum in a loop
            wanted += L[:, i, None] * (R.T if transposed else R)[None, i]
        chosen = np.tril(np.ones((n, n), bool)) if lower else np.ones((n, n), bool)
        assert np.array_equal(out[chosen], wanted[chosen])
    multiply_rows(L, C, rows)
    plain = np.zeros((n, m))
    for b in range(n):
        plain += L[:, b, None] * C[None, :, b]
    assert np.array_equal(rows, plain)
    mirrored = L.copy()
    mirror(mirrored)
    assert np.array_equal(mirrored, np.tril(L) + np.tril(L, -1).T)


OPTIONS: tuple[dict[str, Any], ...] = (
    {}, {"gate": 1.0}, {"gate": 1.0, "outliers": "inflate"}, {"noise_memory": 50.0},
)  # fmt: skip


@pytest.mark.parametrize("options", OPTIONS, ids=str)
@pytest.mark.parametrize(("n", "m"), [(12, 1), (13, 2), (16, 3), (23, 1)])
def test_filter_and_smoother_have_the_bits_of_plain_loops(
    n: int, m: int, options: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(n)
    y, u = rng.normal(size=(20, m)), rng.normal(size=(20, 1))
    y[3], y[5, 0] = np.nan, np.nan

    def run() -> Any:
        one = KalmanFilter(model(n, m, n), **options)
        found = one.run(
            y, u, start=one.init(np.zeros(n), 1.0),
            keep=["predicted_state", "predicted_covariance", "gain"],
        )  # fmt: skip
        return found, rts_smoother(found)

    for one, other in zip(*both(run, monkeypatch), strict=True):
        assert same(one, other)


def test_step_has_the_bits_of_run() -> None:
    one, rng = KalmanFilter(model(14, 2, 5)), np.random.default_rng(2)
    y, u = rng.normal(size=(20, 2)), rng.normal(size=(20, 1))
    state = one.init(np.zeros(14), 1.0)
    run = one.run(y, u, start=state)
    for k in range(20):
        state, estimate = one.step(state, y[k], u[k])
        assert estimate["covariance"].tobytes() == run["covariance"][k].tobytes()


@pytest.mark.nightly
@pytest.mark.parametrize("kind", ["EKF", "SVSF", "IMM"])
def test_other_filters_have_the_bits_of_plain_loops(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    n, rng = 13, np.random.default_rng(4)
    y, u = rng.normal(size=(20, 2)), rng.normal(size=(20, 1))

    def run() -> Any:
        linear = model(n, 2, 3)
        one: Any
        if kind == "EKF":
            names = [f"x{i}" for i in range(n)]
            texts = [f"0.5*x{i} + 0.3*sin(x{(i + 1) % n}) + v" for i in range(n)]
            one = ExtendedKalmanFilter(NonlinearModel(
                texts, names[:2], 1e-2, 1e-1, state_names=names, input_names=["v"]
            ))  # fmt: skip
        elif kind == "SVSF":
            one = SmoothVariableStructureFilter(linear, boundary_layer=1.0, convergence_rate=0.1)
        else:
            pair = [KalmanFilter(linear), KalmanFilter(model(n, 2, 8))]
            one = IMM(pair, [[0.9, 0.1], [0.2, 0.8]])
        return one.run(y, u, start=one.init(np.zeros(n), 1.0))

    assert same(*both(run, monkeypatch))
