"""Estimates by mean and covariance, the states of filters that make them, checks and warnings.

A correction from the variance p to the variance q leaves of 16 digits about 16 - log10(p / q): the
covariance after it is the small difference of large numbers. So it is with two measurements of one
quantity that are far more precise than it is known: the covariance of their innovations is then
nearly singular. `VagueStartWarning` says so.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.covariances import as_covariance, as_covariances
from reobserve.core.errors import InputError, shown
from reobserve.core.matrices import all_finite, as_numbers, as_row, as_samples
from reobserve.core.value import Value, for_loop, read_only
from reobserve.observers.record import Record, check_state, warn_caller
from reobserve.systems.linear import LinearModel

Array = NDArray[np.float64]
Matrices = Mapping[str, Array]


@dataclass(frozen=True, eq=False, repr=False)
class Gaussian(Value):
    """Mean and covariance of the state as a filter estimates it.

    ``mean``, shape (n,), and ``covariance``, (n, n), of the state; ``error`` is the filter's own a
    posteriori output error e(k|k), shape (m,), which the SVSF needs a sample later.
    """

    mean: Array
    covariance: Array
    error: Array


@dataclass(frozen=True, eq=False, repr=False)
class KalmanState(Value):
    """All a filter remembers: a value that may be stored, copied and stepped again.

    ``sample`` and ``count`` are as in `reobserve.observers.record.ObserverState`; y may be nan.
    ``held`` is what was given by row and leads from that sample to the next, by name, or None;
    ``time`` is that of the sample [s], or None where it is counted; ``noise`` are the variances of
    R, shape (m,), where they are estimated.
    """

    posterior: Gaussian
    sample: Array | None = None
    count: int = 0
    held: Matrices | None = None
    time: float | None = None
    noise: Array | None = None


@dataclass(frozen=True, eq=False, repr=False)
class Correction(Value):
    """A posterior after a measurement, and how well it was predicted.

    ``innovation`` e(k+1|k), shape (m,), its ``innovation_covariance`` S, shape (m, m), and the
    ``log_likelihood`` of the measurement. What of it is missing has nan in the first two; where all
    is, the third is zero.
    """

    posterior: Gaussian
    innovation: Array
    innovation_covariance: Array
    log_likelihood: float


class ModeFilter(Protocol):
    """Interface of the filters of an interacting multiple model, ours or a user's own."""

    @property
    def model(self) -> Any:
        """A model with its ``states``, ``inputs``, ``outputs`` and ``sampling_period``."""

    def predict(self, posterior: Gaussian, u: Array) -> Gaussian:
        """The posterior a sample later, before its measurement, with u held over the step."""

    def correct(self, posterior: Gaussian, y: Array, u: Array) -> Correction:
        """The predicted posterior after y, nan where missing, measured with the input u."""


class Rules(NamedTuple):
    """Settings of a filter beside its model.

    ``state_periods`` (n,) and ``output_periods`` (m,) are those of angles, 0 for none. Innovations
    beyond ``gate`` deviations are left out, or ``inflates`` their variance; inf is no gate. R is
    estimated with the weight ``forgetting`` of a row, 0 if it is known.
    """

    state_periods: Array
    output_periods: Array
    gate: float
    inflates: bool
    forgetting: float


def forgetting(memory: float | None, period: float) -> float:
    """The weight of a row in an estimate of R with a memory [s], 0 if R is known (None)."""
    return 0.0 if memory is None else min(1.0, period / memory)


def periods_of(mode: ModeFilter) -> tuple[Array, Array]:
    """The periods of angles among states and outputs, zero where there are none."""
    model = getattr(mode, "whole", mode.model)
    sizes = {"state_periods": model.states, "output_periods": model.outputs}
    periods = [getattr(model, name, None) for name in sizes]
    pairs = zip(periods, sizes.values(), strict=True)
    x, y = (np.zeros(size) if value is None else for_loop(value) for value, size in pairs)
    return x, y


class InRecord(NamedTuple):
    """A record as the loops read it: the model by row, inputs with the one before, and its end.

    ``last`` is what was given by row and leads on from the record, by name, but for that of S.
    """

    model: Any
    inputs: Array
    last: Matrices


class Source(NamedTuple):
    """Parts of a run that the smoother reads: filter, model by row, inputs from the row before."""

    filter: Any
    model: Any
    inputs: Array


class FilterSteps(NamedTuple):
    """The compiled loops of filters on one kind of model.

    ``in_record`` finds the model of each row, ``run`` is the loop over records, ``predict`` that
    over rows for the smoother, None where it reads matrices; ``work`` makes the scratch of both,
    and ``causes`` say why they stop.
    """

    model: type
    in_record: Callable[..., InRecord]
    run: Callable[..., None]
    predict: Any
    work: Callable[..., Any]
    causes: Mapping[int, str]


class Correlation(NamedTuple):
    """S by row and filter, of no row where the row before alone had it, and what it takes out.

    ``transition``, ``noise`` and ``known`` are J C, J S' and J e(k|k) of the steps that lead to
    rows, (k + 1, r, ...), with r = 1 for a filter that is no bank; ``A``, ``Q`` and ``shift``
    become A - J C, Q - J S' and J (y - D u) of these steps.
    """

    S: Array
    transition: Array
    noise: Array
    known: Array
    A: Array
    Q: Array
    shift: Array


TAKEN = ("transition", "noise", "known")


class FilterRows(NamedTuple):
    """The estimates of filters by their names: (records, k, ...).

    ``outlier`` and ``noise_variance`` have one row, which is overwritten, if nobody wants them.
    """

    state: Array
    covariance: Array
    innovation: Array
    innovation_covariance: Array
    log_likelihood: Array
    outlier: Array
    noise_variance: Array


class PredictedRows(NamedTuple):
    """Predictions and gains that filters keep if asked for, by their names, (records, k, ...)."""

    predicted_state: Array
    predicted_covariance: Array
    gain: Array


class FilterPosteriors(NamedTuple):
    """Means (records, n), covariances (records, n, n) and output errors (records, m).

    ``noises``, (records, m), are the variances of R where it is estimated, and ``counts``,
    (records,), the numbers of rows that they have been estimated from.
    """

    means: Array
    covariances: Array
    errors: Array
    noises: Array
    counts: Array


def reached(
    after: Any, r: int, state: KalmanState, record: Record, held: Matrices | None,
    sizes: tuple[int, int, int],
) -> KalmanState:  # fmt: skip
    """The state after record r of those whose posteriors are ``after``, checked for these sizes."""
    posterior = Gaussian._made(
        mean=after.means[r], covariance=after.covariances[r], error=after.errors[r]
    )
    return KalmanState._made(
        posterior=posterior, sample=np.concatenate([record.y[-1], record.u[-1]]),
        count=state.count + len(record.y) - (state.sample is None), held=held,
        time=None if record.time is None else float(record.time[-1]),
        noise=None if state.noise is None else after.noises[r], checked=sizes,
    )  # fmt: skip


def side_by_side(left: Array, right: Array) -> Array:
    """Two arrays (., k, p) and (k, q), (1, q) or (p, q) side by side, in the order of rows.

    `numpy.concatenate` may choose another order, for which loops would be compiled again.
    """
    joined = np.empty((*left.shape[:-1], left.shape[-1] + right.shape[-1]))
    joined[..., : left.shape[-1]], joined[..., left.shape[-1] :] = left, right
    return joined


def as_held(last: Matrices, correlation: Correlation | None, j: int = 0) -> Matrices | None:
    """Copies of what leads on from a record, of filter j, as views would keep all rows alive."""
    if correlation is not None and len(correlation.S):
        last = {**last, **{name: getattr(correlation, name)[-1, j] for name in TAKEN}}
    return {name: read_only(array.copy()) for name, array in last.items()} or None


def without_correlation(model: Any, inputs: Array) -> tuple[Any, Array]:
    """The model of a run by row with what S took out of its steps, and inputs with J (y - D u)."""
    one = model.correlation
    if one is None:
        return model, inputs
    if not hasattr(model, "A"):  # the loop that predicts takes J C out of df/dx
        return model._replace(Q=one.Q[:, 0].copy()), inputs
    # x = (A - J C) x + [B I] [u; J (y - D u)]
    B = side_by_side(model.B, np.eye(one.A.shape[-1]))
    model = model._replace(A=one.A[:, 0], B=B, Q=one.Q[:, 0], correlation=None)
    return model, side_by_side(inputs, one.shift[:, 0])


def inputs_of_rows(sample: Array | None, record: Record) -> Array:
    """The input of the row before a record, then that of each row, shape (k + 1, p).

    The first row of all has none before it; its own stands there, and is not read.
    """
    first = record.u[0] if sample is None else sample[record.y.shape[1] :]
    return np.concatenate([first[None], record.u])


def sample_before(u: ArrayLike | None, outputs: int, inputs: int) -> Array | None:
    """The sample of a state that stands a period before its first row, or None if it does not."""
    if u is None:
        return None
    held = as_samples("u", as_row("u", u), inputs)[0]
    return np.concatenate([np.full(outputs, np.nan), held])


def check_posterior(name: str, posterior: Gaussian, states: int, outputs: int) -> Gaussian:
    """The posterior, of this size: compiled loops would read beyond its end."""
    shapes = [
        getattr(getattr(posterior, part, None), "shape", ())
        for part in ("mean", "covariance", "error")
    ]
    return check_state(
        posterior, Gaussian,
        f"has arrays of shapes {tuple(shapes)}, must be of {states} states, {outputs} outputs",
        name, mean=(states,), covariance=(states, states), error=(outputs,),
    )  # fmt: skip


def check_held(held: Any, observer: Any, name: str = "start.held") -> Matrices | None:
    """Check what a state holds by name, as a filter takes it: loops would read beyond its end."""
    if held is None:
        return None
    n, p, _ = observer._sizes
    square, values = (n, n), getattr(observer.model, "parameter_values", ())
    shapes = {"A": square, "B": (n, p), "Q": square, "parameters": (len(values),), "dt": (1,)}
    shapes = {each: shape for each, shape in shapes.items() if each in observer.takes}
    if "S" in observer.takes:
        shapes |= dict(zip(TAKEN, (square, square, (n,)), strict=True))
    taken_out = {*TAKEN}
    if not isinstance(held, Mapping) or not held.keys() <= shapes.keys():
        raise InputError(name, f"{shown(held)} must be matrices by name: {', '.join(shapes)}")
    if held.keys() & taken_out and not held.keys() >= taken_out:
        raise InputError(name, f"must have all of {', '.join(TAKEN)}, or none")
    matrices = {}
    for key, value in held.items():
        matrices[key] = array = as_numbers(f"{name}.{key}", value, writable=False)
        if array.shape != shapes[key] or not all_finite(array):
            problem = f"{shown(value)} must be finite, of shape {shapes[key]}"
            raise InputError(f"{name}.{key}", problem)
        if key == "dt" and array[0] <= 0:
            raise InputError(f"{name}.dt", f"{shown(value)} must be a positive time")
    return matrices


def check_noise(value: Any, learned: bool, outputs: int) -> Array | None:
    """The variances of R in a state, which only a filter that estimates them has."""
    if not learned:
        if value is not None:
            raise InputError("start.noise", "is of a filter with noise_memory, which this has not")
        return None
    if value is None:
        raise InputError("start.noise", "is missing: the state is of a filter without noise_memory")
    variances = as_numbers("start.noise", value, writable=False)
    if variances.shape != (outputs,) or not all_finite(variances) or variances.min() <= 0:
        raise InputError("start.noise", f"{shown(value)} must be {outputs} numbers above zero")
    return variances


def check_sample(value: Any, outputs: int, inputs: int) -> Array | None:
    """The sample of a state: y, of which any may be nan, and u."""
    if value is None:
        return None
    sample = as_numbers("start.sample", value, writable=False)
    if sample.shape != (outputs + inputs,) or not all_finite(sample[outputs:]):
        problem = f"{shown(value)} must be {outputs} measurements and {inputs} finite inputs"
        raise InputError("start.sample", problem)
    return sample


LEAST = 0.1  # of the variance of an innovation: the estimate then takes a hundred memories


def refuse_given(observer: Any, given: Mapping[str, Any]) -> None:
    """Refuse what cannot be given to a filter that estimates R, or takes out S."""
    if "S" in given and hasattr(observer, "whole"):  # J = S R^-1
        R = as_numbers("R", given.get("R", observer.whole.R))
        as_covariances("R", R, observer.measurements, len(np.atleast_1d(R)), definite=True)
    if observer.noise_memory is None:
        return
    for name, why in (
        ("R", "noise_memory says that it is estimated"),
        ("dt", "noise_memory counts sampling periods"),
    ):
        if name in given:
            raise InputError(name, f"must be left out: {why}")


def check_noise_memory(observer: Any) -> None:
    """Refuse a memory that is shorter than a row, or an R that can hardly be seen.

    A row says how large the noise of a measurement is by R S^-1 e. Where R is a small part of the
    innovation's covariance S, as the state is hardly predicted, this is small: the change that a
    row makes has the factor (R / S)^2, so that the estimate takes (S / R)^2 times its memory. For
    linear models this is decided by the covariance that the filter comes to.
    """
    memory, period = observer.noise_memory, observer.sampling_period
    if not observer.has_kalman_gain:
        problem = f"must be left out: {type(observer).__name__} has another gain than Kalman's"
        raise InputError("noise_memory", problem)
    if memory < period:
        problem = f"{memory:g} s must be the sampling period, {period:g} s, or longer"
        raise InputError("noise_memory", problem)
    model = observer.whole
    as_covariance("R", model.R, model.outputs, definite=True)
    if not isinstance(model, LinearModel):
        return
    from reobserve.synthesis.linear_gain import steady_kalman_gain

    try:
        gain = steady_kalman_gain(model)
    except InputError as error:
        problem = f"cannot be used: the filter comes to no rest: {error.problem}"
        raise InputError("noise_memory", problem) from None
    # R S^-1 = I - C K
    innovation = np.linalg.solve(np.eye(model.outputs) - model.C @ gain, model.R)
    share = np.diag(model.R) / np.diag(innovation)
    worst = int(np.argmin(share))
    if share[worst] < LEAST:
        names = model.output_names
        name = f"output {worst + 1}" if names is None else names[worst]
        problem = (
            f"cannot be used: the noise of {name} is {share[worst]:.2g} of the variance of its "
            f"innovation, so that its estimate would take {share[worst] ** -2:.3g} memories; it "
            f"must be {LEAST:g} or more"
        )
        raise InputError("noise_memory", problem)


FILTERED = 1e12  # how far the variance of a state may fall from one row to the next
REMEDY = (
    "begin with a smaller covariance, and give less process noise, so that measurements are "
    "predicted with variances of at most 1e10 times R"
)


class VagueStartWarning(UserWarning):
    """The covariance of a start is so large beside that of measurements that digits are lost.

    ``row`` is that of the run, and ``sentence`` has ``{at}`` in its place.
    """

    def __init__(self, sentence: str, row: int) -> None:
        super().__init__(sentence, row)
        self.sentence, self.row = sentence, row

    def __str__(self) -> str:
        return self.sentence.format(at=f"row {self.row}")


def warn_of_start(start: Array, variances: Array, innovations: Array | None = None) -> bool:
    """Warn the caller of `run` or `step` if a variance falls too far in one of the first rows.

    ``start`` are the variances before them, (n,), and ``variances`` those after each, (k, n);
    ``innovations`` are the covariances of the innovations, (k, m, m), which say it of measurements.
    True if there was a warning.
    """
    before = start.tolist()
    for row, now in enumerate(variances.tolist()):  # few: numpy takes longer
        for state, (last, after) in enumerate(zip(before, now, strict=True)):
            if last > FILTERED * after > 0.0:  # zero is known, not vague
                _warn(
                    f"the variance of state {state + 1} falls from {last:g} to {after:g} at {{at}}",
                    row,
                )
                return True
        before = now
    if innovations is not None and innovations.shape[1] > 1:
        least = _least(innovations)
        row = int(np.argmin(least)) if len(least) else 0
        if len(least) and least[row] * FILTERED < 1.0:
            _warn(
                "measurements of the same are far more precise than their prediction at "
                "{at}: the covariance of their innovation is nearly singular (its correlation "
                f"matrix has the eigenvalue {least[row]:.1g})",
                row,
            )
            return True
    return False


def _least(innovations: Array) -> Array:
    """The least eigenvalues of correlation matrices, (..., k), with ones for what is missing."""
    size = innovations.shape[-1]
    known = np.where(np.isnan(innovations), np.eye(size), innovations)
    deviations = np.sqrt(known.diagonal(axis1=-2, axis2=-1))
    correlations = known / deviations[..., :, None] / deviations[..., None, :]
    return np.asarray(np.linalg.eigvalsh(correlations)[..., 0], dtype=np.float64)


def warn_of_starts(
    starts: Array, variances: Array, goods: NDArray[np.int64], innovations: Array
) -> None:
    """Warn for the first of many records whose start is too vague.

    The arrays are those of `warn_of_start`, of each record; ``goods`` are the good rows of each.
    """
    before = np.concatenate([starts[:, None], variances[:, :-1]], axis=1)
    doubtful = (before / FILTERED > variances).any(axis=(1, 2))
    if innovations.shape[-1] > 1:
        good = np.arange(innovations.shape[1]) < goods[:, None]
        least = _least(np.where(good[..., None, None], innovations, np.nan))
        doubtful |= (least * FILTERED < 1.0).any(axis=1)
    for record in np.flatnonzero(doubtful):
        last = goods[record]
        if warn_of_start(starts[record], variances[record, :last], innovations[record, :last]):
            return


def _warn(problem: str, row: int) -> None:
    """Warn at the line that called the library."""
    sentence = f"covariance: {problem}, so that rounding leaves few digits of it; {REMEDY}"
    warn_caller(VagueStartWarning(sentence, row))
