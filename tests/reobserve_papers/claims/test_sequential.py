"""The stopping rule of sampling: its error rate and cost for known shares."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

from reobserve_papers.claims.sequential import ERROR, above, interval

LINE = 0.9


def decide(agreed: np.ndarray, most: int) -> tuple[bool | None, int]:
    """The decision for a sequence of samples, tested after each, and the number of samples used."""
    total = 0
    for samples, one in enumerate(agreed[:most], start=1):
        total += int(one)
        found = above(LINE, total, samples)
        if found is not None:
            return found, samples
    return None, most


def simulate(share: float, most: int, runs: int = 400) -> tuple[float, float, float]:
    """The shares of runs that decide above and below, and the mean number of samples."""
    stream = np.random.default_rng(round(1000 * share))
    found = [decide(stream.random(most) < share, most) for _ in range(runs)]
    said = [word for word, _ in found]
    return (
        said.count(True) / runs, said.count(False) / runs,
        float(np.mean([samples for _, samples in found])),
    )  # fmt: skip


@pytest.mark.parametrize("share", [0.5, 0.8, 0.88, 0.9, 0.92, 0.97, 1.0])
def test_sequential_test_keeps_its_error_rate(share: float) -> None:
    says_above, says_below, _ = simulate(share, 400)
    wrong = says_above if share < LINE else says_below
    # Five standard deviations of the simulation above the allowed rate.
    assert wrong <= ERROR + 5 * math.sqrt(ERROR * (1 - ERROR) / 400)


@pytest.mark.parametrize(
    ("share", "most", "decided", "samples"),
    [(0.2, 40, 1.0, 5), (0.5, 40, 0.99, 9), (0.7, 160, 0.99, 35), (0.97, 160, 0.7, 100)],
)
def test_sequential_test_has_the_stated_cost(
    share: float, most: int, decided: float, samples: int
) -> None:
    """Far from the threshold few samples decide; `samples` is the number needed on average."""
    says_above, says_below, mean = simulate(share, most)
    assert (says_above if share > LINE else says_below) >= decided
    assert mean <= samples


def test_evidence_agrees_with_the_exact_mixture() -> None:
    """For k agreeing samples the second gambler has 1 / ((n + 1) binom(n, k)) over p^k q^(n-k)."""
    for samples in range(1, 40):
        for agreed in range(samples):
            if agreed >= 0.9 * samples:
                continue
            p = Fraction(9, 10)
            mixed = Fraction(1, (samples + 1) * math.comb(samples, agreed))
            stands = mixed / (p**agreed * (1 - p) ** (samples - agreed)) < 20
            assert above(LINE, agreed, samples) is (None if stands else False)


def test_interval_excludes_the_threshold_when_decided() -> None:
    for samples in range(1, 120):
        for agreed in range(samples + 1):
            low, high = interval(agreed, samples)
            assert 0 <= low <= agreed / samples <= high <= 1
            found = above(LINE, agreed, samples)
            assert (low > LINE) is (found is True)
            assert (high < LINE) is (found is False)
    assert interval(0, 0) == (0.0, 1.0)
    assert above(LINE, 0, 0) is None
