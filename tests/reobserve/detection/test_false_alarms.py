"""Thresholds from the statistics of healthy records."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import beta, kstest

from reobserve.core.errors import InputError
from reobserve.detection.false_alarms import false_alarm_threshold


@pytest.mark.parametrize(
    ("count", "false_alarm_probability", "place"),
    [(19, 0.05, 19), (39, 0.05, 38), (99, 0.05, 95), (20, 0.05, 20), (9, 0.3, 7)],
)
def test_threshold_has_the_expected_exceedance_rate(
    count: int, false_alarm_probability: float, place: int
) -> None:
    """For uniform numbers the j-th of n is j / (n + 1) on average; the rest exceed it."""
    ordered = np.arange(count, dtype=np.float64)
    shuffled = np.random.default_rng(1).permutation(ordered)
    assert false_alarm_threshold(shuffled, false_alarm_probability) == ordered[place - 1]
    drawn = np.random.default_rng(2).uniform(size=(4000, count))
    exceeded = 1.0 - np.array(
        [false_alarm_threshold(row, false_alarm_probability) for row in drawn]
    )
    wanted = 1.0 - place / (count + 1)
    assert wanted <= false_alarm_probability + 1e-12 < 1.0 - (place - 1) / (count + 1)
    assert exceeded.mean() == pytest.approx(wanted, abs=4 * exceeded.std() / np.sqrt(len(drawn)))


def test_too_few_records_are_refused() -> None:
    with pytest.raises(
        InputError,
        match=r"^false_alarm_probability: 0.05 needs 19 .*, there are 18$",
    ):
        false_alarm_threshold(np.zeros(18), 0.05)
    assert false_alarm_threshold(np.zeros(19), 0.05) == 0.0


def test_false_alarm_probability_is_beta_distributed() -> None:
    drawn = np.random.default_rng(3).uniform(size=(4000, 79))
    exceeded = [1.0 - false_alarm_threshold(row, 0.05) for row in drawn]
    assert kstest(exceeded, beta(4, 76).cdf).pvalue > 0.01
    assert beta(4, 76).ppf([0.025, 0.975]) == pytest.approx([0.014, 0.107], abs=5e-4)


def test_diverged_statistic_counts_as_the_smallest() -> None:
    assert false_alarm_threshold([-np.inf, 1.0, 2.0, 3.0], 0.5) == 2.0


@pytest.mark.parametrize(
    ("maxima", "probability", "said"),
    [
        ([[1.0]], 0.5, "maxima: .* must be numbers"),
        ([np.nan, 1.0], 0.5, "maxima: .* must be numbers"),
        ([1.0], 0.0, "false_alarm_probability: 0 must be between 0 and 1"),
        ([1.0], 1.0, "false_alarm_probability: 1 must be between 0 and 1"),
        ([], 0.5, "false_alarm_probability: 0.5 needs 1 records .* there are 0"),
    ],
)
def test_invalid_value_is_reported(maxima: object, probability: float, said: str) -> None:
    with pytest.raises(InputError, match=said):
        false_alarm_threshold(maxima, probability)  # type: ignore[arg-type]
