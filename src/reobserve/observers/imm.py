"""Interacting multiple model (Blom & Bar-Shalom 1988; Gadsden et al. 2011, (7) to (23)).

A bank of filters, one for each mode that the plant may be in, and a Markov chain that says how the
plant moves between them. A step mixes the filters' posteriors (interaction), lets each take the
sample (prediction, correction), weighs the modes by how well each predicted it, and combines the
posteriors.

What is mixed are the filters' states as they stand. The filters must therefore mean the same by
their states, or at least nearly so: in other coordinates of each model the same bank gives other
probabilities. Position, velocity and acceleration can be mixed; the states of transfer functions
that were identified one by one have no common meaning but by the realisation that is chosen.
Without mixing the coordinates do not matter to Kalman filters. To the SVSF they do even then, if it
has fewer outputs than states: the pseudo-inverse of C depends on the units of the states.

Probabilities of modes are kept as logarithms. Where a sum of them is within the range of floats it
is formed as it stands, and else by log-sum-exp, so that a mode may become as unlikely as it likes
and still come back.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_flag
from reobserve.core.covariances import as_covariances
from reobserve.core.errors import DivergenceError, InputError, shown
from reobserve.core.interrupts import FIRST, poll
from reobserve.core.kernel import inlined_kernel, kernel
from reobserve.core.loop_function import RaisedAfterLoop
from reobserve.core.matrices import (
    as_floats,
    as_numbers,
    as_positive,
    as_probabilities,
    as_row_stochastic,
)
from reobserve.core.value import Value, for_loop
from reobserve.observers.contract import Observer, OnDivergence, Sample
from reobserve.observers.gaussian_filter import GaussianFilter, uneven_times
from reobserve.observers.gaussian_state import (
    Correction,
    Correlation,
    Gaussian,
    Matrices,
    ModeFilter,
    Rules,
    as_held,
    check_held,
    check_noise,
    check_sample,
    forgetting,
    inputs_of_rows,
    periods_of,
    refuse_given,
    sample_before,
    warn_of_start,
)
from reobserve.observers.kalman import (
    LINEAR,
    NEGATIVE_CAUSE,
    LinearWork,
    assign,
    correct,
    fill,
    is_missing,
    new_linear_work,
    output_error,
    predict_row,
    shortest,
    take_out,
    weight_of_row,
)
from reobserve.observers.one_row import OneRow, is_plain
from reobserve.observers.record import Record, Rows, check_state
from reobserve.observers.run import AxisNames, Estimate, Run, names_by_model
from reobserve.systems.linear import ModelArrays, ModelRows
from reobserve.systems.periods import wrapped

Array = NDArray[np.float64]

LEAST = 1e-280  # a sum of probabilities above this has all its digits
FAR = -1000.0  # a logarithm below this loses digits of the logarithm of a sum that is added to it


@dataclass(frozen=True, eq=False, repr=False)
class ImmState(Value):
    """All the bank remembers: what each filter believes, and the logarithms of mu, shape (r,).

    Means (r, n), covariances (r, n, n) and a posteriori output errors (r, m) of all filters stand
    one behind the other, as the compiled loop takes them. ``sample`` and ``count`` are as in
    `reobserve.observers.record.ObserverState`; y may be nan. ``held`` is what was given by row
    and leads from that sample to the next, of each filter; ``time`` is that of the sample [s], or
    None where it is counted; ``noise`` are the variances of R, (m,), where they are estimated, and
    ``past`` are the inputs of rows before, where these have a delay.
    """

    means: Array
    covariances: Array
    errors: Array
    log_probabilities: Array
    sample: Array | None = None
    count: int = 0
    held: tuple[Matrices, ...] | None = None
    time: float | None = None
    noise: Array | None = None
    past: Array | None = None

    @property
    def posteriors(self) -> tuple[Gaussian, ...]:
        """The posterior of each filter."""
        parts = zip(self.means, self.covariances, self.errors, strict=True)
        return tuple(Gaussian(*part) for part in parts)


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


class Bank(NamedTuple):
    """Matrices of all filters by row, (., r, ...), their parameters, p_ij, and the bank's gate."""

    model: ModelRows
    parameters: Array
    transition: Array
    mixing: bool
    gate: float = math.inf


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
    of_filter: LinearWork


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
        new_linear_work(n, m, rules),
    )  # fmt: skip


def new_bank_rows(
    k: int, r: int, n: int, m: int, gated: bool = False, learned: bool = False
) -> BankRows:
    """Arrays for the estimates of k rows, by r filters of n states and m outputs."""
    shapes = (k, n), (k, n, n), (k, r), (k, r, m), (k,), (k if gated else 1, m)
    return BankRows(*map(np.empty, (*shapes, (k if learned else 1, m))))


@inlined_kernel
def mixing_probabilities(
    transition: Array, log_probabilities: Array, weights: Array, predicted: Array
) -> None:
    """Write mu(i|j) to ``weights[j, i]`` and log c_j to ``predicted``.

    Gadsden et al. 2011, (7) and (8). A mode that cannot be reached keeps to itself.
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
def average(weights: Array, means: Array, a: int, period: float) -> float:
    """The mean of entry a by weights that sum to one, of angles around that of the largest."""
    total = 0.0
    # x = sum_i w_i x_i
    if period == 0.0:
        for i in range(len(weights)):
            total += weights[i] * means[i, a]
        return total
    # x = x_l + sum_i w_i (x_i - x_l), where w_l is the largest weight
    likely = 0
    for i in range(len(weights)):
        if weights[i] > weights[likely]:
            likely = i
    for i in range(len(weights)):
        total += weights[i] * shortest(means[i, a] - means[likely, a], period)
    return shortest(means[likely, a] + total, period)


@inlined_kernel
def mix(
    weights: Array, posteriors: Posteriors, mean: Array, covariance: Array, work: BankWork
) -> None:
    """Write the mean and the covariance of the filters' posteriors with these weights."""
    r, n = posteriors.means.shape
    periods, apart = work.of_filter.rules.state_periods, work.apart
    # x = sum_i w_i x_i
    for a in range(n):
        mean[a] = average(weights, posteriors.means, a, periods[a])
        for i in range(r):
            apart[i, a] = shortest(posteriors.means[i, a] - mean[a], periods[a])
    # P = sum_i w_i (P_i + (x_i - x) (x_i - x)')
    for a in range(n):
        for b in range(a + 1):
            total = 0.0
            for i in range(r):
                spread = posteriors.covariances[i, a, b] + apart[i, a] * apart[i, b]
                total += weights[i] * spread
            covariance[a, b] = covariance[b, a] = total


@inlined_kernel
def interact(transition: Array, mixing: bool, posteriors: Posteriors, work: BankWork) -> None:
    """Mix the filters' posteriors, and predict the modes (Gadsden et al. 2011, (9) and (10))."""
    weights, mixed = work.weights, work.mixed
    mixing_probabilities(transition, posteriors.log_probabilities, weights, mixed.log_probabilities)
    if not mixing:
        return
    # x0_j = sum_i mu(i|j) x_i,   P0_j = sum_i mu(i|j) (P_i + (x_i - x0_j) (x_i - x0_j)')
    for j in range(len(weights)):
        mix(weights[j], posteriors, mixed.means[j], mixed.covariances[j], work)


@inlined_kernel
def predict_modes(
    model: ModelRows, correlation: Correlation | None, k: int, controls: Array,
    posteriors: Posteriors, work: BankWork,
) -> None:  # fmt: skip
    """Time update of all filters to row k, (11) and (12)."""
    A, B = model.A[min(k, len(model.A) - 1)], model.B[min(k, len(model.B) - 1)]
    Q, mixed = model.Q[min(k, len(model.Q) - 1)], work.mixed
    # mu_j = c_j,   x_j = A_j x0_j + B_j u,   P_j = A_j P0_j A_j' + Q_j
    assign(posteriors.log_probabilities, mixed.log_probabilities)
    for j in range(len(A)):
        predict_row(
            A[j], B[j], Q[j], correlation, k, j, controls[min(j, len(controls) - 1)],
            posteriors.means[j], mixed.means[j], mixed.covariances[j], posteriors.means[j],
            posteriors.covariances[j], work.of_filter,
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
        output_error(C[j], D[j], measurement, control, mean, inner.scaled, inner)
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


@inlined_kernel
def update_probabilities(log_probabilities: Array, log_likelihoods: Array) -> float:
    """Weigh predicted modes by their likelihoods, and return the logarithm of c.

    Gadsden et al. 2011, (20) and (21); log c is the measurement's log-likelihood over all modes.
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
def correct_modes(
    bank: Bank, correlation: Correlation | None, k: int, function: Callable[..., None] | None,
    measurement: Array, controls: Array, posteriors: Posteriors, innovations: Array,
    outliers: Array, work: BankWork,
) -> float:  # fmt: skip
    """Measurement update of all filters and of the modes, (13) to (21).

    Return the log-likelihood of the measurement, 0 if it is missing.
    """
    C, D = bank.model.C[min(k, len(bank.model.C) - 1)], bank.model.D[min(k, len(bank.model.D) - 1)]
    R, log_likelihoods = bank.model.R[min(k, len(bank.model.R) - 1)], work.log_likelihoods
    rules = work.of_filter.rules
    weight = weight_of_row(posteriors.begun[0] + k, rules.forgetting)
    if bank.gate < math.inf:
        leave_out_outliers(bank, k, measurement, controls, posteriors, outliers, work)
        measurement = work.taken
    missing = is_missing(measurement)
    # e_j = y - C_j x_j - D_j u,   S_j = C_j P_j C_j' + R_j,   L_j = N(e_j; 0, S_j)
    # x_j = x_j + K_j e_j,   P_j = (I - K_j C_j) P_j (I - K_j C_j)' + K_j R_j K_j'
    for j in range(len(C)):
        if missing:
            fill(innovations[j], math.nan)
            log_likelihoods[j] = 0.0
        else:
            log_likelihoods[j] = correct(
                C[j], D[j], R[j], posteriors.noise, weight, function, bank.parameters[j],
                measurement, controls[min(j, len(controls) - 1)], posteriors.means[j],
                posteriors.covariances[j], posteriors.errors[j], innovations[j], work.of_filter,
            )  # fmt: skip
            assign(work.changes[j], work.of_filter.change)
        if correlation is not None and len(correlation.S) > 0:
            take_out(
                correlation, k, j, C[j], R[j], posteriors.noise, innovations[j],
                posteriors.errors[j], work.of_filter,
            )  # fmt: skip
    # mu_j = L_j c_j / c,   c = sum_j L_j c_j
    whole = update_probabilities(posteriors.log_probabilities, log_likelihoods)
    if missing:
        return 0.0
    if rules.forgetting > 0.0:
        # R = R + sum_j mu_j change_j
        for o in range(len(measurement)):
            for j in range(len(C)):
                share = math.exp(posteriors.log_probabilities[j])
                posteriors.noise[o] += share * work.changes[j, o]
    return whole


@inlined_kernel
def combine(posteriors: Posteriors, k: int, rows: BankRows, work: BankWork) -> bool:
    """Write the estimates of row k, and return whether they are finite.

    Gadsden et al. 2011, (22) and (23).
    """
    mean, covariance, probability = rows.state[k], rows.covariance[k], rows.probability[k]
    whole = rows.log_likelihood[k]
    for j in range(len(probability)):
        probability[j] = math.exp(posteriors.log_probabilities[j])
        whole += probability[j]
    # x = sum_j mu_j x_j,   P = sum_j mu_j (P_j + (x_j - x) (x_j - x)')
    mix(probability, posteriors, mean, covariance, work)
    for a in range(len(mean)):
        whole += mean[a] + covariance[a, a]
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

    Gadsden et al. 2011, after (23). ``inputs``, (k + 1, 1 or r, p), has a row more than the record:
    the input of the row before, then that of each row; so have A, B and Q. ``fresh`` posteriors are
    meant at the first row, which then corrects them as they stand; else they are meant a period
    before.
    """
    due = FIRST
    for k in range(len(measurements)):
        if k >= due:
            due = poll(k)
        if k > 0 or not fresh:
            # mu(i|j), x0_j, P0_j, then x_j(k|k-1), P_j(k|k-1)
            interact(bank.transition, bank.mixing, posteriors, work)
            predict_modes(bank.model, bank.model.correlation, k, inputs[k], posteriors, work)
        # x_j(k|k), P_j(k|k), mu_j, then x(k|k), P(k|k)
        rows.log_likelihood[k] = correct_modes(
            bank, bank.model.correlation, k, function, measurements[k], inputs[k + 1], posteriors,
            rows.innovation[k], rows.outlier[min(k, len(rows.outlier) - 1)], work,
        )  # fmt: skip
        assign(rows.noise_variance[min(k, len(rows.noise_variance) - 1)], posteriors.noise)
        if not combine(posteriors, k, rows, work):
            return k
    return len(measurements)


@dataclass(frozen=True, eq=False, repr=False)
class IMM(Observer[ImmState]):
    """Bank of filters and a Markov chain of modes (Gadsden et al. 2011, after (23)).

        mu(i|j) = p_ij mu_i / c_j,    c_j = sum_i p_ij mu_i        by which filters are mixed
        mu_j proportional to L_j c_j,    L_j the likelihood of the measurement in mode j
        x = sum_j mu_j x_j,    P = sum_j mu_j (P_j + (x_j - x) (x_j - x)')

    `init` takes mean, covariance and probabilities. `run` and `step` take y, shape (k, m), nan
    where missing, and u, (k, p); of a bank of filters on linear models, by name, also A, B, C, D,
    Q, R and S, as `KalmanFilter.run` has them, for all modes, or (k, r, ., .), one for each mode.
    Estimates, in units of the models: ``state``, x, shape (k, n), ``covariance``, P, (k, n, n), and
    its diagonal ``variance``, (k, n); ``probability``, mu, (k, r); ``innovation``, (k, r, m), of
    each filter, nan where missing; and ``log_likelihood``, (k,), of the measurement over all modes,
    zero where missing.

    Parameters
    ----------
    filters
        One a mode. Kalman filters and SVSFs of one kind run as one compiled loop; other filters,
        of a user's own, need `ModeFilter`'s two methods and are called one by one.
    transition
        p_ij, shape (r, r): the probability that mode i is followed by mode j in the next row,
        however far that is. Rows sum to one.
    mixing
        Whether posteriors interact, (9) and (10). Without, each filter goes its own way and only
        the probabilities of the modes follow the chain.
    gate
        As `KalmanFilter` has it, for the bank: an output is left out if all filters would leave it
        out, as ``outlier``, (k, m), says.
    noise_memory
        As `KalmanFilter` has it, for a bank of Kalman filters whose R is the same: what a row says
        of R is the mean over the modes by their probabilities.

    Raises
    ------
    InputError
        If there is no filter, two differ in their numbers of states, inputs or outputs or in their
        sampling periods or in the periods of angles, one has a gate or a memory of its own, or the
        transition has a negative entry or a row that does not sum to one.

    Examples
    --------
    >>> from reobserve import IMM, KalmanFilter, LinearModel
    >>> models = [LinearModel([[a]], C=[[1]], Q=1e-4, R=1e-2) for a in (0.9, 0.5)]
    >>> bank = IMM([KalmanFilter(one) for one in models], [[0.99, 0.01], [0.01, 0.99]])
    >>> run = bank.run([1.0, 0.9, 0.8, 0.4, 0.2, 0.1], start=bank.init([1.0], 0.1))
    >>> print(run["probability"][[2, 5]].round(2))
    [[1.   0.  ]
     [0.01 0.99]]
    """

    filters: tuple[ModeFilter, ...]
    transition: Array
    mixing: bool = field(default=True, kw_only=True)
    sampling_period: float = field(init=False)
    gate: float | None = field(default=None, kw_only=True)
    noise_memory: float | None = field(default=None, kw_only=True)

    reads_missing: ClassVar[bool] = True
    takes: ClassVar[tuple[str, ...]] = (*ModelArrays._fields, "S")
    units: ClassVar[Mapping[str, str]] = {
        "state": "", "variance": "", "covariance": "", "probability": "1", "innovation": "",
        "log_likelihood": "",
    }  # fmt: skip

    if TYPE_CHECKING:  # what it takes is wider than what it then holds

        def __init__(
            self, filters: Sequence[ModeFilter], transition: ArrayLike, *, mixing: bool = ...,
            gate: float | None = ..., noise_memory: float | None = ...,
        ) -> None: ...  # fmt: skip

    def __post_init__(self) -> None:
        filters: Any = self.filters
        check_filters(filters)
        self._set("filters", tuple(filters))
        self._set("transition", as_row_stochastic("transition", self.transition, len(filters)))
        self._set("mixing", as_flag("mixing", self.mixing))
        self._set("sampling_period", filters[0].model.sampling_period)
        for name in ("gate", "noise_memory"):
            value = getattr(self, name)
            self._set(name, None if value is None else as_positive(name, value))
        if self.noise_memory is not None:
            self._check_noise_memory()

    def _check_noise_memory(self) -> None:
        """Refuse to estimate R where not one of the filters can see it, or there is no one R."""
        if not self._linear or any(not each.has_kalman_gain for each in self._linear):
            problem = "must be left out: it is for banks of Kalman filters on linear models"
            raise InputError("noise_memory", problem)
        first = self._linear[0].model.R
        for j, mode in enumerate(self._linear):
            if not np.array_equal(mode.model.R, first):
                raise InputError("noise_memory", f"must be left out: filters[{j}] has another R")
        refused: InputError | None = None
        for mode in self._linear:
            try:
                replace(mode, noise_memory=self.noise_memory)
            except InputError as error:
                refused = refused or error
            else:
                return
        assert refused is not None
        raise refused

    def step(
        self, start: ImmState, y: Sample, u: Sample | None = None, *,
        time: float | None = None, A: ArrayLike | None = None, B: ArrayLike | None = None,
        C: ArrayLike | None = None, D: ArrayLike | None = None, Q: ArrayLike | None = None,
        R: ArrayLike | None = None, S: ArrayLike | None = None,
    ) -> tuple[ImmState, Estimate]:  # fmt: skip
        """Take one row: the start of the next one, and the estimates at it.

        Stepping through a record gives bitwise what `run` gives.

        Parameters
        ----------
        start
            From `init`, or from the row before.
        y, u, time, A, B, C, D, Q, R, S
            As those of `run`, without the axis of rows. Of y and u also numbers by name, of
            which measurements may be left out.

        Raises
        ------
        InputError
            As `run`.
        DivergenceError
            As `run`.
        """
        given = {"A": A, "B": B, "C": C, "D": D, "Q": Q, "R": R, "S": S}
        return self._step_given(start, y, u, time, given)

    def run(
        self, y: ArrayLike, u: ArrayLike | None = None, *, start: ImmState | None = None,
        time: ArrayLike | None = None, A: ArrayLike | None = None, B: ArrayLike | None = None,
        C: ArrayLike | None = None, D: ArrayLike | None = None, Q: ArrayLike | None = None,
        R: ArrayLike | None = None, S: ArrayLike | None = None,
        on_divergence: OnDivergence = "raise",
    ) -> Run[ImmState]:  # fmt: skip
        """Estimates at all rows of a record, by one compiled loop.

        Parameters
        ----------
        y, u
            Measurements, shape (k, m), nan where missing, and known inputs, (k, p), from each row
            on; (k,) where m or p is 1, u left out where p is 0. Frames with the names of the
            model's signals, and many records, (records, k, m).
        start
            From `init`, or from an earlier run or step to go on with the row after its last.
        time
            Of the rows [s], shape (k,), or dates; left out, a sampling period apart. Of filters on
            linear models from `from_ode` with a density of the noise any that rise; of other banks,
            `FaultBank` and `GridFilter`, and with a ``noise_memory`` a sampling period apart.
        A, B, C, D, Q, R, S
            Of a bank of filters on linear models, as `KalmanFilter.run` has them, for all modes;
            or one for each row and mode, (k, r, ., .). `FaultBank` and `GridFilter` take R alone.
        on_divergence
            ``raise``, or ``return`` what there was up to then, with `Run.diverged_at`.

        Raises
        ------
        InputError
            If a shape is wrong, a number is not finite, times do not fit, or the start is of
            another filter.
        DivergenceError
            If an estimate leaves the range of floating-point numbers, or rounding makes a variance
            negative; it says, where it is known, what would have helped.

        Examples
        --------
        >>> from reobserve import IMM, KalmanFilter, LinearModel
        >>> models = [LinearModel([[a]], C=[[1]], Q=1e-4, R=1e-2) for a in (0.9, 0.5)]
        >>> bank = IMM([KalmanFilter(one) for one in models], [[0.99, 0.01], [0.01, 0.99]])
        >>> run = bank.run([1.0, 0.9, 0.4], start=bank.init([1.0], 0.1), R=1e-4)
        >>> print(run["probability"][-1].round(2))
        [0. 1.]
        """
        given = {"A": A, "B": B, "C": C, "D": D, "Q": Q, "R": R, "S": S}
        return self._run_given(y, u, start, time, on_divergence, given)

    @cached_property
    def _sizes(self) -> tuple[int, int, int, int]:
        """The numbers of filters, states, inputs of a filter, and outputs."""
        return len(self.filters), *size_of(self.filters[0])

    @cached_property
    def _mark(self) -> tuple[int, ...] | None:
        """The sizes of states that need no check, None where a user's filters may make any."""
        r, n, _, m = self._sizes
        return (r, n, self.inputs, m) if self._linear else None

    @cached_property
    def _periods(self) -> Mapping[str, Array]:
        periods = self._rules.state_periods
        return {"state": periods} if periods.any() else {}

    @cached_property
    def _rules(self) -> Rules:
        """The settings of the filters beside their models, without the bank's gate."""
        weight = forgetting(self.noise_memory, self.sampling_period)
        return Rules(*periods_of(self.filters[0]), np.inf, False, weight)

    @cached_property
    def measurements(self) -> int:
        """The number of measurements in a row of y."""
        return self._sizes[3]

    @cached_property
    def inputs(self) -> int:
        """The number of known inputs in a row of u."""
        return self._sizes[2]

    @cached_property
    def component_names(self) -> Mapping[str, AxisNames]:
        """Names of components of estimates, by the model of the first filter."""
        first = self.filters[0]
        names = names_by_model(getattr(first, "whole", first.model))
        if "innovation" in names:
            names["innovation"] = (None, *names["innovation"])
        return names

    def init(
        self,
        mean: ArrayLike,
        covariance: ArrayLike,
        *,
        probabilities: ArrayLike | None = None,
        u: ArrayLike | None = None,
    ) -> ImmState:
        """The state before the first row of a record.

        Parameters
        ----------
        mean
            Shape (n,) for all filters, or (r, n).
        covariance
            A number, n numbers or (n, n) for all filters, or (r, n, n).
        probabilities
            mu, shape (r,), all the same if left out.
        u
            Left out, all these are meant at the first row, whose measurement corrects them. Given,
            they are meant a sampling period before it, and u, shape (p,), is the input that is
            held up to it: the bank then mixes and predicts first.

        Raises
        ------
        InputError
            If one of them is not that, or the probabilities do not sum to one.
        """
        (r, n, _, m), periods = self._sizes, self._rules.state_periods
        means = as_floats("mean", mean)
        if means.shape not in ((n,), (r, n)):
            raise InputError("mean", f"has shape {means.shape}, must be ({n},) or ({r}, {n})")
        means = np.broadcast_to(means, (r, n))
        means = wrapped(means, periods) if periods.any() else means.copy()
        covariances = as_covariances("covariance", covariance, n, r)
        covariances = np.broadcast_to(covariances, (r, n, n)).copy()
        chosen = np.full(r, 1.0 / r) if probabilities is None else probabilities
        with np.errstate(divide="ignore"):
            logarithms = np.log(as_probabilities("probabilities", chosen, r))
        sample, noise = None if u is None else sample_before(u, m, self.inputs), None
        if self.noise_memory is not None:
            noise = np.diag(self._linear[0].model.R).copy()
        return self._state(means, covariances, np.zeros((r, m)), logarithms, sample, noise=noise)

    def _state(
        self, means: Array, covariances: Array, errors: Array, log_probabilities: Array,
        sample: Array | None, count: int = 0, held: tuple[Matrices, ...] | None = None,
        time: float | None = None, noise: Array | None = None, past: Array | None = None,
    ) -> ImmState:  # fmt: skip
        """A state that needs no check by a bank of this kind."""
        return ImmState._made(
            means=means, covariances=covariances, errors=errors,
            log_probabilities=log_probabilities, sample=sample, count=count, held=held, time=time,
            noise=noise, past=past, checked=self._mark,
        )  # fmt: skip

    def _checked(self, state: Any) -> ImmState:
        (r, n, _, m), inputs = self._sizes, self.inputs
        mark = self._mark if type(state) is ImmState else None
        checked = mark is not None and vars(state).get("checked") == mark
        if checked and state.held is None and (state.noise is None) is (self.noise_memory is None):
            return state  # type: ignore[no-any-return]
        shapes = [np.shape(getattr(state, part, ())) for part in ("means", "covariances", "errors")]
        given = check_state(
            state, ImmState,
            f"has arrays of shapes {', '.join(map(str, shapes))}, must be of {r} filters of {n} "
            f"states and {m} outputs",
            means=(r, n), covariances=(r, n, n), errors=(r, m),
        )  # fmt: skip
        logarithms = as_numbers("start.log_probabilities", given.log_probabilities, writable=False)
        if logarithms.shape != (r,) or np.isnan(logarithms).any() or logarithms.max() == -np.inf:
            raise InputError("start.log_probabilities", f"must be {r} logarithms of probabilities")
        sample = check_sample(given.sample, m, inputs)
        held: Any = given.held
        if held is not None:
            modes = self._linear
            if type(held) is not tuple or len(held) != len(modes):
                raise InputError("start.held", f"{shown(held)} must be of {len(modes)} filters")
            held = tuple(
                check_held(matrices, mode, f"start.held[{j}]") or {}
                for j, (matrices, mode) in enumerate(zip(held, modes, strict=True))
            )
        noise = check_noise(given.noise, self.noise_memory is not None, m)
        same = logarithms is given.log_probabilities and sample is given.sample
        if same and noise is given.noise and held is None:
            return given
        return replace(given, log_probabilities=logarithms, sample=sample, held=held, noise=noise)

    def _uneven(
        self, time: ArrayLike | None, state: ImmState, record: Record
    ) -> tuple[Array, Record] | None:
        able = (
            self._linear
            and self.noise_memory is None
            and all(mode.model.density is not None or "Q" in record.given for mode in self._linear)
        )
        return uneven_times(self.filters[0].model, time, state, record) if able else None

    @property
    def _uneven_hint(self) -> str:
        return "; for other times a bank needs linear models with a density"

    def _fill(self, state: ImmState, record: Record) -> Rows:
        (r, n, _, m), k = self._sizes, len(record.y)
        posteriors = Posteriors(
            state.means.copy(), state.covariances.copy(), state.errors.copy(),
            state.log_probabilities.copy(),
            np.ones(m) if state.noise is None else state.noise.copy(),
            np.array([float(state.count + (state.sample is not None))]),
        )  # fmt: skip
        (inputs, past), fresh = self._inputs(state, record), state.sample is None
        gated, learned = self.gate is not None, self.noise_memory is not None
        rows, held, last = new_bank_rows(k, r, n, m, gated, learned), None, None
        if record.given:
            refuse_given(self, record.given)
        why = ""
        if not self._linear:
            if record.given:
                problem = "is taken by banks of filters of one kind on linear models alone"
                raise InputError(next(iter(record.given)), problem)
            good, why = run_one_by_one(self, posteriors, record.y, inputs[:, 0], fresh, rows)
        else:
            model = self._model
            if record.given or state.held is not None or record.periods is not None:
                model, last = self._in_record(state, record, inputs)
            with RaisedAfterLoop():
                good = run_bank(
                    Bank(
                        model, self._parameters, self._chance,
                        self.mixing, np.inf if self.gate is None else self.gate,
                    ),
                    self._gain, posteriors, record.y, inputs, fresh,
                    new_bank_work(posteriors, self.mixing, self._rules), rows,
                )  # fmt: skip
        variance = rows.covariance.diagonal(axis1=1, axis2=2)
        if state.count <= n and n * m > 1:
            start = state.covariances.diagonal(0, 1, 2).max(axis=0)
            warn_of_start(start, variance[: min(good, n + 1)])
        if last is not None:
            held = tuple(as_held(each, model.correlation, j) or {} for j, each in enumerate(last))
            held = held if any(held) else None
        reached = self._state(
            *posteriors[:4], np.concatenate([record.y[-1], record.u[-1]]),
            state.count + k - fresh, held,
            None if record.time is None else float(record.time[-1]),
            posteriors.noise if learned else None, past,
        )  # fmt: skip
        if good < k and (posteriors.covariances.diagonal(0, 1, 2) < 0).any():
            why = NEGATIVE_CAUSE
        return Rows(self._by_name(rows), good, reached, finding=why)

    def _by_name(self, rows: BankRows) -> dict[str, Array]:
        """The estimates by their names."""
        variance = rows.covariance.diagonal(axis1=1, axis2=2)
        estimates = {"state": rows.state, "variance": variance, **rows._asdict()}
        if self.gate is None:
            del estimates["outlier"]
        if self.noise_memory is None:
            del estimates["noise_variance"]
        return estimates

    def _quick_step(self, state: ImmState, y: Any, u: Any) -> tuple[ImmState, Estimate] | None:
        (_, n, _, m), p, learned = self._sizes, self.inputs, self.noise_memory is not None
        if (
            not self._plain or type(state) is not ImmState
            or vars(state).get("checked") != self._mark
            or state.held is not None or state.sample is None or state.count <= n
            or (state.noise is not None) is not learned or not is_plain(y, u, m, p)
        ):  # fmt: skip
            return None
        try:
            row = self._spare_rows.pop()
        except IndexError:
            row = self._new_row()
        after, rows = row.posterior, row.rows
        after.means[...], after.covariances[...] = state.means, state.covariances
        after.errors[...], after.log_probabilities[...] = state.errors, state.log_probabilities
        if learned:
            after.noise[...], after.begun[0] = state.noise, state.count + 1
        row.y[0], row.inputs[0, :p] = y, state.sample[m:]
        row.inputs[1, :p] = () if u is None else u
        if not row.run():
            return None  # the way of all records says why
        values = {"state": rows.state[0].copy(), "variance": rows.covariance[0].diagonal().copy()}
        for name, array in rows._asdict().items():
            values[name] = array[0].copy()
        if self.gate is None:
            del values["outlier"]
        if not learned:
            del values["noise_variance"]
        known, units = self.units, {}
        for name in values:
            units[name] = known.get(name, "")
        count, T = state.count + 1, self.sampling_period
        time = None if state.time is None else state.time + T
        reached = self._state(
            after.means.copy(), after.covariances.copy(), after.errors.copy(),
            after.log_probabilities.copy(), np.concatenate([y, u]) if p else y.copy(), count,
            None, time, after.noise.copy() if learned else None,
        )  # fmt: skip
        self._spare_rows.append(row)
        return reached, Estimate(count * T if time is None else time, values, units)

    @cached_property
    def _plain(self) -> bool:
        """True for a bank of this class on linear models, whose rows need nothing but y and u."""
        return type(self) is IMM and bool(self._linear)

    @cached_property
    def _spare_rows(self) -> list[OneRow]:
        """Rows that no thread uses at the moment."""
        return []

    def _new_row(self) -> OneRow:
        (r, n, _, m), p = self._sizes, self.inputs
        after = Posteriors(
            np.zeros((r, n)), np.zeros((r, n, n)), np.zeros((r, m)), np.zeros(r), np.ones(m),
            np.zeros(1),
        )  # fmt: skip
        y, inputs, rows = np.zeros((1, m)), np.zeros((2, 1, p)), new_bank_rows(1, r, n, m)
        gate = np.inf if self.gate is None else self.gate
        bank = Bank(self._model, self._parameters, self._chance, self.mixing, gate)
        work = new_bank_work(after, self.mixing, self._rules)
        arguments = bank, self._gain, after, y, inputs, False, work, rows
        return OneRow(run_bank, arguments, after, rows, y, inputs[:, 0])

    def _inputs(self, state: ImmState, record: Record) -> tuple[Array, Array | None]:
        """The input of the row before a record, then of each row, (k + 1, 1 or r, p), and past."""
        return inputs_of_rows(state.sample, record)[:, None], None

    def _in_record(
        self, state: ImmState, record: Record, inputs: Array
    ) -> tuple[ModelRows, list[Matrices]]:
        """The models of all modes by row, (., r, ...), and what leads on from the record."""
        rows, k = [], len(record.y)
        for j, kf in enumerate(self._linear):
            given = {name: self._of_mode(name, value, j, k) for name, value in record.given.items()}
            for name in given:
                if name not in kf.takes:
                    problem = f"is not taken by {type(kf).__name__}, which is a filter of the bank"
                    raise InputError(name, problem)
            refuse_given(kf, given)
            before = {} if state.held is None else state.held[j] or {}
            rows.append(kf.steps.in_record(kf, given, record.y, inputs, before, record.periods))
        parts = zip(*(row.model[:6] for row in rows), strict=True)
        model = ModelRows(*(np.stack(np.broadcast_arrays(*every), axis=1) for every in parts))
        correlations = [row.model.correlation for row in rows]
        if correlations[0] is not None:
            parts = zip(*correlations, strict=True)
            whole = (np.concatenate(np.broadcast_arrays(*every), axis=1) for every in parts)
            model = model._replace(correlation=Correlation(*whole))
        return model, [row.last for row in rows]

    def _of_mode(self, name: str, value: Any, mode: int, rows: int) -> Any:
        """The values given for one mode: for all of them, or (k, r, ., .), of a step (r, ., .)."""
        matrices = as_floats(name, value)
        if matrices.ndim == 3 and rows == 1 and len(matrices) == len(self.filters):
            return matrices[mode]
        if matrices.ndim < 4:
            return matrices
        if matrices.shape[1] != len(self.filters):
            problem = f"has shape {matrices.shape}, must be (k, {len(self.filters)}, ., .)"
            raise InputError(name, problem)
        return matrices[:, mode] if len(matrices) > 1 else matrices[0, mode]

    @cached_property
    def _linear(self) -> list[GaussianFilter]:
        """The filters, if one loop can run them all: one gain function, as many parameters."""
        linear = [
            kf
            for kf in self.filters
            if isinstance(kf, GaussianFilter) and kf.steps is LINEAR and kf.whole is kf.model
        ]
        alike = {(kf.method.function, len(kf.method.parameters)) for kf in linear}
        return linear if len(linear) == len(self.filters) and len(alike) == 1 else []

    @cached_property
    def _chance(self) -> Array:
        """The transition as the loop takes it."""
        return for_loop(self.transition)

    @cached_property
    def _gain(self) -> Any:
        """The gain function of the filters."""
        return self._linear[0].method.function

    @cached_property
    def _model(self) -> ModelRows:
        """The matrices of all modes, (1, r, ...)."""
        arrays = zip(*(mode.model.arrays for mode in self._linear), strict=True)
        return ModelRows(*(np.array([matrices]) for matrices in arrays))

    @cached_property
    def _parameters(self) -> Array:
        """Parameters of the gain of each filter, (r, .)."""
        return np.array([mode.method.parameters for mode in self._linear])


def check_filters(filters: Any) -> None:
    """Refuse what is no list of filters that a bank can mix.

    Raises
    ------
    InputError
        With the filter that differs from the first.
    """
    if not isinstance(filters, list | tuple) or not filters:
        raise InputError("filters", f"{shown(filters)} must be a list of one filter or more")
    for j, mode in enumerate(filters):
        wanted = ("predict", "correct", "model")
        if isinstance(mode, type) or not all(hasattr(mode, part) for part in wanted):
            problem = f"{shown(mode)} must have a model, predict and correct"
            raise InputError(f"filters[{j}]", problem)
        size, first = size_of(mode), size_of(filters[0])
        if size != first:
            problem = f"has {size} states, inputs and outputs, the first filter {first}"
            raise InputError(f"filters[{j}]", problem)
        period, first_period = mode.model.sampling_period, filters[0].model.sampling_period
        if period != first_period:
            problem = f"has a sampling period of {period:g} s, the first {first_period:g} s"
            raise InputError(f"filters[{j}]", problem)
        for name in ("gate", "noise_memory"):
            if getattr(mode, name, None) is not None:
                problem = f"has {name} of its own: the bank takes it, for all filters"
                raise InputError(f"filters[{j}]", problem)
        if not all(map(np.array_equal, periods_of(mode), periods_of(filters[0]))):
            problem = "has other periods of angles than the first filter"
            raise InputError(f"filters[{j}]", problem)


def size_of(mode: ModeFilter) -> tuple[int, int, int]:
    """The numbers of states, inputs and outputs of a filter."""
    model = getattr(mode, "whole", mode.model)
    return model.states, model.inputs, model.outputs


def run_one_by_one(
    bank: IMM,
    posteriors: Posteriors,
    measurements: Array,
    inputs: Array,
    fresh: bool,
    rows: BankRows,
) -> tuple[int, str]:
    """Fill the rows as `run_bank` does, and return the number of good ones and why it stopped."""
    transition = for_loop(bank.transition)
    work, gated = new_bank_work(posteriors, bank.mixing, bank._rules), bank.gate is not None
    for k, y in enumerate(measurements):
        moves = k > 0 or not fresh
        if moves:
            interact(transition, bank.mixing, posteriors, work)
            posteriors.log_probabilities[:] = work.mixed.log_probabilities
        parts = (work.mixed if moves else posteriors)[:3]
        begun = [Gaussian(*(part[j].copy() for part in parts)) for j in range(len(bank.filters))]
        try:
            if moves:
                pairs = zip(bank.filters, begun, strict=True)
                begun = [mode.predict(posterior, inputs[k]) for mode, posterior in pairs]
            corrections = _corrected(bank, begun, y, inputs[k + 1], rows.outlier[k * gated])
        except DivergenceError as error:
            return k, error.finding
        for j, after in enumerate(corrections):
            posteriors.means[j] = after.posterior.mean
            posteriors.errors[j] = after.posterior.error
            posteriors.covariances[j] = after.posterior.covariance
            rows.innovation[k, j] = after.innovation
            work.log_likelihoods[j] = after.log_likelihood
        whole = update_probabilities(posteriors.log_probabilities, work.log_likelihoods)
        rows.log_likelihood[k] = 0.0 if np.isnan(y).all() else whole
        combine(posteriors, k, rows, work)
        if not all(np.isfinite(part[k]).all() for part in rows[:3]):
            return k, ""
    return len(measurements), ""


def _corrected(
    bank: IMM, begun: Sequence[Gaussian], y: Array, u: Array, outliers: Array
) -> list[Correction]:
    """The corrections of all filters, without what is beyond the gates of all of them."""
    pairs = list(zip(bank.filters, begun, strict=True))
    corrections = [mode.correct(posterior, y, u) for mode, posterior in pairs]
    if bank.gate is None:
        return corrections
    deviations = np.array(
        [each.innovation / np.sqrt(np.diag(each.innovation_covariance)) for each in corrections]
    )
    least = deviations[np.argmin(np.abs(deviations), axis=0), np.arange(len(y))]
    beyond = np.abs(least) > bank.gate
    outliers[:] = np.where(beyond, least, 0.0)
    if not beyond.any():
        return corrections
    taken = np.where(beyond, np.nan, y)
    return [mode.correct(posterior, taken, u) for mode, posterior in pairs]
