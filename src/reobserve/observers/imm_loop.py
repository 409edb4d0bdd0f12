"""Compiled steps of the interacting multiple model, and the loop over a record.

Probabilities of modes are kept as logarithms. Where a sum of them is within the range of floats it
is formed as it stands, and else by log-sum-exp, so that a mode may become as unlikely as it likes
and still come back.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reobserve.core.kernel import inlined_kernel, kernel
from reobserve.observers.linear_filter_loop import (
    Size,
    assign,
    correct,
    fill,
    is_missing,
    new_work,
    predict,
)
from reobserve.systems.linear import ModelArrays

Array = NDArray[np.float64]

LEAST = 1e-280  # a sum of probabilities above this has all its digits


class Bank(NamedTuple):
    """The filters' matrices and parameters one behind the other, and the chain of the modes.

    ``model`` holds arrays of shape (r, ...), ``parameters`` has shape (r, q), ``transition``
    (r, r), where row i says where mode i goes.
    """

    model: ModelArrays
    parameters: Array
    transition: Array
    mixing: bool


class Beliefs(NamedTuple):
    """Means (r, n), covariances (r, n, n) and output errors (r, m) of all filters, and log mu."""

    means: Array
    covariances: Array
    errors: Array
    log_probabilities: Array


class BankRows(NamedTuple):
    """What a run writes, a row a sample.

    Means (k, n) and covariances (k, n, n) of the mixture, probabilities (k, r), innovations of
    each filter (k, r, m) and log-likelihoods of the measurement over all modes, (k,).
    """

    means: Array
    covariances: Array
    probabilities: Array
    innovations: Array
    log_likelihoods: Array


def new_bank_rows(rows: int, modes: int, states: int, outputs: int) -> BankRows:
    """Room for `run_bank`."""
    return BankRows(
        np.empty((rows, states)), np.empty((rows, states, states)), np.empty((rows, modes)),
        np.empty((rows, modes, outputs)), np.empty(rows),
    )  # fmt: skip


@inlined_kernel
def mixing_probabilities(
    transition: Array, log_probabilities: Array, weights: Array, predicted: Array
) -> None:
    """By sums to r: ``weights`` mu(i|j) with j along columns, ``predicted`` log c_j.

    Gadsden et al. 2011, (7) and (8).

    A mode that cannot be reached keeps to itself.
    """
    r = len(log_probabilities)
    for i in range(r):
        probability = math.exp(log_probabilities[i])
        for j in range(r):
            weights[i, j] = transition[i, j] * probability
    for j in range(r):
        total = 0.0
        for i in range(r):
            total += weights[i, j]
        if total > LEAST:
            predicted[j] = math.log(total)
        else:
            greatest = -math.inf
            for i in range(r):
                weights[i, j] = math.log(transition[i, j]) + log_probabilities[i]
                greatest = max(greatest, weights[i, j])
            total = 0.0
            for i in range(r):
                if greatest == -math.inf:
                    weights[i, j] = 1.0 if i == j else 0.0
                else:
                    weights[i, j] = math.exp(weights[i, j] - greatest)
                total += weights[i, j]
            predicted[j] = greatest + math.log(total)
        for i in range(r):
            weights[i, j] /= total


@inlined_kernel
def interact(
    states: Size, weights: Array, means: Array, covariances: Array, mixed: Array, spread: Array
) -> None:
    """Write mixed means (r, n) and covariances (r, n, n), by weights mu(i|j).

    Gadsden et al. 2011, (9) and (10).
    """
    n, r = len(states), len(means)
    for j in range(r):
        for a in range(n):
            total = 0.0
            for i in range(r):
                total += weights[i, j] * means[i, a]
            mixed[j, a] = total
        for a in range(n):
            for b in range(a + 1):
                total = 0.0
                for i in range(r):
                    apart = (means[i, a] - mixed[j, a]) * (means[i, b] - mixed[j, b])
                    total += weights[i, j] * (covariances[i, a, b] + apart)
                spread[j, a, b] = total
                spread[j, b, a] = total


@inlined_kernel
def update_probabilities(
    predicted: Array, log_likelihoods: Array, log_probabilities: Array
) -> float:
    """Write log mu; return the log-likelihood of the measurement over all modes.

    Gadsden et al. 2011, (20) and (21).
    """
    r = len(predicted)
    greatest = -math.inf
    for j in range(r):
        log_probabilities[j] = predicted[j] + log_likelihoods[j]
        greatest = max(greatest, log_probabilities[j])
    total = 0.0
    for j in range(r):
        total += math.exp(log_probabilities[j] - greatest)
    whole = greatest + math.log(total)
    for j in range(r):
        log_probabilities[j] -= whole
    return whole


@inlined_kernel
def combine(
    states: Size,
    probabilities: Array,
    means: Array,
    covariances: Array,
    mean: Array,
    covariance: Array,
) -> None:
    """Write the mean and the covariance of the mixture (Gadsden et al. 2011, (22) and (23))."""
    n, r = len(states), len(means)
    for a in range(n):
        total = 0.0
        for j in range(r):
            total += probabilities[j] * means[j, a]
        mean[a] = total
    for a in range(n):
        for b in range(a + 1):
            total = 0.0
            for j in range(r):
                apart = (means[j, a] - mean[a]) * (means[j, b] - mean[b])
                total += probabilities[j] * (covariances[j, a, b] + apart)
            covariance[a, b] = total
            covariance[b, a] = total


@kernel
def run_bank(
    states: Size,
    outputs: Size,
    bank: Bank,
    function: Callable[..., None] | None,
    beliefs: Beliefs,
    measurements: Array,
    inputs: Array,
    fresh: bool,
    rows: BankRows,
) -> int:
    """Filter a record: fill the rows, move the beliefs, and return the number of good rows.

    Gadsden et al. 2011, after (23).

    ``inputs`` has a row more than the record: the input of the row before, then that of each row.
    ``fresh`` beliefs are meant at the first row, which then corrects them as they stand; else
    they are meant a period before.
    """
    r = len(beliefs.means)
    n, m = len(states), len(outputs)
    weights, predicted = np.empty((r, r)), np.empty(r)
    told, work = np.empty(r), new_work(n, m)
    mixed, spread, factor = np.empty((r, n)), np.empty((r, n, n)), np.empty((m, m))
    for k in range(len(measurements)):
        moves = k > 0 or not fresh
        assign(predicted, beliefs.log_probabilities)
        if moves:
            mixing_probabilities(bank.transition, beliefs.log_probabilities, weights, predicted)
        if moves and bank.mixing:
            interact(states, weights, beliefs.means, beliefs.covariances, mixed, spread)
        missing = is_missing(measurements[k])
        for j in range(r):
            model = ModelArrays(
                bank.model.A[j], bank.model.B[j], bank.model.C[j],
                bank.model.D[j], bank.model.Q[j], bank.model.R[j],
            )  # fmt: skip
            mean, covariance = beliefs.means[j], beliefs.covariances[j]
            if moves and bank.mixing:
                predict(states, model, inputs[k], mixed[j], spread[j], mean, covariance, work)
            elif moves:
                predict(states, model, inputs[k], mean, covariance, mean, covariance, work)
            if missing:
                fill(rows.innovations[k, j], math.nan)
                told[j] = 0.0
            else:
                told[j] = correct(
                    states, outputs, model, function, bank.parameters[j], measurements[k],
                    inputs[k + 1], mean, covariance, beliefs.errors[j], rows.innovations[k, j],
                    factor, work,
                )  # fmt: skip
        whole = update_probabilities(predicted, told, beliefs.log_probabilities)
        rows.log_likelihoods[k] = 0.0 if missing else whole
        for j in range(r):
            rows.probabilities[k, j] = math.exp(beliefs.log_probabilities[j])
            whole += rows.probabilities[k, j]
        combine(
            states, rows.probabilities[k], beliefs.means, beliefs.covariances,
            rows.means[k], rows.covariances[k],
        )  # fmt: skip
        for a in range(n):
            whole += rows.means[k, a] + rows.covariances[k, a, a]
        if not math.isfinite(whole):
            return k
    return len(measurements)
