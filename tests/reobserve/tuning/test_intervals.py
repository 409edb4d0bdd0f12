"""Intervals cover under repeated looks and against a selected best."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from reobserve.tuning.intervals import (
    Array,
    against_others,
    anytime_quantile,
    common_variance,
    interval,
    student_quantile,
)

STEP, MOST = 16, 64
Draw = Callable[[np.random.Generator, tuple[int, int]], Array]
SHAPES: dict[str, Draw] = {  # of what records have beside their common part; all with mean zero
    "normal": lambda random, shape: random.normal(size=shape),
    "skewed": lambda random, shape: 1.0 - random.exponential(size=shape),
    "log of a normal error": lambda random, shape: np.log(abs(random.normal(size=shape))) + 0.635,
    "one in five missed": lambda random, shape: (random.random(shape) < 0.2) * 3.0 - 0.6,
}


def sequence(logs: Array) -> tuple[list[tuple[float, ...]], int]:
    """Ratios of all rows to the best other one, by the rule of the bench."""
    rows = range(len(logs))
    for count in range(STEP, MOST + 1, STEP):
        found = [against_others(logs[:, :count], k, rows, anytime=True) for k in rows]
        if all(high <= 1.05 or low > 1.05 for _, low, high in found):
            break
    return found, count


@pytest.mark.nightly_after(8)
@pytest.mark.parametrize("shape", list(SHAPES))
@pytest.mark.parametrize(("rows", "deviation"), [(2, 0.3), (6, 0.05), (6, 1.0)])
def test_equal_methods_are_rarely_said_to_differ(shape: str, rows: int, deviation: float) -> None:
    """In at most 5 % of comparisons, though one looks four times and the best is selected."""
    random, differ, repeats = np.random.default_rng(1), 0, 150
    for _ in range(repeats):
        logs = random.normal(size=MOST) + deviation * SHAPES[shape](random, (rows, MOST))
        found, _ = sequence(logs)
        differ += sum(low > 1 or high < 1 for _, low, high in found)
    assert differ / (rows * repeats) <= 0.05


@pytest.mark.nightly_cases("skewed")
@pytest.mark.parametrize("shape", ["normal", "skewed"])
def test_five_percent_question_is_rarely_answered_wrongly(shape: str) -> None:
    """At its worst: a row that is 5 % worse than the best, among equal ones and bad ones."""
    for gap, answer in ((1.05, "no"), (1.0501, "yes")):
        random, wrong, repeats = np.random.default_rng(2), 0, 200
        for _ in range(repeats):
            logs = random.normal(size=MOST) + 0.05 * SHAPES[shape](random, (6, MOST))
            logs += np.log([gap, 1.0, 1.0, 1.0, 1.2, 2.0])[:, None]
            (_, low, high), *_ = sequence(logs)[0]
            wrong += low > 1.05 if answer == "no" else high <= 1.05
        assert wrong / repeats <= 0.05


def test_questions_with_an_answer_are_decided() -> None:
    """Of methods 2 and 10 % worse than the best, with differences that vary by 7 %."""
    random, yes, no, stopped = np.random.default_rng(3), 0, 0, []
    for _ in range(100):
        logs = random.normal(size=MOST) + 0.05 * random.normal(size=(3, MOST))
        found, count = sequence(logs + np.log([1.0, 1.005, 1.1])[:, None])
        yes += found[1][2] <= 1.05
        no += found[2][1] > 1.05
        stopped.append(count)
    assert yes > 80
    assert no > 80
    assert np.mean(stopped) < 60


def test_anytime_interval_covers_the_mean_at_all_numbers_of_records() -> None:
    """In 95 % of sequences of up to 1000 normal numbers, where Student's misses in a third."""
    random, repeats = np.random.default_rng(4), 400
    values = random.normal(size=(repeats, 1000))
    n = np.arange(1, 1001)
    means = np.cumsum(values, axis=1) / n
    squares = np.cumsum(values**2, axis=1) - n * means**2
    t = (np.abs(means) * np.sqrt(n * (n - 1)) / np.sqrt(np.maximum(squares, 1e-12)))[:, 1:]
    anytime, student = (
        (t > [quantile(k) for k in range(2, 1001)]).any(axis=1).mean()
        for quantile in (anytime_quantile, student_quantile)
    )
    assert anytime <= 0.05
    assert student > 0.3


@pytest.mark.parametrize("count", [16, 40, 64])
def test_quantile_is_where_the_mixed_likelihood_ratio_of_t_is_twenty(count: int) -> None:
    """The ratio by quadrature over the mean in units of the deviation, of variance 1/8."""
    from scipy.integrate import quad
    from scipy.stats import nct, norm, t

    T, sd = anytime_quantile(count), math.sqrt(1 / 8)

    def density(effect: float) -> float:
        return float(nct.pdf(T, count - 1, effect * math.sqrt(count)) * norm.pdf(effect, 0, sd))

    mixed = quad(density, -1.0, 2.5, limit=400, epsabs=1e-13)[0]
    assert mixed / t.pdf(T, count - 1) == pytest.approx(20.0, rel=1e-3)


@pytest.mark.parametrize(("count", "quantile"), [(4, 3.182446), (9, 2.306004), (40, 2.022691)])
def test_interval_of_one_look_has_students_width(count: int, quantile: float) -> None:
    logs = np.random.default_rng(1).normal(-1.0, 0.3, count)
    half = quantile * np.sqrt(((logs - logs.mean()) ** 2).sum() / (count - 1) / count)
    expected = [logs.mean(), logs.mean() - half, logs.mean() + half]
    assert np.log(interval(logs)) == pytest.approx(expected, rel=1e-6)
    wider = np.log(interval(logs, more=3 * logs.var(ddof=1) / count))
    assert wider[2] - wider[1] == pytest.approx(4 * half)


def test_reference_is_the_best_of_the_records_before() -> None:
    """Row 1 is best after one record, row 2 after two and three."""
    logs = np.array([[0.5, 0.6, 0.9, 0.4], [0.0, 1.0, 1.0, 1.0], [0.2, 0.1, 0.1, 0.3]])
    ratio, low, high = np.log(against_others(logs, 0, range(3)))
    assert ratio == pytest.approx(0.6 - 0.175)
    steps = np.array([0.6 - 1.0, 0.9 - 0.1, 0.4 - 0.3])
    assert low == pytest.approx(steps.mean() - 4.302653 * steps.std(ddof=1) / np.sqrt(3))
    ends = [(logs[0] - one).mean() + 3.182446 * (logs[0] - one).std(ddof=1) / 2 for one in logs[1:]]
    assert high == pytest.approx(max(ends))
    assert against_others(logs[:1], 0, [0]) == (1.0, 1.0, 1.0)


def test_what_records_have_in_common_is_inside_the_interval() -> None:
    """A threshold, say, whose error of 0.2 moves all records of a method alike."""
    random = np.random.default_rng(5)

    def covered(with_draws: bool) -> float:
        inside = 0
        for _ in range(200):
            logs = 0.2 * random.normal(size=(64, 2)) + random.normal(0, 0.2, 2)
            draws = logs.T + random.normal(0, 0.2, (40, 2))[:, :, None]
            more: Any = {"redrawn": draws} if with_draws else {}
            _, low, high = against_others(logs.T, 0, [1], **more)
            inside += low <= 1 <= high
        return inside / 200

    assert covered(True) >= 0.92
    assert covered(False) < 0.5
    draws = random.normal(0, 0.3, (4000, 1, 1)) * np.ones((1, 2, 3)) * [[[1.0], [3.0]]]
    assert common_variance(draws, 0) == pytest.approx(0.09, rel=0.1)
    assert common_variance(draws, 0, 1) == pytest.approx(0.36, rel=0.1)
    assert common_variance(None, 0, 1) == 0.0
