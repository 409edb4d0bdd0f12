"""The fixed-lag smoother: each row is that of the smoother of a record that ends so much later."""

from __future__ import annotations

import numpy as np
import pytest

from reobserve import (
    AugmentedKalmanFilter,
    ExtendedKalmanFilter,
    KalmanFilter,
    LinearModel,
    NonlinearModel,
    UnscentedKalmanFilter,
    rts_smoother,
)
from reobserve.core.errors import InputError

MODEL = LinearModel([[1, 0.1], [0, 0.95]], [[0], [0.1]], [[1, 0]], Q=[1e-4, 1e-2], R=1e-2)
TEXT = NonlinearModel(
    ["x + v/10", "0.95*v + u/10 - x**3/50"], ["x"], Q=[1e-4, 1e-2], R=1e-2,
    state_names=["x", "v"], input_names=["u"],
)  # fmt: skip
RNG = np.random.default_rng(2)
U, Y = RNG.standard_normal((40, 1)), np.cumsum(0.1 * RNG.standard_normal((40, 1)), axis=0)
Y[[7, 20]] = np.nan
CROSS = "state_unknown_input_covariance"


@pytest.mark.parametrize("lag", [1, 5, 40])
@pytest.mark.parametrize("kind", ["linear", "augmented", "extended", "unscented"])
def test_rows_are_those_of_a_record_that_ends_so_much_later(kind: str, lag: int) -> None:
    observer = {
        "linear": lambda: KalmanFilter(MODEL),
        "augmented": lambda: AugmentedKalmanFilter(
            MODEL, fault_matrix=[[0.0], [0.1]], random_walk=1e-3
        ),
        "extended": lambda: ExtendedKalmanFilter(TEXT),
        "unscented": lambda: UnscentedKalmanFilter(TEXT),
    }[kind]()
    start = observer.init([0, 0], 1.0)
    keep = [CROSS] if kind == "augmented" else []
    late = rts_smoother(observer.run(Y, U, start=start, keep=keep), lag=lag)
    for k in (0, 3, 6, 21, 38, 39):
        end = min(k + lag, 39) + 1
        run = observer.run(Y[:end], U[:end], start=start, keep=keep)
        expected = rts_smoother(run)
        for name in expected:
            assert np.array_equal(late[name][k], expected[name][k]), name


@pytest.mark.parametrize("lag", [0, 41])
def test_lag_below_one_or_beyond_the_record_is_refused(lag: int) -> None:
    kalman = KalmanFilter(MODEL)
    run = kalman.run(Y, U, start=kalman.init([0, 0], 1.0))
    with pytest.raises(InputError, match=f"lag: {lag} must be"):
        rts_smoother(run, lag=lag)
