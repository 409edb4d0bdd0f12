"""Detectors of a change of the plant from one model to another: banks, and standard tests.

A detector computes one statistic per sample and raises an alarm where it exceeds a threshold, which
is set on records without a fault. The statistic of a bank is the log odds of the faulty model.
Three more detectors use the two filters of the first bank, run alone: a bank without mixing, Page's
cumulative sum of their log-likelihood ratios, and, with the normal model's filter only, the
likelihood ratio for innovations that have become larger.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from reobserve.core.kernel import kernel
from reobserve.observers.imm import IMM
from reobserve.observers.imm_loop import mixing_probabilities, update_probabilities
from reobserve.observers.linear_filter import LinearFilter
from reobserve.papers.imm import keys
from reobserve.papers.imm.innovation_tests import cusum, inflation_glr
from reobserve.papers.imm.setup import run, stacked_inputs, start_alone
from reobserve.papers.imm.study_rows import CUSUM, GLR, UNMIXED

Array = NDArray[np.float64]
Bank = tuple[IMM, keys.Observer]

LENGTHS = 2 ** np.arange(10)  # samples since a change, for the likelihood ratio

FAR = 700.0  # limit of log odds: exp(-FAR) is about the smallest probability


@dataclass(frozen=True)
class Detectors:
    """Banks of two models by name, the normal model first, and tests on the first bank's filters.

    The tests skip the first ``settling`` rows of a record, where the filters start from other
    states. ``rest`` are `rest_likelihoods` of at least as many rows as a record has. ``expected``
    is the mean of `distances` over records without a fault: m, if the model has the plant's noise.
    """

    banks: Mapping[str, Bank]
    settling: int
    rest: Array
    expected: float

    def statistics(self, measured: Array, held: Array) -> dict[str, Array]:
        """Statistics by detector, each of shape (k,); -inf after a bank has diverged.

        ``measured``, (k, m), are the outputs at the ends of steps, and ``held``, (k,), the inputs
        held over the steps.
        """
        found = {name: log_odds(bank, measured, held) for name, bank in self.banks.items()}
        first = next(iter(self.banks.values()))
        normal, faulty = (likelihoods(first, mode, measured, held) for mode in (0, 1))
        both = np.stack([normal, faulty], axis=1)
        found[UNMIXED] = unmixed_log_odds(np.asarray(first[0].transition), both)
        ratios, far = faulty - normal, distances(self.rest, normal)
        ratios[: self.settling] = far[: self.settling] = np.nan
        found[CUSUM] = cusum(ratios)
        outputs = first[0].measurements
        found[GLR] = inflation_glr(far * (outputs / self.expected), outputs, LENGTHS)
        return found


def log_odds(bank: Bank, measured: Array, held: Array) -> Array:
    """Log odds of the faulty model, (k,), from -700 to 700; -inf after the bank has diverged."""
    found = run(*bank, measured, held)["probability"]
    known = np.log(np.maximum(found, math.exp(-FAR)))
    odds = np.full(len(measured), -np.inf)
    odds[: len(known)] = known[:, 1] - known[:, 0]
    return odds


def likelihoods(bank: Bank, mode: int, measured: Array, held: Array) -> Array:
    """Log-likelihoods of a record, shape (k,), by the filter of one mode, run alone."""
    one, observer = bank
    alone = cast(LinearFilter, one.filters[mode])
    begin = start_alone(alone, observer, held[0])
    return np.asarray(alone.run(measured, stacked_inputs(held), state=begin)["log_likelihood"])


def rest_likelihoods(bank: Bank, rows: int) -> Array:
    """Log-likelihoods of a record at rest by the normal model's filter: no innovations, same S."""
    return likelihoods(bank, 0, np.zeros((rows, bank[0].measurements)), np.zeros(rows))


def distances(rest: Array, found: Array) -> Array:
    """e' S^-1 e, shape (k,): twice the log-likelihoods at rest minus those of the record."""
    return np.maximum(2.0 * (rest[: len(found)] - found), 0.0)


@kernel
def unmixed_log_odds(transition: Array, log_likelihoods: Array) -> Array:
    """Log odds of the second of two modes, shape (k,), from equal odds before the first sample.

    ``log_likelihoods`` have shape (k, 2). The chain acts on the probabilities only.
    """
    odds = np.empty(len(log_likelihoods))
    weights, predicted = np.empty((2, 2)), np.empty(2)
    log_probabilities = np.full(2, -math.log(2.0))
    for k in range(len(log_likelihoods)):
        mixing_probabilities(transition, log_probabilities, weights, predicted)
        log_probabilities[:] = predicted
        update_probabilities(log_probabilities, log_likelihoods[k])
        odds[k] = log_probabilities[1] - log_probabilities[0]
    return odds
