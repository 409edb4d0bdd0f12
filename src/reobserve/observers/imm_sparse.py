"""Mixing of a bank of many modes, each of which is reached from few others, or from all alike.

    p_ij = b_j + d_ij,    d_ij = 0 but for few i

The sums over all modes of what is mixed are then the same for each mode but for b_j, and only those
of d_ij remain: r sums over few modes instead of r sums over r.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reobserve.core.kernel import inlined_kernel
from reobserve.observers.imm_work import LEAST, BankWork, Posteriors

Array = NDArray[np.float64]

FEWEST = 16  # modes: of fewer the sums over all are as fast
SHARE = 1 / 3  # of all d_ij that may differ from zero


class Sources(NamedTuple):
    """The modes i with d_ij other than zero, mode j's from ``starts[j]`` on, and b_j, (r,).

    All are empty if they are not few.
    """

    starts: NDArray[np.int64]
    modes: NDArray[np.int64]
    more: Array
    rest: Array


def sources_of(transition: Array, periods: Array) -> Sources:
    """The sources of each mode of a chain, empty if sums over all are to be formed.

    That is so for ``periods`` of angles, too, whose mean has no such sums.
    """
    rest = transition.min(axis=0)
    more = transition - rest
    few = len(rest) >= FEWEST and np.count_nonzero(more) < SHARE * more.size
    if not few or periods.any():
        none = np.empty(0, dtype=np.int64)
        return Sources(none, none, np.empty(0), np.empty(0))
    targets, modes = np.nonzero(more.T)
    starts = np.searchsorted(targets, np.arange(len(rest) + 1))
    return Sources(starts, modes, np.ascontiguousarray(more.T[targets, modes]), rest)


@inlined_kernel
def mix_all(posteriors: Posteriors, work: BankWork) -> float:
    """Write mean and covariance of all filters, and return the sum of the probabilities."""
    # sum_i mu_i x_i,   sum_i mu_i (P_i + (x_i - x) (x_i - x)')
    r, n = posteriors.means.shape
    means, shares, common, whole = posteriors.means, work.weights[0], work.common, 0.0
    for i in range(r):
        shares[i] = math.exp(posteriors.log_probabilities[i])
        whole += shares[i]
    for a in range(n):
        common[a, n] = 0.0
        for i in range(r):
            common[a, n] += shares[i] * means[i, a] / whole
    for a in range(n):
        for b in range(a + 1):
            common[a, b] = 0.0
            for i in range(r):
                apart = (means[i, a] - common[a, n]) * (means[i, b] - common[b, n])
                common[a, b] += shares[i] * (posteriors.covariances[i, a, b] + apart) / whole
    return whole


@inlined_kernel
def mix_one(
    j: int, first: float, total: float, sources: Sources, posteriors: Posteriors, work: BankWork
) -> None:
    """Mix the posteriors for mode j: all with the weight ``first``, its sources with more."""
    n = posteriors.means.shape[1]
    means, covariances, mixed = posteriors.means, posteriors.covariances, work.mixed
    shares, common, modes = work.weights[0], work.common, sources.modes
    begin, end = sources.starts[j], sources.starts[j + 1]
    for a in range(n):
        mean = first * common[a, n]
        for at in range(begin, end):
            mean += sources.more[at] * shares[modes[at]] * means[modes[at], a]
        mixed.means[j, a] = mean / total
    for a in range(n):
        for b in range(a + 1):
            apart = (common[a, n] - mixed.means[j, a]) * (common[b, n] - mixed.means[j, b])
            value = first * (common[a, b] + apart)
            for at in range(begin, end):
                i = modes[at]
                apart = (means[i, a] - mixed.means[j, a]) * (means[i, b] - mixed.means[j, b])
                value += sources.more[at] * shares[i] * (covariances[i, a, b] + apart)
            mixed.covariances[j, a, b] = mixed.covariances[j, b, a] = value / total


# c_j = b_j sum_i mu_i + sum_i d_ij mu_i
# x0_j = (b_j sum_i mu_i x_i + sum_i d_ij mu_i x_i) / c_j
# P0_j = the same of P_i + (x_i - x0_j) (x_i - x0_j)', about the mean of all in the first sum
@inlined_kernel
def interact_by_sources(sources: Sources, posteriors: Posteriors, work: BankWork) -> bool:
    """Mix the filters' posteriors and predict the modes, or return False if a sum underflows."""
    whole = mix_all(posteriors, work)
    for j in range(len(sources.rest)):
        first = sources.rest[j] * whole
        total = first
        for at in range(sources.starts[j], sources.starts[j + 1]):
            total += sources.more[at] * work.weights[0, sources.modes[at]]
        if not total > LEAST:
            return False
        work.mixed.log_probabilities[j] = math.log(total)
        mix_one(j, first, total, sources, posteriors, work)
    return True
