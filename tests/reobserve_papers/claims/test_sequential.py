"""The stopping rule of sampling: its error rate and cost for known shares."""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import product

import numpy as np
import pytest

from reobserve_papers.claims.choices import Knob
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


# Words come in equal numbers, so that samples are not independent.


def ever_wrong(shares: np.ndarray, copies: int, most: int = 80) -> float:
    """The probability that a share on the line is ever said to be above it, or below, the larger.

    Each axis is a choice of words, and ``shares`` are those of samples with these words that agree.
    A block has so many copies of each word in random order. The state is the number of copies that
    are left of each word but the last, and the number of samples that agreed.
    """
    line, words = float(np.mean(shares)), len(shares)
    state = np.zeros((copies + 1,) * (words - 1) * shares.ndim + (most + 1,))
    full = (copies,) * (state.ndim - 1)
    state[*full, 0] = 1.0
    known = np.indices(state.shape[:-1]).reshape(shares.ndim, words - 1, *state.shape[:-1])
    wrong = {True: 0.0, False: 0.0}
    for samples in range(1, most + 1):
        left = copies * words - (samples - 1) % (copies * words)
        share_left = np.concatenate([known, left - known.sum(axis=1, keepdims=True)], axis=1) / left
        state, before = np.zeros_like(state), state
        for chosen in product(range(words), repeat=shares.ndim):
            taken = [share_left[choice, word] for choice, word in enumerate(chosen)]
            moved = before * np.prod(taken, axis=0)[..., np.newaxis]
            for choice, word in enumerate(chosen):
                if word < words - 1:
                    moved = np.roll(moved, -1, axis=choice * (words - 1) + word)
            state += shares[chosen] * np.roll(moved, 1, axis=-1) + (1 - shares[chosen]) * moved
        if left == 1:
            ended = state.reshape(-1, most + 1).sum(axis=0)
            state[:] = 0
            state[full] = ended
        for agreed in range(samples + 1):
            if (said := above(line, agreed, samples)) is not None:
                wrong[said] += state[..., agreed].sum()
                state[..., agreed] = 0
    assert 0 < state.sum() + sum(wrong.values()) == pytest.approx(1)
    return max(wrong.values())


TWO, THREE = np.indices((2, 2)), np.indices((3, 3))
AGREED = {
    "one of 3 words does not": np.array([1.0, 1.0, 0.0]),
    "one of 4 words does not": np.array([1.0, 1.0, 1.0, 0.0]),
    "one of 3 words, by a number": np.array([1.0, 1.0, 0.7]),
    "one of 4 words, by a number": np.array([1.0, 1.0, 1.0, 0.6]),
    "two words that differ": (TWO[0] != TWO[1]) * 1.0,
    "two words that differ, or a number": np.where(TWO[0] != TWO[1], 1.0, 0.8),
    "two of 3 words that differ, or a number": np.where(THREE[0] != THREE[1], 1.0, 0.7),
    "three words not all alike, or a number": np.where(
        np.ptp(np.indices((2, 2, 2)), axis=0) > 0, 1.0, 0.6
    ),
}


@pytest.mark.parametrize("agreed", AGREED)
def test_words_in_equal_numbers_keep_the_error_rate(agreed: str) -> None:
    words = tuple(range(len(AGREED[agreed])))
    block = Knob((), (), "", words=words).block
    assert ever_wrong(AGREED[agreed], block // len(words)) <= ERROR


def test_blocks_of_each_word_once_would_not_keep_it() -> None:
    assert ever_wrong(AGREED["three words not all alike, or a number"], 1) > ERROR
