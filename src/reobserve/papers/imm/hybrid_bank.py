"""A bank whose filters are half Kalman's and half another law's: which half makes a difference?

A gain acts on a bank in two ways: it moves the means, and with them the innovations; and by (17) it
makes the covariances, and with them the likelihoods. Here each filter has one mean, and covariances
by either gain; one of the gains moves the mean, and one of the covariances tells the likelihood.
With both of one kind it is the bank of that kind, bit for bit.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reobserve.core.direct_call import call
from reobserve.core.kernel import inlined_kernel, kernel
from reobserve.observers.imm import IMM, State
from reobserve.observers.imm_loop import (
    Bank,
    BankWork,
    Beliefs,
    interact,
    update_probabilities,
)
from reobserve.observers.linear_filter import LinearFilter
from reobserve.observers.linear_filter_loop import (
    Size,
    Work,
    assign,
    correct_covariance,
    foretell,
    kalman_gain,
    new_work,
    output_error,
    predict,
)
from reobserve.systems.linear import ModelArrays

Array = NDArray[np.float64]

KALMAN, LAW = 0, 1


@dataclass(frozen=True)
class HybridRun:
    """Mode probabilities, shape (k, r), innovations, (k, r, m), and each law's mean gain (r, n, m).

    There are as many rows as a bank has before it leaves the range of floating-point numbers.
    """

    probability: Array
    innovation: Array
    mean_gain: Array


def run_hybrid(
    bank: IMM,
    gain: int,
    covariance: int,
    state: State,
    measured: Array,
    inputs: Array,
    *,
    unsaturated: Array | None = None,
) -> HybridRun:
    """Filter a record with the bank's models, one of its gains and one of its covariances.

    Parameters
    ----------
    bank
        Linear filters with a law of their own, such as SVSFs.
    gain, covariance
        `KALMAN` or `LAW`: whose gain moves the means, and whose covariance tells likelihoods.
    state
        From the bank's ``init`` with an input: a sampling period before the first row.
    measured
        Rows, shape (k, m).
    inputs
        That of the row before, then that of each row, shape (k + 1, p).
    unsaturated
        Boundary layers, shape (m,), whose edge SVSFs are not to know: outside of it the gain goes
        on as within it.
    """
    filters = [one for one in bank.filters if isinstance(one, LinearFilter)]
    arrays = [one.model.arrays for one in filters]
    loop = Bank(
        ModelArrays(*(np.array(parts) for parts in zip(*arrays, strict=True))),
        np.array([one.gain_parameters for one in filters]),
        np.asarray(bank.transition),
        bank.mixing,
    )
    (n, m), r, k = (filters[0].model.states, filters[0].model.outputs), len(filters), len(measured)
    probability, innovation = np.empty((k, r)), np.empty((k, r, m))
    gains = np.zeros((r, n, m))
    edges = np.full(m, np.inf) if unsaturated is None else unsaturated
    good = _run(
        (0,) * n, (0,) * m, loop, filters[0].compiled_gain, gain, covariance, edges,
        state.means.copy(), np.array([state.covariances, state.covariances]),
        np.zeros((r, m)), state.log_probabilities.copy(), measured, inputs,
        probability, innovation, gains,
    )  # fmt: skip
    return HybridRun(probability[:good], innovation[:good], gains / max(good, 1))


@inlined_kernel
def _leave_saturation(gain: Array, innovation: Array, edges: Array) -> None:
    """Beyond an edge a saturated gain falls as 1 / |e|; this makes up for it."""
    for o in range(len(innovation)):
        for a in range(len(gain)):
            gain[a, o] *= max(1.0, abs(innovation[o]) / edges[o])


@kernel
def _half(
    states: Size,
    outputs: Size,
    model: ModelArrays,
    law: Callable[..., None],
    kind: int,
    parameters: Array,
    edges: Array,
    error: Array,
    covariance: Array,
    innovation: Array,
    factor: Array,
    work: Work,
) -> float:
    """Correct a covariance by one kind of gain, left in ``work``; return the log-likelihood."""
    found = foretell(states, outputs, model, covariance, innovation, factor, work)
    if kind == KALMAN:
        kalman_gain(outputs, factor, work)
    else:
        call(law, (work.cross, factor, innovation, error, parameters, work.gain))
        _leave_saturation(work.gain, innovation, edges)
    correct_covariance(states, outputs, model, covariance, work)
    return found


@inlined_kernel
def _keep(target: Array, source: Array) -> None:
    for a in range(len(source)):
        assign(target[a], source[a])


@inlined_kernel
def _sum_means_and_variances(means: Array, covariances: Array) -> float:
    total = 0.0
    for j in range(len(means)):
        for a in range(means.shape[1]):
            total += means[j, a] + covariances[KALMAN, j, a, a] + covariances[LAW, j, a, a]
    return total


@inlined_kernel
def _correct_mean(mean: Array, gain: Array, innovation: Array) -> None:
    for a in range(len(mean)):
        for o in range(len(innovation)):
            mean[a] += gain[a, o] * innovation[o]


@inlined_kernel
def _add(total: Array, gain: Array) -> None:
    for a in range(gain.shape[0]):
        for o in range(gain.shape[1]):
            total[a, o] += gain[a, o]


@kernel
def _run(
    states: Size,
    outputs: Size,
    bank: Bank,
    law: Callable[..., None],
    gain: int,
    told: int,
    edges: Array,
    means: Array,
    covariances: Array,
    errors: Array,
    log_probabilities: Array,
    measured: Array,
    inputs: Array,
    probability: Array,
    innovation: Array,
    gains: Array,
) -> int:
    """``covariances``, (2, r, n, n), are those by Kalman's gain and by the law's.

    Both predict the same mean, so that there is one innovation.
    """
    r, n, m = len(means), len(states), len(outputs)
    weights, predicted, likelihood = np.empty((r, r)), np.empty(r), np.empty(r)
    mixed, spread = np.empty((2, r, n)), np.empty((2, r, n, n))
    factor, chosen, work = np.empty((m, m)), np.empty((n, m)), new_work(n, m)
    for k in range(len(measured)):
        for kind in range(2):
            beliefs = Beliefs(means, covariances[kind], errors, log_probabilities)
            ahead = Beliefs(mixed[kind], spread[kind], errors, predicted)
            scratch = BankWork(weights, ahead, likelihood, factor, work)
            interact(states, bank.transition, bank.mixing, beliefs, scratch)
            if not bank.mixing:
                _keep(mixed[kind], means)
                for j in range(r):
                    _keep(spread[kind, j], covariances[kind, j])
        assign(log_probabilities, predicted)
        for j in range(r):
            model = ModelArrays(
                bank.model.A[j], bank.model.B[j], bank.model.C[j],
                bank.model.D[j], bank.model.Q[j], bank.model.R[j],
            )  # fmt: skip
            mean, error, e = means[j], errors[j], innovation[k, j]
            for kind in range(2):
                covariance = covariances[kind, j]
                predict(
                    states,
                    model,
                    inputs[k],
                    mixed[kind, j],
                    spread[kind, j],
                    mean,
                    covariance,
                    work,
                )
                output_error(states, model, measured[k], inputs[k + 1], mean, e)
                found = _half(
                    states, outputs, model, law, kind, bank.parameters[j], edges, error,
                    covariance, e, factor, work,
                )  # fmt: skip
                if kind == told:
                    likelihood[j] = found
                if kind == gain:
                    _keep(chosen, work.gain)
                if kind == LAW:
                    _add(gains[j], work.gain)
            _correct_mean(mean, chosen, e)
            output_error(states, model, measured[k], inputs[k + 1], mean, error)
        total = update_probabilities(log_probabilities, likelihood)
        for j in range(r):
            probability[k, j] = math.exp(log_probabilities[j])
        if not math.isfinite(total + _sum_means_and_variances(means, covariances)):
            return k
    return len(measured)
