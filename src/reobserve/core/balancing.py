"""Scales of states and outputs that do not depend on the units they are given in.

State i depends on state j by the entry A[i, j], which stands for log2 |A[i, j]| here. Paths of such
steps begin at an output; each step costs alpha, the largest mean of a cycle of A, so that no cycle
gains anything. With r[j] the best that a path from any output comes to at state j,

    2^(r[i] - r[j]) |A[i, j]| <= 2^alpha,      2^(s[k] - r[j]) |C[k, j]| <= 1,

and each state has a path along which equality holds. Other units add the same number to log2 of a
row and subtract it from the column, and so to r: the scaled matrices are those of any units. The
offsets s of the outputs are the least squares fit of r[j] - s[k] to the best paths from k to j.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Scales(NamedTuple):
    """Powers of two: ``states`` r (-inf if no output depends on it), ``outputs`` s, ``rate``."""

    states: Array
    outputs: Array
    rate: float

    def rounded(self) -> Scales:
        """The scales with whole powers, by which scaling is exact."""
        return Scales(np.rint(self.states), np.rint(self.outputs), float(np.rint(self.rate)))

    def completed(self, A: Array, driven: Array | None = None) -> Scales:
        """The scales with those of states that no output depends on, by what moves them, else 0.

        ``driven`` is log2 of what moves states beside each other, in their units.
        """
        r, steps = np.array(self.states), logarithm(A) - self.rate
        hidden = ~np.isfinite(r)
        if not hidden.any():
            return self
        sources = np.full(len(r), -np.inf) if driven is None else driven
        if not hidden.all():
            sources = np.maximum(sources, (steps[:, ~hidden] - r[~hidden]).max(axis=1))
        moved = (best_paths(steps[np.ix_(hidden, hidden)]) + sources[hidden]).max(axis=1)
        r[hidden] = np.where(np.isfinite(moved), -moved, 0.0)
        return self._replace(states=r)

    def transition(self, A: Array) -> Array:
        """2^r A 2^-r."""
        return powers(A, self.states[:, None] - self.states)

    def output(self, C: Array) -> Array:
        """2^s C 2^-r."""
        return powers(C, self.outputs[:, None] - self.states)

    def gain(self, L: Array) -> Array:
        """2^-r L 2^s: a gain of the scaled system as one of the system itself."""
        return powers(L, self.outputs - self.states[:, None])


def powers(matrix: Array, exponents: Array) -> Array:
    """The matrix times powers of two, entry by entry, exact if they are whole."""
    whole = np.rint(exponents)
    scaled: Array = np.ldexp(matrix * np.exp2(exponents - whole), whole.astype(np.int64))
    return scaled


def logarithm(matrix: Array) -> Array:
    """Logarithms to base 2 of the sizes of all entries, -inf of zero."""
    with np.errstate(divide="ignore"):
        logs: Array = np.log2(np.abs(matrix))
    return logs


def output_scales(
    A: Array, C: Array, outputs: Array | None = None, rate: float = -np.inf
) -> Scales:
    """The scales of a pair.

    Parameters
    ----------
    A, C
        Shapes (n, n) and (m, n).
    outputs
        s, if the outputs have scales of their own; otherwise they are fitted.
    rate
        What alpha is at least.
    """
    steps = logarithm(A)
    rate = max(rate, _cycle_mean(steps))
    rate = rate if np.isfinite(rate) else 0.0
    reached = product(logarithm(C), best_paths(steps - rate))
    offsets = _fitted(reached) if outputs is None else outputs
    return Scales((offsets[:, None] + reached).max(axis=0), offsets, rate)


def product(left: Array, right: Array) -> Array:
    """The best sums along two steps: of max and plus in place of plus and times."""
    return np.array([(row[:, None] + right).max(axis=0) for row in left])


def best_paths(steps: Array) -> Array:
    """The best sum of steps from each place to each, zero from one to itself."""
    best = np.array(steps)
    np.fill_diagonal(best, 0.0)
    for middle in range(len(best)):
        best = np.maximum(best, best[:, middle, None] + best[middle])
    return best


def _cycle_mean(steps: Array) -> float:
    """The largest mean of the steps of a cycle (Karp 1978, from a source before all places)."""
    n = len(steps)
    walks = [np.zeros(n)]
    for _ in range(n):
        walks.append((walks[-1][:, None] + steps).max(axis=0))
    ended = walks[n] > -np.inf
    if not ended.any():
        return -np.inf
    lengths = n - np.arange(n)
    means = [(walks[n][ended] - walks[k][ended]) / lengths[k] for k in range(n)]
    return float(np.min(means, axis=0).max())


def _fitted(reached: Array) -> Array:
    """s of the least squares fit of r[j] - s[k], 0 for an output that depends on no state."""
    outputs, states = np.nonzero(np.isfinite(reached))
    m = len(reached)
    rows = np.zeros((len(outputs), m + reached.shape[1]))
    rows[np.arange(len(outputs)), outputs] = -1.0
    rows[np.arange(len(outputs)), m + states] = 1.0
    solution = np.linalg.lstsq(rows, reached[outputs, states], rcond=None)[0][:m]
    return np.asarray(solution, dtype=np.float64)
