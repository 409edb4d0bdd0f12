"""Detectors: published run lengths, shares of false alarms on white noise, direct likelihoods."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import integrate, optimize, stats

from reobserve import KalmanFilter, LinearModel
from reobserve.core.errors import InputError
from reobserve.detection import (
    chi_square_window,
    consistency,
    cusum_of_mean,
    glr_of_mean,
    glr_of_size,
    nees,
    normalised,
)

Array = NDArray[np.float64]

SAMPLES = 400_000


def white(columns: int = 1, seed: int = 1) -> Array:
    return np.random.default_rng(seed).standard_normal((SAMPLES, columns))


def test_window_alarms_on_the_stated_share_of_white_noise() -> None:
    for outputs, length, rate in ((1, 1, 1e-2), (2, 10, 1e-2), (3, 30, 5e-3)):
        found = chi_square_window((white(outputs) ** 2).sum(axis=1), outputs, length, rate)
        # Of windows that overlap, one in `length` is new.
        off = 4 * np.sqrt(rate * length / SAMPLES)
        assert found.alarm.mean() == pytest.approx(rate, abs=off)
        assert np.isnan(found.statistic[: length - 1]).all()
        assert found.threshold == pytest.approx(stats.chi2.isf(rate, outputs * length), rel=1e-12)


def test_window_forgets_a_huge_distance_exactly() -> None:
    distances = np.r_[np.ones(5), 1e20, np.ones(10)]
    found = chi_square_window(distances, 1, 3, 1e-3)
    assert found.statistic[8:].tolist() == [3.0] * 8
    assert (found.first, found.alarm.sum()) == (5, 3)


def test_missing_samples_are_passed_over() -> None:
    distances = np.array([1.0, np.nan, 2.0, 30.0, np.nan, 1.0])
    window = chi_square_window(distances, 1, 2, 1e-3)
    np.testing.assert_array_equal(window.statistic, [np.nan, np.nan, 3.0, 32.0, 32.0, 31.0])
    mean = glr_of_mean(distances, [1, 2], 1e-3).statistic
    np.testing.assert_allclose(mean, [0.5, 0.5, 2.25, 450.0, 450.0, 31**2 / 4])


# Mean run lengths of both sums, in control: Hawkins & Olwell (1998), Table 3.1, among others.
@pytest.mark.parametrize(
    ("shift", "threshold", "length"),
    [(1.0, 4.0, 167.68), (1.0, 5.0, 465.44), (0.5, 8.0, 368.39), (2.0, 2.52, 370.0)],
)
def test_cumulative_sums_have_the_published_run_lengths(
    shift: float, threshold: float, length: float
) -> None:
    found = cusum_of_mean([0.0], shift, 1 / length)
    assert found.threshold == pytest.approx(threshold, rel=2e-3)


def test_run_length_of_cumulative_sums_agrees_with_a_simulation() -> None:
    rate, starts = 1 / 200, 3000
    threshold = cusum_of_mean([0.0], 0.8, rate).threshold
    noise, high, low = np.random.default_rng(2), np.zeros(starts), np.zeros(starts)
    length, running = np.zeros(starts), np.ones(starts, dtype=bool)
    while running.any():
        x = noise.standard_normal(starts)
        high, low = np.maximum(0, high + x - 0.4), np.maximum(0, low - x - 0.4)
        length += running
        running &= np.maximum(high, low) <= threshold
    assert length.mean() == pytest.approx(1 / rate, abs=4 * length.std() / np.sqrt(starts))


def test_cumulative_sums_are_those_by_hand_in_both_directions() -> None:
    found = cusum_of_mean([1.0, 2.0, np.nan, -4.0, -1.0], 1.0, 1e-2)
    assert found.statistic.tolist() == [0.5, 2.0, 2.0, 3.5, 4.0]


@pytest.mark.parametrize("outputs", [1, 3])
def test_likelihood_ratio_of_the_mean_is_the_maximum(outputs: int) -> None:
    """Over means of the last n samples, by an optimiser."""
    values = white(outputs)[:12] + np.linspace(0, 2, 12)[:, None]
    lengths = [1, 2, 5]

    def ratio(last: Array) -> float:
        def less(mean: Array) -> float:
            return float((((last - mean) ** 2).sum() - (last**2).sum()) / 2)

        return -float(optimize.minimize(less, np.zeros(outputs)).fun)

    wanted = [
        max(ratio(values[k + 1 - n : k + 1]) for n in lengths if n <= k + 1) for k in range(12)
    ]
    found = glr_of_mean(values, lengths, 1e-3)
    np.testing.assert_allclose(found.statistic, wanted, rtol=1e-6)


@pytest.mark.parametrize("lengths", [[4], [1, 2, 4, 8, 16]], ids=["one", "five"])
def test_likelihood_ratios_alarm_on_the_stated_share_at_most(lengths: list[int]) -> None:
    rate, values = 1e-2, white(2)
    for found in (
        glr_of_mean(values, lengths, rate),
        glr_of_size((values**2).sum(axis=1), 2, lengths, rate),
    ):
        off = 4 * np.sqrt(rate * max(lengths) / SAMPLES)
        assert rate / len(lengths) - off <= found.alarm.mean() <= rate + off


def test_threshold_of_the_size_agrees_with_an_integral() -> None:
    """P(statistic > h) of one length by integration of the density."""
    outputs, length, rate = 2, 5, 1e-3
    h, a = glr_of_size([1.0], outputs, [length], rate).threshold, outputs * length
    start = optimize.brentq(lambda q: (q - a - a * np.log(q / a)) / 2 - h, a, 100 * a)
    share, _ = integrate.quad(lambda q: stats.chi2.pdf(q, a), start, np.inf, epsabs=1e-14)
    assert share == pytest.approx(rate, rel=1e-7)


TWO = LinearModel(
    [[0.9, 0.1], [0.0, 0.8]], C=np.eye(2), Q=[[0.2, 0.1], [0.1, 0.3]], R=[[1, 0.3], [0.3, 2]]
)


def simulated(records: int, samples: int) -> tuple[Array, Array]:
    random = np.random.default_rng(3)
    x = np.zeros((records, samples, 2))
    for k in range(samples - 1):
        x[:, k + 1] = x[:, k] @ TWO.A.T + random.multivariate_normal([0, 0], TWO.Q, records)
    return x, x + random.multivariate_normal([0, 0], TWO.R, (records, samples))


def test_filter_of_the_right_model_is_consistent_and_another_is_not() -> None:
    x, y = simulated(50, 200)
    kalman = KalmanFilter(TWO)
    run = kalman.run(y, start=kalman.init(np.zeros(2), 1e-6 * np.eye(2)))
    distances, whitened = normalised(run)
    assert distances.shape == (50, 200)
    np.testing.assert_allclose((whitened**2).sum(axis=-1), distances)
    e, S = run["innovation"][7, 9], run["innovation_covariance"][7, 9]
    assert distances[7, 9] == pytest.approx(e @ np.linalg.inv(S) @ e, rel=1e-12)
    np.testing.assert_allclose(np.cov(whitened.reshape(-1, 2).T), np.eye(2), atol=0.05)
    errors = nees(run, x)[:, 1:]  # at the first row all begin alike
    for found in (consistency(distances, 2), consistency(errors, 2)):
        assert 0.9 < found.inside < 0.99
        assert found.mean.mean() == pytest.approx(2, abs=0.1)
    doubted = KalmanFilter(LinearModel(TWO.A, C=TWO.C, Q=TWO.Q, R=3 * TWO.R))
    again = doubted.run(y, start=doubted.init(np.zeros(2), 1e-6 * np.eye(2)))
    assert consistency(normalised(again)[0], 2).inside < 0.05


def test_bounds_follow_the_number_of_records_that_are_there() -> None:
    found = consistency([[1.0, np.nan, np.nan], [3.0, 2.0, np.nan]], 3, probability=0.9)
    np.testing.assert_array_equal(found.mean, [2.0, 2.0, np.nan])
    np.testing.assert_allclose(
        found.lower[:2], [stats.chi2.ppf(0.05, 6) / 2, stats.chi2.ppf(0.05, 3)]
    )
    np.testing.assert_allclose(
        found.upper[:2], [stats.chi2.isf(0.05, 6) / 2, stats.chi2.isf(0.05, 3)]
    )
    assert np.isnan(found.lower[2])
    assert found.inside == 1.0


def test_partly_missing_measurement_has_the_distance_of_the_same_probability() -> None:
    y = np.ones((4, 2))
    y[1, 0] = y[2] = np.nan
    kalman = KalmanFilter(TWO)
    run = kalman.run(y, start=kalman.init(np.zeros(2), np.eye(2)))
    distances, whitened = normalised(run)
    assert np.isnan(distances).tolist() == [False, False, True, False]
    assert np.isnan(whitened).tolist() == [[False] * 2, [True, False], [True] * 2, [False] * 2]
    alone = run["innovation"][1, 1] ** 2 / run["innovation_covariance"][1, 1, 1]
    assert whitened[1, 1] ** 2 == pytest.approx(alone)
    assert stats.chi2.sf(distances[1], 2) == pytest.approx(stats.chi2.sf(alone, 1))
    y[1, 1] = 1e6  # whose probability is no float
    distances, whitened = normalised(kalman.run(y, start=run.end.__class__(run.end.posterior)))
    assert distances[1] == pytest.approx(whitened[1, 1] ** 2, rel=1e-3)


@pytest.mark.parametrize(
    "detect",
    [
        lambda rate: chi_square_window([1.0], 1, 1, rate),
        lambda rate: cusum_of_mean([0.0], 0.8, rate),
        lambda rate: glr_of_mean([0.0], [1], rate),
        lambda rate: glr_of_size([1.0], 1, [1], rate),
    ],
    ids=["chi_square_window", "cusum_of_mean", "glr_of_mean", "glr_of_size"],
)
def test_least_and_greatest_rates_are_accepted_and_no_others(detect: Any) -> None:
    for rate in (1e-9, 0.1):
        assert np.isfinite(detect(rate).threshold)
    for rate in (np.nextafter(1e-9, 0.0), np.nextafter(0.1, 1.0)):
        with pytest.raises(InputError, match=r"^false_alarm_rate: .* must be from 1e-09 to 0.1 "):
            detect(rate)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: chi_square_window([1.0], 1, 2, 0.0), "false_alarm_rate: 0 must be from 1e-09 to"),
        (lambda: chi_square_window([-1.0], 1, 2, 0.01), "distances: -1 at row 0 must be 0 or more"),
        (lambda: chi_square_window([1.0], 1, 0, 0.01), "length: 0 must be"),
        (lambda: cusum_of_mean([1.0], -1.0, 0.01), "shift"),
        (lambda: cusum_of_mean([1.0], 1e-3, 1e-9), "shift: 0.001 is too small for so few false"),
        (lambda: cusum_of_mean([[1.0]], 1.0, 0.01), "values: have shape (1, 1), must be (k,)"),
        (lambda: glr_of_mean([1.0, np.inf], [1], 0.01), "values: must be within 1e+140, are not"),
        (lambda: glr_of_size([1.0], 1, [0.5], 0.01), "lengths"),
        (lambda: consistency([1.0], 1, 1.0), "probability: 1 must be between 0 and 1"),
        (lambda: consistency(1.0, 1), "distances: have shape (), must be (k,) or (records, k)"),
    ],
)  # fmt: skip
def test_wrong_arguments_are_refused(call: Any, said: str) -> None:
    with pytest.raises(InputError) as caught:
        call()
    assert str(caught.value).startswith(said)
