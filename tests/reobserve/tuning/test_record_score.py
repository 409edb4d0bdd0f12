"""Scores of records with known errors, delays and quantiles."""

from __future__ import annotations

import numpy as np
import pytest

from reobserve.tuning.record_score import WORST, score
from reobserve.tuning.scoring import interval
from reobserve.tuning.task import Array, TaskRecord

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


def test_confidence_interval_of_lognormal_errors_is_that_of_the_mean_log() -> None:
    logs = np.random.default_rng(3).normal(np.log(0.2), 0.3, 64)
    mean, low, high = interval(logs)
    assert mean == pytest.approx(np.exp(logs.mean()), rel=1e-12)
    half = 1.96 * logs.std(ddof=1) / 8.0
    assert np.log(high / mean) == pytest.approx(half, rel=0.15)
    assert np.log(mean / low) == pytest.approx(half, rel=0.15)
    assert interval(logs) == interval(logs.copy())
