"""Scores of records with known errors, delays and quantiles."""

from __future__ import annotations

import numpy as np
import pytest

from reobserve.core.errors import InputError
from reobserve.observers.kalman import KalmanFilter
from reobserve.systems.linear import LinearModel
from reobserve.tuning.record_score import WORST, score
from reobserve.tuning.task import Array, Estimates, TaskRecord, estimates_with

TIME = 0.01 * np.arange(2001)


def record(truth: Array) -> TaskRecord:
    return TaskRecord(TIME, np.zeros((len(TIME), 0)), truth, truth)


def wave(delay: float = 0.0) -> Array:
    t = TIME - delay
    return np.column_stack([np.sin(2.0 * t), np.cos(3.0 * t)])


def test_zero_estimate_scores_one_and_exact_estimate_scores_zero() -> None:
    assert score(lambda _: 0.0 * wave(), record(wave()), 0.0).error == pytest.approx(1.0, abs=1e-12)
    exact = score(lambda _: wave(), record(wave()), 0.0)
    assert (exact.error, exact.lag, exact.quantile) == (0.0, 0.0, 0.0)
    short = score(lambda _: 0.3 * wave(), record(wave()), 0.0, details=False)
    assert (short.error, np.isnan(short.lag)) == (pytest.approx(0.7), True)
    assert score(lambda _: np.nan * wave(), record(wave()), 0.0).failed
    assert score(lambda _: -99.0 * wave(), record(wave()), 0.0).error == WORST


def test_score_of_a_scaled_truth_is_the_scaling_error() -> None:
    found = score(lambda _: 0.8 * wave(), record(wave()), 3.0)
    assert found.error == pytest.approx(0.2, rel=1e-12)
    late = TIME >= 3.0
    norm = np.linalg.norm(wave()[late], axis=1)
    rms = np.sqrt(np.mean(norm**2))
    assert found.quantile == pytest.approx(0.2 * np.quantile(norm, 0.95) / rms, rel=1e-12)


@pytest.mark.parametrize("delay", [0.01, 0.037, 0.12])
def test_delayed_estimate_scores_its_delay_as_lag(delay: float) -> None:
    found = score(lambda _: wave(delay), record(wave()), 1.0)
    assert found.lag == pytest.approx(delay, abs=2e-4)
    # |sin(2 (t - d)) - sin(2 t)| has the rms sqrt 2 |sin d|, |cos 3 ..| that of sqrt 2 |sin 1.5 d|
    expected = np.sqrt(2.0 * (np.sin(delay) ** 2 + np.sin(1.5 * delay) ** 2))
    assert found.error == pytest.approx(expected, rel=0.05)


def test_lag_of_a_constant_is_some_number() -> None:
    """By which delay it fits best is decided by rounding."""
    truth, random = np.ones((11, 1)), np.random.default_rng(1)
    exact = TaskRecord(0.1 * np.arange(11.0), np.zeros((11, 0)), truth, truth)
    for _ in range(300):
        off = 1.0 + 1e-15 * random.uniform(-1.0, 1.0, truth.shape)
        assert np.isfinite(score(lambda _, off=off: 1.3 * off, exact, 0.0).lag)


def test_normalised_squared_error_is_that_of_the_stated_covariances() -> None:
    """Of errors e with the covariance P: 1 for P, 4 for P / 4; correlations count."""
    random = np.random.default_rng(1)
    root = np.array([[2.0, 0.0], [1.5, 0.1]])
    truth = random.normal(size=(2001, 2))
    off = truth + random.normal(size=truth.shape) @ root.T
    P = np.broadcast_to(root @ root.T, (2001, 2, 2))

    def nees(covariances: Array, since: float = 0.0) -> float:
        return score(lambda _: Estimates(off, covariances), record(truth), since).nees

    assert nees(P) == pytest.approx(1.0, abs=0.05)
    white = np.linalg.solve(root, (off - truth).T)
    assert nees(P) == pytest.approx((white**2).mean(), rel=1e-9)
    assert nees(P / 4) == pytest.approx(4 * nees(P), rel=1e-9)
    variances = np.einsum("kii->ki", P)
    assert nees(variances) == pytest.approx(((off - truth) ** 2 / variances).mean(), rel=1e-9)
    late = P.copy()
    late[:1000] = 0.0  # a start known exactly
    assert nees(late) == pytest.approx((white[:, 1000:] ** 2).mean(), rel=1e-9)
    assert nees(late, 12.0) == pytest.approx((white[:, 1200:] ** 2).mean(), rel=1e-9)
    assert np.isnan(nees(0.0 * P))
    assert np.isnan(score(lambda _: off, record(truth), 0.0).nees)
    with pytest.raises(InputError, match=r"covariances: have the shape \(2001, 1\), must"):
        nees(variances[:, :1])


def test_kalman_filter_of_the_true_model_has_an_expected_error_of_one() -> None:
    random, found = np.random.default_rng(2), []
    model = LinearModel([[1.0]], None, [[1.0]], Q=0.01, R=0.25)
    observer = KalmanFilter(model)
    for _ in range(20):
        x = np.cumsum(0.1 * random.normal(size=(len(TIME), 1)), axis=0)
        one = TaskRecord(TIME, np.zeros((len(TIME), 0)), x + 0.5 * random.normal(size=x.shape), x)
        found.append(score(
            lambda r: estimates_with(
                "covariance", observer, "state", r.measurements, start=observer.init([0.0], 0.01)
            ), one, 0.0,
        ).nees)  # fmt: skip
    assert np.mean(found) == pytest.approx(1.0, abs=0.05)
