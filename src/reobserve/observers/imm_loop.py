"""Compiled steps of the interacting multiple model, and the loop over a record.

A step is `interact`, `predict`, `correct` and `combine`. Probabilities of modes are kept as
logarithms. Where a sum of them is within the range of floats it is formed as it stands, and else by
log-sum-exp, so that a mode may become as unlikely as it likes and still come back.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reobserve.core.interrupts import FIRST, poll
from reobserve.core.kernel import inlined_kernel, kernel
from reobserve.observers import linear_steps as linear
from reobserve.observers.filter_rules import shortest
from reobserve.observers.imm_work import LEAST, BankRows, BankWork, Posteriors
from reobserve.observers.linear_loop import BEGUN
from reobserve.systems.linear import ModelRows

Array = NDArray[np.float64]

FAR = -1000.0  # a logarithm below this loses digits of the logarithm of a sum that is added to it


class Bank(NamedTuple):
    """Matrices of all filters by row, (., r, ...), their parameters, p_ij, and the bank's gate."""

    model: ModelRows
    parameters: Array
    transition: Array
    mixing: bool
    gate: float = math.inf


@inlined_kernel
def mixing_probabilities(
    transition: Array, log_probabilities: Array, weights: Array, predicted: Array
) -> None:
    """Write mu(i|j) to ``weights[j, i]`` and log c_j to ``predicted``.

    Gadsden et al. 2011, (7) and (8).

    A mode that cannot be reached keeps to itself.
    """
    # c_j = sum_i p_ij mu_i,   mu(i|j) = p_ij mu_i / c_j
    r = len(log_probabilities)
    for i in range(r):
        probability = math.exp(log_probabilities[i])
        for j in range(r):
            weights[j, i] = transition[i, j] * probability
    for j in range(r):
        total = 0.0
        for i in range(r):
            total += weights[j, i]
        if total > LEAST:
            predicted[j] = math.log(total)
        else:
            greatest = -math.inf
            for i in range(r):
                weights[j, i] = math.log(transition[i, j]) + log_probabilities[i]
                greatest = max(greatest, weights[j, i])
            total = 0.0
            for i in range(r):
                if greatest == -math.inf:
                    weights[j, i] = 1.0 if i == j else 0.0
                else:
                    weights[j, i] = math.exp(weights[j, i] - greatest)
                total += weights[j, i]
            predicted[j] = greatest + math.log(total)
        for i in range(r):
            weights[j, i] /= total


@inlined_kernel
def update_probabilities(log_probabilities: Array, log_likelihoods: Array) -> float:
    """Weigh predicted modes by their likelihoods, and return the logarithm of c.

    Gadsden et al. 2011, (20) and (21).

    It is the log-likelihood of the measurement over all modes.
    """
    # c = sum_j L_j c_j,   mu_j = L_j c_j / c
    greatest, total = -math.inf, 0.0
    for j in range(len(log_probabilities)):
        log_probabilities[j] += log_likelihoods[j]
        greatest = max(greatest, log_probabilities[j])
    for value in log_probabilities:
        total += math.exp(value - greatest)
    rest = math.log(total)
    whole = greatest + rest
    for j in range(len(log_probabilities)):
        if greatest > FAR:
            log_probabilities[j] -= whole
        else:
            log_probabilities[j] = (log_probabilities[j] - greatest) - rest
    return whole


@inlined_kernel
def average(weights: Array, means: Array, a: int, period: float) -> float:
    """The mean of entry a by weights that sum to one, of angles around that of the largest."""
    total = 0.0
    if period == 0.0:
        for i in range(len(weights)):
            total += weights[i] * means[i, a]
        return total
    likely = 0
    for i in range(len(weights)):
        if weights[i] > weights[likely]:
            likely = i
    for i in range(len(weights)):
        total += weights[i] * shortest(means[i, a] - means[likely, a], period)
    return shortest(means[likely, a] + total, period)


# mu(i|j) = p_ij mu_i / c_j,   c_j = sum_i p_ij mu_i
# x0_j = sum_i mu(i|j) x_i,   P0_j = sum_i mu(i|j) (P_i + (x_i - x0_j) (x_i - x0_j)')
@inlined_kernel
def interact(transition: Array, mixing: bool, posteriors: Posteriors, work: BankWork) -> None:
    """Mix the filters' posteriors, and predict the modes (Gadsden et al. 2011, (9) and (10))."""
    weights, mixed = work.weights, work.mixed
    mixing_probabilities(transition, posteriors.log_probabilities, weights, mixed.log_probabilities)
    if not mixing:
        return
    r, n = posteriors.means.shape
    means, periods, apart = posteriors.means, work.of_filter.rules.state_periods, work.apart
    for j in range(r):
        for a in range(n):
            mixed.means[j, a] = average(weights[j], means, a, periods[a])
            for i in range(r):
                apart[i, a] = shortest(means[i, a] - mixed.means[j, a], periods[a])
        for a in range(n):
            for b in range(a + 1):
                total = 0.0
                for i in range(r):
                    spread = posteriors.covariances[i, a, b] + apart[i, a] * apart[i, b]
                    total += weights[j, i] * spread
                mixed.covariances[j, a, b] = mixed.covariances[j, b, a] = total


# x_j = A_j x0_j + B_j u,   P_j = A_j P0_j A_j' + Q_j
@inlined_kernel
def predict(
    model: ModelRows, k: int, controls: Array, posteriors: Posteriors, work: BankWork
) -> None:
    """Time update of all filters to row k, (11) and (12)."""
    A, B = model.A[min(k, len(model.A) - 1)], model.B[min(k, len(model.B) - 1)]
    Q, mixed = model.Q[min(k, len(model.Q) - 1)], work.mixed
    linear.assign(posteriors.log_probabilities, mixed.log_probabilities)
    for j in range(len(A)):
        linear.predict(
            A[j], B[j], Q[j], controls[min(j, len(controls) - 1)], mixed.means[j],
            mixed.covariances[j], posteriors.means[j], posteriors.covariances[j], work.of_filter,
        )  # fmt: skip


@inlined_kernel
def leave_out_outliers(
    bank: Bank, k: int, measurement: Array, controls: Array, posteriors: Posteriors,
    outliers: Array, work: BankWork,
) -> None:  # fmt: skip
    """Write to ``work.taken`` the measurements without those beyond the gates of all filters.

    If one filter alone left one out, its mode would gain by that. ``outliers`` become the least
    deviations of those that are left out.
    """
    C, D = bank.model.C[min(k, len(bank.model.C) - 1)], bank.model.D[min(k, len(bank.model.D) - 1)]
    R, inner = bank.model.R[min(k, len(bank.model.R) - 1)], work.of_filter
    for o in range(len(measurement)):
        outliers[o] = math.inf
    for j in range(len(C)):
        mean, P = posteriors.means[j], posteriors.covariances[j]
        control = controls[min(j, len(controls) - 1)]
        linear.output_error(C[j], D[j], measurement, control, mean, inner.scaled, inner)
        for o in range(len(measurement)):
            # S_oo = c P c' + R_oo
            variance = posteriors.noise[o] if inner.rules.forgetting > 0.0 else R[j, o, o]
            for a in range(len(mean)):
                for b in range(len(mean)):
                    variance += C[j, o, a] * P[a, b] * C[j, o, b]
            deviations = inner.scaled[o] / math.sqrt(variance)
            if not abs(deviations) >= abs(outliers[o]):
                outliers[o] = deviations
    for o in range(len(measurement)):
        beyond = abs(outliers[o]) > bank.gate
        work.taken[o] = math.nan if beyond else measurement[o]
        if not beyond:
            outliers[o] = 0.0


# e_j = y - C_j x_j - D_j u,   S_j = C_j P_j C_j' + R_j,   x_j += K_j e_j
# L_j = N(e_j; 0, S_j),   mu_j = L_j c_j / c,   c = sum_j L_j c_j
@inlined_kernel
def correct(
    bank: Bank,
    k: int,
    function: Callable[..., None] | None,
    measurement: Array,
    controls: Array,
    posteriors: Posteriors,
    innovations: Array,
    outliers: Array,
    work: BankWork,
) -> float:
    """Measurement update of all filters and of the modes, (13) to (21).

    Return the log-likelihood of the measurement, 0 if it is missing.
    """
    C, D = bank.model.C[min(k, len(bank.model.C) - 1)], bank.model.D[min(k, len(bank.model.D) - 1)]
    R, log_likelihoods = bank.model.R[min(k, len(bank.model.R) - 1)], work.log_likelihoods
    rules = work.of_filter.rules
    weight = max(rules.forgetting, 1.0 / (posteriors.begun[0] + k + BEGUN))
    if bank.gate < math.inf:
        leave_out_outliers(bank, k, measurement, controls, posteriors, outliers, work)
        measurement = work.taken
    missing = linear.is_missing(measurement)
    for j in range(len(C)):
        if missing:
            linear.fill(innovations[j], math.nan)
            log_likelihoods[j] = 0.0
        else:
            log_likelihoods[j] = linear.correct(
                C[j], D[j], R[j], posteriors.noise, weight, function, bank.parameters[j],
                measurement,
                controls[min(j, len(controls) - 1)], posteriors.means[j],
                posteriors.covariances[j], posteriors.errors[j], innovations[j], work.of_filter,
            )  # fmt: skip
            linear.assign(work.changes[j], work.of_filter.change)
    whole = update_probabilities(posteriors.log_probabilities, log_likelihoods)
    if missing:
        return 0.0
    if rules.forgetting > 0.0:
        # The change of R is the mean of those of the modes
        for o in range(len(measurement)):
            for j in range(len(C)):
                share = math.exp(posteriors.log_probabilities[j])
                posteriors.noise[o] += share * work.changes[j, o]
    return whole


# x = sum_j mu_j x_j,   P = sum_j mu_j (P_j + (x_j - x) (x_j - x)')
@inlined_kernel
def combine(posteriors: Posteriors, k: int, rows: BankRows, work: BankWork) -> bool:
    """Write the estimates of row k, and return whether they are finite.

    Gadsden et al. 2011, (22) and (23).
    """
    mean, covariance, probability = rows.state, rows.covariance, rows.probability
    periods = work.of_filter.rules.state_periods
    r, n = posteriors.means.shape
    whole = rows.log_likelihood[k]
    for j in range(r):
        probability[k, j] = math.exp(posteriors.log_probabilities[j])
        whole += probability[k, j]
    for a in range(n):
        mean[k, a] = average(probability[k], posteriors.means, a, periods[a])
        for j in range(r):
            work.apart[j, a] = shortest(posteriors.means[j, a] - mean[k, a], periods[a])
    for a in range(n):
        for b in range(a + 1):
            total = 0.0
            for j in range(r):
                spread = posteriors.covariances[j, a, b] + work.apart[j, a] * work.apart[j, b]
                total += probability[k, j] * spread
            covariance[k, a, b] = covariance[k, b, a] = total
        whole += mean[k, a] + covariance[k, a, a]
    return math.isfinite(whole)


@kernel
def run_bank(
    bank: Bank,
    function: Callable[..., None] | None,
    posteriors: Posteriors,
    measurements: Array,
    inputs: Array,
    fresh: bool,
    work: BankWork,
    rows: BankRows,
) -> int:
    """Filter a record: fill the rows, move the posteriors, and return the number of good rows.

    Gadsden et al. 2011, after (23).

    ``inputs``, (k + 1, 1 or r, p), has a row more than the record: the input of the row before,
    then that of each row; so have A, B and Q. ``fresh`` posteriors are meant at the first row,
    which then corrects them as they stand; else they are meant a period before.
    """
    due = FIRST
    for k in range(len(measurements)):
        if k >= due:
            due = poll(k)
        if k > 0 or not fresh:
            interact(bank.transition, bank.mixing, posteriors, work)
            predict(bank.model, k, inputs[k], posteriors, work)
        rows.log_likelihood[k] = correct(
            bank, k, function, measurements[k], inputs[k + 1], posteriors, rows.innovation[k],
            rows.outlier[min(k, len(rows.outlier) - 1)], work,
        )  # fmt: skip
        linear.assign(rows.noise_variance[min(k, len(rows.noise_variance) - 1)], posteriors.noise)
        if not combine(posteriors, k, rows, work):
            return k
    return len(measurements)
