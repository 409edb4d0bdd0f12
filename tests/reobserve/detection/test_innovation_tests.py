"""Tests of innovations: recursions by hand, published run lengths, direct likelihoods."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import optimize, stats

from reobserve.core.errors import InputError
from reobserve.detection.innovation_tests import cusum, inflated, inflation_glr
from reobserve.observers.kalman import KalmanFilter
from reobserve.systems.linear import LinearModel

Array = NDArray[np.float64]

# --- The cumulative sum -------------------------------------------------------------------------


def test_cumulative_sum_agrees_with_hand_calculation() -> None:
    increments = [1.0, -3.0, 2.0, 0.5, -1.0, np.nan, 4.0, -0.25]
    assert cusum(increments).tolist() == [1.0, 0.0, 2.0, 2.5, 1.5, 1.5, 5.5, 5.25]
    assert cusum([-1.0, 2.0], 0.5).tolist() == [0.0, 2.0]
    assert cusum([]).tolist() == []


def test_consecutive_records_equal_one() -> None:
    increments = np.random.default_rng(1).normal(-0.1, 1.0, 500)
    whole, first = cusum(increments), cusum(increments[:180])
    np.testing.assert_array_equal(cusum(increments[180:], first[-1]), whole[180:])


def test_cumulative_sum_is_the_maximum_of_all_sums_ending_here() -> None:
    """Page's other form, max over j of s(j+1) + ... + s(k), or zero."""
    increments = np.random.default_rng(2).normal(0.0, 1.0, 60)
    largest = [
        max(0.0, *(increments[j : k + 1].sum() for j in range(k + 1)))
        for k in range(len(increments))
    ]
    np.testing.assert_allclose(cusum(increments), largest, rtol=1e-12, atol=1e-12)


def run_length(threshold: float, mean: float, states: int = 201) -> float:
    """Of the sum of normal numbers minus 1/2: a Markov chain of states (Brook & Evans 1972)."""
    width = 2.0 * threshold / (2 * states - 1)
    centre = width * np.arange(states)
    edges = centre[None, :] + width / 2 - centre[:, None] + 0.5 - mean
    below = stats.norm.cdf(edges)
    moves = np.diff(below, axis=1, prepend=0.0)  # a sum below zero is reset to zero
    return float(np.linalg.solve(np.eye(states) - moves, np.ones(states))[0])


PUBLISHED = [  # Montgomery, Introduction to Statistical Quality Control, one-sided, k = 1/2
    (4.0, 0.0, 336.0), (4.0, 1.0, 8.38), (5.0, 0.0, 930.0), (5.0, 1.0, 10.4), (5.0, 2.0, 4.01),
]  # fmt: skip


@pytest.mark.parametrize(("threshold", "mean", "published"), PUBLISHED)
def test_markov_chain_gives_the_published_run_lengths(
    threshold: float, mean: float, published: float
) -> None:
    assert run_length(threshold, mean) == pytest.approx(published, rel=6e-3)


@pytest.mark.parametrize(("threshold", "mean"), [(3.0, 0.0), (4.0, 0.0), (4.0, 1.0), (5.0, 2.0)])
def test_run_lengths_agree_with_the_markov_chain(threshold: float, mean: float) -> None:
    wanted, runs = run_length(threshold, mean), 3000
    stream = np.random.default_rng(3)
    lengths = []
    for _ in range(runs):
        alarm = cusum(stream.normal(mean - 0.5, 1.0, round(12 * wanted))) > threshold
        assert alarm.any()
        lengths.append(int(np.argmax(alarm)) + 1)
    error = np.std(lengths) / np.sqrt(runs)
    assert np.mean(lengths) == pytest.approx(wanted, abs=3 * error)


# --- The likelihood ratio -----------------------------------------------------------------------

M = 3


@cache
def innovations() -> tuple[Array, Array]:
    """Innovations, larger from row 25 on, and their covariance before that."""
    stream = np.random.default_rng(4)
    factor = np.tril(stream.normal(size=(M, M))) + 2.0 * np.eye(M)
    white = stream.normal(size=(40, M))
    white[25:] *= 1.7
    return white @ factor.T, factor @ factor.T


def distances() -> Array:
    found, covariance = innovations()
    return np.asarray(np.sum(found @ np.linalg.inv(covariance) * found, axis=1))


def test_likelihood_ratio_agrees_with_normal_densities() -> None:
    """The densities themselves for each row, length and factor, and the best factor by search."""
    found, covariance = innovations()

    def likelihood(rows: Array, factor: float) -> float:
        return float(stats.multivariate_normal(np.zeros(M), factor * covariance).logpdf(rows).sum())

    lengths = [1, 2, 5, 9]
    statistic = inflation_glr(distances(), M, lengths)
    for k in range(0, len(found), 6):
        best = 0.0
        for n in (n for n in lengths if n <= k + 1):
            rows = found[k + 1 - n : k + 1]
            search = optimize.minimize_scalar(
                lambda log_factor, rows=rows: -likelihood(rows, np.exp(log_factor)),
                bounds=(0.0, 5.0), method="bounded", options={"xatol": 1e-9},
            )  # fmt: skip
            best = max(best, -search.fun - likelihood(rows, 1.0))
        assert statistic[k] == pytest.approx(best, abs=1e-6), k
    assert (
        statistic[-1] > 5 > statistic[24]
    )  # preconditions: the change is detected, and not earlier


@pytest.mark.parametrize("factor", [1.0, 1.5, 4.0, 0.2])
def test_likelihood_ratio_of_constant_innovations_agrees_with_closed_form(factor: float) -> None:
    """n m (c - 1 - ln c) / 2 over n samples, zero where they are smaller than expected."""
    n = np.arange(1, 33)
    wanted = 0.5 * n * M * max(0.0, factor - 1 - np.log(factor)) * (factor > 1)
    found = inflation_glr(np.full(32, factor * M), M, n)
    np.testing.assert_allclose(found, wanted, rtol=1e-12, atol=1e-12)


def test_false_alarms_of_one_window_length_are_chi_squared() -> None:
    n, threshold = 8, 1.5
    drawn = stats.chi2.rvs(M, size=(20_000, n), random_state=np.random.default_rng(5))
    last = np.array([inflation_glr(rows, M, [n])[-1] for rows in drawn])
    ratio = optimize.brentq(lambda c: 0.5 * n * M * (c - 1 - np.log(c)) - threshold, 1.0, 9.0)
    wanted = stats.chi2.sf(ratio * n * M, n * M)
    assert np.mean(last > threshold) == pytest.approx(wanted, abs=3 * np.sqrt(wanted / len(last)))


def test_more_window_lengths_never_reduce_the_statistic() -> None:
    record = stats.chi2.rvs(M, size=300, random_state=np.random.default_rng(6))
    record[200:] *= 1.6
    few, some, all_lengths = (
        inflation_glr(record, M, lengths)
        for lengths in ([16], [1, 2, 4, 8, 16, 32, 64, 128], range(1, 301))
    )
    assert (few <= some).all()
    assert (some <= all_lengths).all()
    assert (few[:15] == 0).all()  # no window of sixteen fits yet
    assert some[-1] > 0.8 * all_lengths[-1]


def test_missing_samples_are_skipped() -> None:
    record = np.random.default_rng(7).chisquare(M, 60) * 1.3
    gaps = np.sort(np.random.default_rng(8).choice(60, 15, replace=False))
    holed = record.copy()
    holed[gaps] = np.nan
    kept = ~np.isnan(holed)
    for found, alone in (
        (inflation_glr(holed, M, [1, 2, 4, 8]), inflation_glr(holed[kept], M, [1, 2, 4, 8])),
        (cusum(holed - 4), cusum(holed[kept] - 4)),
    ):
        np.testing.assert_array_equal(found[kept], alone)
        held = np.concatenate([[0.0], found])[np.flatnonzero(~kept)]
        np.testing.assert_array_equal(found[~kept], held)


# --- With filters -------------------------------------------------------------------------------


def test_distances_of_matched_and_mismatched_filters_agree_with_likelihoods() -> None:
    """Twice the log-likelihood deficit of a record relative to that of one at rest."""
    model = LinearModel([[0.9]], [[1.0]], [[1.0]], Q=0.1, R=1.0, sampling_period=1.0)
    one = KalmanFilter(model)
    start = one.init([0.0], 0.5, u=[0.0])
    stream, x = np.random.default_rng(9), np.sqrt(0.5) * np.random.default_rng(10).normal()
    y = []
    for _ in range(4000):
        x = 0.9 * x + np.sqrt(0.1) * stream.normal()
        y.append(x + stream.normal())
    none = np.zeros(4000)
    rest = one.run(none, none, start=start)
    assert not rest["innovation"].any()
    distance = 2 * (rest["log_likelihood"] - one.run(y, none, start=start)["log_likelihood"])
    assert stats.kstest(distance, stats.chi2(1).cdf).pvalue > 0.01
    assert inflation_glr(distance, 1, [16, 64]).max() < 12
    twice = one.run(2 * np.array(y), none, start=start)
    louder = 2 * (rest["log_likelihood"] - twice["log_likelihood"])
    np.testing.assert_allclose(louder, 4 * distance, rtol=1e-9, atol=1e-9)
    assert inflation_glr(louder, 1, [16, 64]).max() > 40


@pytest.mark.parametrize(
    ("call", "parameter", "said"),
    [
        (lambda: cusum([[1.0]]), "increments", r"have shape \(1, 1\), must be \(k,\)"),
        (lambda: cusum([1.0, np.inf]), "increments", "must be within 1e\\+300, are not at row 1"),
        (lambda: cusum([1.0], -1.0), "start", "-1 must be 0 or more"),
        (lambda: cusum(["a"]), "increments", "is not a number or an array of numbers"),
        (lambda: inflation_glr([1.0, -2.0], 1, [1]), "distances", "-2 at row 1 must be 0 or more"),
        (lambda: inflation_glr([1.0], 0, [1]), "outputs", "0 must be a whole number, from 1 to"),
        (lambda: inflation_glr([1.0], 1, []), "lengths", "must be whole numbers from 1 to"),
        (lambda: inflation_glr([1.0], 1, [0, 1]), "lengths", "must be whole numbers from 1 to"),
        (lambda: inflation_glr([1.0], 1, [1.5]), "lengths", "must be whole numbers from 1 to"),
        (lambda: inflation_glr([1.0], 1, [np.nan]), "lengths", "must be whole numbers from 1 to"),
    ],
)
def test_invalid_record_is_reported(call: Any, parameter: str, said: str) -> None:
    with pytest.raises(InputError, match=said) as caught:
        call()
    assert caught.value.parameter == parameter


def test_inflated_is_the_chi_squared_quantile() -> None:
    """30 for one output has probability 4.3e-8, and a sum of 30.8 of two 2.1e-7."""
    distances = [1.0, np.nan, 0.8, 30.0, np.nan, 0.5]
    bound = 4.320463057827488e-08 * 8  # of four samples and two lengths
    assert np.flatnonzero(inflated(distances, 1, [1, 2], 1.001 * bound)).tolist() == [3]
    assert not inflated(distances, 1, [1, 2], 0.999 * bound).any()
    assert inflated(distances, 1, [1, 2], 0.1)[[3, 5]].all()


def test_false_alarms_of_inflated_are_as_stated() -> None:
    rng = np.random.default_rng(4)
    records = rng.chisquare(2, size=(2000, 50))
    alarms = sum(inflated(one, 2, [1, 2, 4], 0.05).any() for one in records)
    assert 0 < alarms <= 100  # Bonferroni: at most 5 %
    assert inflated(3.0 * records[0], 2, [1, 2, 4, 8, 16], 0.05).any()


@pytest.mark.parametrize("probability", [0.0, 1.0, -0.1, np.nan])
def test_probability_of_inflated_is_between_zero_and_one(probability: float) -> None:
    with pytest.raises(InputError, match=r"^probability: "):
        inflated([1.0], 1, [1], probability)
