"""Estimates by mean and covariance, the states of filters that make them, and their checks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.errors import InputError, shown
from reobserve.core.matrices import all_finite, as_numbers, as_row, as_samples, as_scalar
from reobserve.core.value import Value, for_loop, read_only
from reobserve.observers.correlated_noise import TakenOut
from reobserve.observers.record import Record, check_state

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


class InRecord(NamedTuple):
    """A record as the loops read it: the model by row, inputs with the one before, and ``held``."""

    model: Any
    inputs: Array
    held: Matrices | None


class FilterSteps(NamedTuple):
    """The compiled loops of filters on one kind of model.

    ``in_record`` finds the model of each row, ``run`` is the loop over records, ``predict`` that
    over rows for the smoother; ``work`` makes the scratch of both, and ``causes`` say why they
    stop.
    """

    model: type
    in_record: Callable[..., InRecord]
    run: Callable[..., None]
    predict: Callable[..., int]
    work: Callable[..., Any]
    causes: Mapping[int, str]


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


def as_held(last: Matrices) -> Matrices | None:
    """Copies of what leads on from a record, which would else keep all its rows alive."""
    return {name: read_only(array.copy()) for name, array in last.items()} or None


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


def check_held(held: Any, observer: Any, name: str = "state.held") -> Matrices | None:
    """Check what a state holds by name, as a filter takes it: loops would read beyond its end."""
    if held is None:
        return None
    n, p, _ = observer._sizes
    square, values = (n, n), getattr(observer.model, "parameter_values", ())
    shapes = {"A": square, "B": (n, p), "Q": square, "parameters": (len(values),), "dt": (1,)}
    shapes = {each: shape for each, shape in shapes.items() if each in observer.takes}
    if "S" in observer.takes:
        shapes |= dict(zip(TakenOut._fields, (square, square, (n,)), strict=True))
    taken_out = set(TakenOut._fields)
    if not isinstance(held, Mapping) or not held.keys() <= shapes.keys():
        raise InputError(name, f"{shown(held)} must be matrices by name: {', '.join(shapes)}")
    if held.keys() & taken_out and not held.keys() >= taken_out:
        raise InputError(name, f"must have all of {', '.join(TakenOut._fields)}, or none")
    matrices = {}
    for key, value in held.items():
        matrices[key] = array = as_numbers(f"{name}.{key}", value, writable=False)
        if array.shape != shapes[key] or not all_finite(array):
            problem = f"{shown(value)} must be finite, of shape {shapes[key]}"
            raise InputError(f"{name}.{key}", problem)
        if key == "dt" and array[0] <= 0:
            raise InputError(f"{name}.dt", f"{shown(value)} must be a positive time")
    return matrices


def check_time(time: Any) -> float | None:
    """The time [s] of a state's sample, or `InputError` if it is no finite number and not None."""
    return None if time is None else as_scalar("state.time", time)


def check_noise(value: Any, learned: bool, outputs: int) -> Array | None:
    """The variances of R in a state, which only a filter that estimates them has."""
    if not learned:
        if value is not None:
            raise InputError("state.noise", "is of a filter with noise_memory, which this has not")
        return None
    if value is None:
        raise InputError("state.noise", "is missing: the state is of a filter without noise_memory")
    variances = as_numbers("state.noise", value, writable=False)
    if variances.shape != (outputs,) or not all_finite(variances) or variances.min() <= 0:
        raise InputError("state.noise", f"{shown(value)} must be {outputs} numbers above zero")
    return variances


def check_sample(value: Any, outputs: int, inputs: int) -> Array | None:
    """The sample of a state: y, of which any may be nan, and u."""
    if value is None:
        return None
    sample = as_numbers("state.sample", value, writable=False)
    if sample.shape != (outputs + inputs,) or not all_finite(sample[outputs:]):
        problem = f"{shown(value)} must be {outputs} measurements and {inputs} finite inputs"
        raise InputError("state.sample", problem)
    return sample


def periods_of(mode: ModeFilter) -> tuple[Array, Array]:
    """The periods of angles among states and outputs, zero where there are none."""
    model = getattr(mode, "whole", mode.model)
    sizes = {"state_periods": model.states, "output_periods": model.outputs}
    periods = [getattr(model, name, None) for name in sizes]
    pairs = zip(periods, sizes.values(), strict=True)
    x, y = (np.zeros(size) if value is None else for_loop(value) for value, size in pairs)
    return x, y
