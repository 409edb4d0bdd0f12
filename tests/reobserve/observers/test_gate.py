"""The gate of filters: outliers are skipped as if they were missing, or their noise is inflated."""

from __future__ import annotations

import numpy as np
import pytest

from reobserve import (
    IMM,
    ExtendedKalmanFilter,
    KalmanFilter,
    LinearModel,
    NonlinearModel,
    UnscentedKalmanFilter,
)
from reobserve.core.errors import InputError

MODEL = LinearModel(
    [[1, 0.1], [0, 1]], C=[[1, 0], [0, 1]], Q=[1e-6, 1e-5], R=[1e-2, 4e-2], sampling_period=0.1
)
TEXT = NonlinearModel(
    ["x + 0.1*v", "v"], ["x", "v"], MODEL.Q, MODEL.R, state_names=["x", "v"], sampling_period=0.1
)
TRUTH = np.column_stack([0.02 * np.arange(200), np.full(200, 0.2)])
Y = TRUTH + [0.1, 0.2] * np.random.default_rng(0).standard_normal((200, 2))
SPOILT = Y.copy()
SPOILT[100, 0] += 50.0
SPOILT[[120, 121], 1] -= 9.0
HOLES = Y.copy()
HOLES[100, 0] = HOLES[120, 1] = HOLES[121, 1] = np.nan
KINDS = [(KalmanFilter, MODEL), (ExtendedKalmanFilter, TEXT), (UnscentedKalmanFilter, TEXT)]


@pytest.mark.parametrize(("kind", "model"), KINDS)
def test_skipped_outlier_is_a_missing_measurement(kind: type, model: object) -> None:
    plain, gated = kind(model), kind(model, gate=6)
    expected = plain.run(HOLES, start=plain.init([0, 0], 1))
    run = gated.run(SPOILT, start=gated.init([0, 0], 1))
    for name in expected:
        assert np.array_equal(run[name], expected[name], equal_nan=True), name
    assert run.outliers == 3
    assert run.missing == 0
    assert np.argwhere(run["outlier"]).tolist() == [[100, 0], [120, 1], [121, 1]]
    # In deviations of what the filter without that row predicted.
    before = plain.run(SPOILT[:101], start=plain.init([0, 0], 1))
    S = before["innovation_covariance"][100, 0, 0]
    assert run["outlier"][100, 0] == pytest.approx(before["innovation"][100, 0] / np.sqrt(S))
    assert 100 in run.diagnostics().far


@pytest.mark.parametrize(("kind", "model"), KINDS)
def test_inflated_outlier_is_at_the_gate(kind: type, model: object) -> None:
    gated = kind(model, gate=6, outliers="inflate")
    run = gated.run(SPOILT, start=gated.init([0, 0], 1))
    deviations = run["innovation"] / np.sqrt(
        np.diagonal(run["innovation_covariance"], axis1=1, axis2=2)
    )
    assert run.outliers == 3
    for row, output in np.argwhere(run["outlier"]):
        assert abs(deviations[row, output]) == pytest.approx(6, rel=1e-12)
    # The same filter with an R by row that is so much larger.
    S = np.diagonal(run["innovation_covariance"], axis1=1, axis2=2)
    R = np.repeat(MODEL.R[None], 200, axis=0)
    plain = kind(model)
    for row, output in np.argwhere(run["outlier"]):
        until = plain.run(SPOILT[: row + 1], start=plain.init([0, 0], 1), R=R[: row + 1])
        R[row, output, output] += (
            S[row, output] - until["innovation_covariance"][row, output, output]
        )
    expected = plain.run(SPOILT, start=plain.init([0, 0], 1), R=R)
    np.testing.assert_allclose(run["state"], expected["state"], rtol=0, atol=1e-12)
    np.testing.assert_allclose(run["covariance"], expected["covariance"], rtol=1e-9, atol=1e-16)
    np.testing.assert_allclose(run["log_likelihood"], expected["log_likelihood"], atol=1e-9)


def test_bank_leaves_out_what_all_filters_would_leave_out() -> None:
    wide = LinearModel(MODEL.A, C=MODEL.C, Q=MODEL.Q, R=100.0, sampling_period=0.1)
    transition = [[0.95, 0.05], [0.05, 0.95]]
    for filters in (
        [KalmanFilter(MODEL), KalmanFilter(MODEL)],
        [KalmanFilter(MODEL), ExtendedKalmanFilter(TEXT)],  # called one by one
    ):
        plain, gated = IMM(filters, transition), IMM(filters, transition, gate=6)
        expected = plain.run(HOLES, start=plain.init([0, 0], 1))
        run = gated.run(SPOILT, start=gated.init([0, 0], 1))
        for name in expected:
            assert np.array_equal(run[name], expected[name], equal_nan=True), name
        assert run.outliers == 3
    # A mode that expects such measurements keeps them.
    bank = IMM([KalmanFilter(MODEL), KalmanFilter(wide)], transition, gate=6)
    run = bank.run(SPOILT, start=bank.init([0, 0], 1))
    assert run.outliers == 0
    assert run["probability"][100, 1] > 0.999


def test_steps_and_many_records_give_what_a_run_gives() -> None:
    gated = KalmanFilter(MODEL, gate=6)
    run = gated.run(SPOILT, start=gated.init([0, 0], 1))
    state = gated.init([0, 0], 1)
    for k, y in enumerate(SPOILT):
        state, estimate = gated.step(state, y)
        for name in run:
            assert np.array_equal(estimate[name], run[name][k], equal_nan=True), name
    many = gated.run(np.array([SPOILT, Y]), start=gated.init([0, 0], 1))
    assert many.outliers.tolist() == [3, 0]
    assert np.array_equal(many["state"][0], run["state"])


def test_gates_that_are_none_are_refused() -> None:
    with pytest.raises(InputError, match="gate"):
        KalmanFilter(MODEL, gate=0)
    with pytest.raises(InputError, match="outliers: 'drop' must be one of skip, inflate"):
        KalmanFilter(MODEL, gate=5, outliers="drop")  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"filters\[0\]: has gate of its own"):
        IMM([KalmanFilter(MODEL, gate=5)], [[1.0]])
