"""The rule that ends the draws: its error rate and its cost on shares that are known."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

from reobserve.replication.claims.sequential import ERROR, above, interval

LINE = 0.9


def decide(agreed: np.ndarray, most: int) -> tuple[bool | None, int]:
    """What a sequence of draws decides, looked at after each of them, and after how many."""
    total = 0
    for draws, one in enumerate(agreed[:most], start=1):
        total += int(one)
        found = above(LINE, total, draws)
        if found is not None:
            return found, draws
    return None, most


def simulate(share: float, most: int, runs: int = 400) -> tuple[float, float, float]:
    """Which parts of the runs say above and below, and how many draws they take on average."""
    stream = np.random.default_rng(round(1000 * share))
    found = [decide(stream.random(most) < share, most) for _ in range(runs)]
    said = [word for word, _ in found]
    return (
        said.count(True) / runs, said.count(False) / runs,
        float(np.mean([draws for _, draws in found])),
    )  # fmt: skip


@pytest.mark.parametrize("share", [0.5, 0.8, 0.88, 0.9, 0.92, 0.97, 1.0])
def test_it_errs_as_seldom_as_it_says_however_often_one_looks(share: float) -> None:
    says_above, says_below, _ = simulate(share, 400)
    wrong = says_above if share < LINE else says_below
    # Five standard deviations of the simulation above what is allowed.
    assert wrong <= ERROR + 5 * math.sqrt(ERROR * (1 - ERROR) / 400)


@pytest.mark.parametrize(
    ("share", "most", "decided", "draws"),
    [(0.2, 40, 1.0, 5), (0.5, 40, 0.99, 9), (0.7, 160, 0.99, 35), (0.97, 160, 0.7, 100)],
)
def test_what_it_costs(share: float, most: int, decided: float, draws: int) -> None:
    """Far from the line few draws decide; `draws` is the number that suffices on average."""
    says_above, says_below, mean = simulate(share, most)
    assert (says_above if share > LINE else says_below) >= decided
    assert mean <= draws


def test_the_evidence_is_that_of_the_mixture_over_fractions() -> None:
    """For k agreeing draws the second gambler has 1 / ((n + 1) binom(n, k)) over p^k q^(n-k)."""
    for draws in range(1, 40):
        for agreed in range(draws):
            if agreed >= 0.9 * draws:
                continue
            p = Fraction(9, 10)
            mixed = Fraction(1, (draws + 1) * math.comb(draws, agreed))
            stands = mixed / (p**agreed * (1 - p) ** (draws - agreed)) < 20
            assert above(LINE, agreed, draws) is (None if stands else False)


def test_the_interval_leaves_the_line_when_it_decides() -> None:
    for draws in range(1, 120):
        for agreed in range(draws + 1):
            low, high = interval(agreed, draws)
            assert 0 <= low <= agreed / draws <= high <= 1
            found = above(LINE, agreed, draws)
            assert (low > LINE) is (found is True)
            assert (high < LINE) is (found is False)
    assert interval(0, 0) == (0.0, 1.0)
    assert above(LINE, 0, 0) is None
