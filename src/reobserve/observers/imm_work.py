"""Arrays of a bank of filters: posteriors, estimates by row, and those of a step."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reobserve.observers import linear_steps as linear
from reobserve.observers.filter_rules import Rules

Array = NDArray[np.float64]

LEAST = 1e-280  # a sum of probabilities above this has all its digits


class Posteriors(NamedTuple):
    """Means (r, n), covariances (r, n, n) and output errors (r, m) of all filters, and log mu.

    ``noise``, (m,), are the variances of R, and ``begun``, (1,), the number of rows before, if they
    are estimated.
    """

    means: Array
    covariances: Array
    errors: Array
    log_probabilities: Array
    noise: Array
    begun: Array


class BankRows(NamedTuple):
    """The estimates of a bank, a row a sample, by their names.

    ``outlier`` and ``noise_variance`` have one row, which is overwritten, if nobody wants them.
    """

    state: Array
    covariance: Array
    probability: Array
    innovation: Array
    log_likelihood: Array
    outlier: Array
    noise_variance: Array


class BankWork(NamedTuple):
    """Arrays of a step: mu(i|j), (r, r), mixed posteriors, log-likelihoods (r,), one filter's.

    ``taken``, (m,), is a row without outliers, ``changes``, (r, m), what each filter says of the
    variances of R, and ``apart``, (r, n), how far the filters' means are from a mixed one.
    """

    weights: Array
    mixed: Posteriors
    log_likelihoods: Array
    taken: Array
    changes: Array
    apart: Array
    of_filter: linear.LinearWork


def new_bank_work(posteriors: Posteriors, mixing: bool, rules: Rules | None = None) -> BankWork:
    """Arrays for the steps of a bank, whose mixed posteriors without mixing are the filters'."""
    r, n = posteriors.means.shape
    m = posteriors.errors.shape[1]
    means, covariances, errors, *_ = posteriors
    if mixing:
        means, covariances = np.empty((r, n)), np.empty((r, n, n))
    mixed = Posteriors(means, covariances, errors, np.empty(r), *posteriors[4:])
    return BankWork(
        np.empty((r, r)), mixed, np.empty(r), np.empty(m), np.zeros((r, m)), np.empty((r, n)),
        linear.new_linear_work(n, m, rules),
    )  # fmt: skip


def new_bank_rows(
    k: int, r: int, n: int, m: int, gated: bool = False, learned: bool = False
) -> BankRows:
    """Arrays for the estimates of k rows, by r filters of n states and m outputs."""
    shapes = (k, n), (k, n, n), (k, r), (k, r, m), (k,), (k if gated else 1, m)
    return BankRows(*map(np.empty, (*shapes, (k if learned else 1, m))))
