"""Observers of linear models: Kalman filters and their kin, banks of them, constant gains."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Tag

from reobserve.core.discretisation import zero_order_hold
from reobserve.core.errors import InputError, located
from reobserve.core.kernel import kernel
from reobserve.core.matrices import FloatArray
from reobserve.core.validation import checked, having
from reobserve.estimation.kinds.setup import Estimates, Setup
from reobserve.observers.augmented_kalman import AugmentedKalmanFilter
from reobserve.observers.contract import Observer
from reobserve.observers.fixed_gain import FixedGainObserver, luenberger, steady_kalman
from reobserve.observers.imm import IMM
from reobserve.observers.kalman import KalmanFilter
from reobserve.observers.linear_filter import LinearFilter
from reobserve.observers.smooth_variable_structure import SmoothVariableStructureFilter
from reobserve.synthesis.linear import undetectable_modes
from reobserve.systems.linear import LinearModel

Array = FloatArray

_MOST_MODES = 50


@dataclass(frozen=True)
class Rates:
    """x' = A x + B u; without B there is no input."""

    A: Array
    B: Array | None = None


@dataclass(frozen=True)
class ContinuousModel:
    """A model whose input is held over a period; Q and R are those of a sample."""

    continuous: Rates
    H: Array
    Q: Array
    R: Array
    D: Array | None = None

    def made(self, period: float) -> LinearModel:
        """The model, sampled."""
        A = self.continuous.A
        B = _no_input(A) if self.continuous.B is None else self.continuous.B
        with located("continuous"):
            transition, effect = zero_order_hold(A, B, period)
        return LinearModel(
            transition, effect, self.H, self.D, self.Q, self.R, unusual=True,
            sampling_period=period,
        )  # fmt: skip


@dataclass(frozen=True)
class DiscreteModel:
    """x(k+1) = A x(k) + B u(k), y(k) = H x(k) + D u(k); without B there is no input."""

    A: Array
    H: Array
    Q: Array
    R: Array
    B: Array | None = None
    D: Array | None = None
    unusual: bool = False

    def made(self, period: float) -> LinearModel:
        """The model, of samples at this period."""
        B = _no_input(self.A) if self.B is None else self.B
        return LinearModel(
            self.A, B, self.H, self.D, self.Q, self.R, sampling_period=period, unusual=self.unusual
        )


def _no_input(A: Array) -> Array:
    return np.zeros((len(A) if A.ndim else 0, 0))


# Told apart by the key under which a continuous model has its rates.
Model = Annotated[
    Annotated[ContinuousModel, Tag("continuous model")]
    | Annotated[DiscreteModel, Tag("discrete model")],
    having("continuous", "continuous model", "discrete model"),
]


@dataclass(frozen=True)
class BeliefStart:
    """Mean and covariance of the state at the first row, which corrects them."""

    mean: Array
    covariance: Array


@dataclass(frozen=True)
class Kalman:
    """A Kalman filter."""

    kind: Literal["kalman"]
    model: Model
    start: BeliefStart

    def set_up(self, period: float) -> Setup:
        """The filter."""
        return _filter(KalmanFilter(_model(self.model, period)), self.start)


@dataclass(frozen=True)
class Svsf:
    """A smooth variable structure filter."""

    kind: Literal["svsf"]
    model: Model
    boundary_layer: Array
    memory: float
    start: BeliefStart
    inverse: str = "pseudo"

    def set_up(self, period: float) -> Setup:
        """The filter."""
        made = SmoothVariableStructureFilter(
            _model(self.model, period), self.boundary_layer, self.memory, self.inverse
        )
        return _filter(made, self.start)


@dataclass(frozen=True)
class FixedGain:
    """A prediction, corrected by a gain that is given."""

    kind: Literal["fixed_gain"]
    model: Model
    gain: Array
    start: BeliefStart

    def set_up(self, period: float) -> Setup:
        """The observer."""
        return _filter(FixedGainObserver(_model(self.model, period), self.gain), self.start)


@dataclass(frozen=True)
class Luenberger:
    """The same with the gain that gives the error these poles [1], inside the unit circle."""

    kind: Literal["luenberger"]
    model: Model
    poles: list[float | tuple[float, float]]
    start: BeliefStart

    def set_up(self, period: float) -> Setup:
        """The observer."""
        return _filter(luenberger(_model(self.model, period), as_poles(self.poles)), self.start)


@dataclass(frozen=True)
class SteadyKalman:
    """The same with the gain that a Kalman filter comes to."""

    kind: Literal["steady_kalman"]
    model: Model
    start: BeliefStart

    def set_up(self, period: float) -> Setup:
        """The observer."""
        return _filter(steady_kalman(_model(self.model, period)), self.start)


@dataclass(frozen=True)
class UnknownStart(BeliefStart):
    """And of the unknown inputs, zero and one if left out."""

    unknown_input: Array | None = None
    unknown_input_covariance: Array | None = None


@dataclass(frozen=True)
class AugmentedKalman:
    """A Kalman filter of the state and unknown inputs."""

    kind: Literal["augmented_kalman"]
    model: Model
    input_matrix: Array
    walk: Array
    start: UnknownStart
    output_matrix: Array | None = None

    def set_up(self, period: float) -> Setup:
        """The filter."""
        model, start = _model(self.model, period), self.start
        observer = AugmentedKalmanFilter(model, self.input_matrix, self.walk, self.output_matrix)
        wide: Any = 1.0 if start.unknown_input_covariance is None else (
            start.unknown_input_covariance
        )  # fmt: skip

        def begin() -> Any:
            return observer.init(start.mean, start.covariance, start.unknown_input, wide)

        with located("start"):
            begin()
        return Setup(
            observer, lambda y: begin(), _innovation,
            sigmas={"state": "variance", "unknown_input": "unknown_input_variance"},
            left_out=("variance", "unknown_input_variance", "innovation", "log_likelihood"),
            spread=observer.innovation_deviation,
        )  # fmt: skip


@dataclass(frozen=True)
class ModesStart:
    """Mean and covariance for all modes, and their probabilities, all the same if left out."""

    mean: Array
    covariance: Array
    probabilities: Array | None = None


def _several(place: str, value: Any) -> None:
    if not 1 <= len(value) <= _MOST_MODES:
        raise InputError(place, f"has {len(value)} modes, must have 1 to {_MOST_MODES}")


@dataclass(frozen=True)
class Imm:
    """A bank of filters, one a mode, by the names of the modes."""

    kind: Literal["imm"]
    modes: Annotated[dict[str, Model], checked(_several)]
    transition: Array
    start: ModesStart
    filter: Literal["kalman", "svsf"] = "kalman"
    boundary_layer: Array | None = None
    memory: float | None = None
    mixing: bool = True

    def set_up(self, period: float) -> Setup:
        """The bank."""
        widths = {"boundary_layer": self.boundary_layer, "memory": self.memory}
        for name, value in widths.items():
            if (value is None) == (self.filter == "svsf"):
                told = "is missing" if value is None else "must be left out"
                raise InputError(name, f"{told}; only the filter svsf takes it")
        filters: list[LinearFilter] = []
        for name, model in self.modes.items():
            with located(f"modes.{name}"):
                made = model.made(period)
            if self.filter == "kalman":
                filters.append(KalmanFilter(made))
            else:
                layer: Any = self.boundary_layer
                filters.append(SmoothVariableStructureFilter(made, layer, self.memory or 0.0))
        observer, start = IMM(filters, self.transition, self.mixing), self.start

        def begin() -> Any:
            return observer.init(start.mean, start.covariance, start.probabilities)

        with located("start"):
            begin()
        return replace(
            imm_setup(observer, lambda y: begin()),
            names={"probability": tuple(f"probability_{name}" for name in self.modes)},
            unseen=tuple(
                hidden for name, one in zip(self.modes, filters, strict=True)
                for hidden in _unseen(one.model, f"modes.{name}")
            ),
        )  # fmt: skip


def imm_setup(observer: IMM, start: Callable[[Array], Any]) -> Setup:
    """The setup of a bank."""
    return Setup(
        observer, start, _mixed_innovation, sigmas={"state": "variance"},
        left_out=("variance", "covariance", "innovation", "log_likelihood"),
    )  # fmt: skip


def as_poles(poles: list[float | tuple[float, float]]) -> list[complex]:
    """Poles as numbers, or as pairs of real and imaginary part."""
    return [complex(*pole) if isinstance(pole, tuple) else complex(pole) for pole in poles]


def _model(model: Model, period: float) -> LinearModel:
    with located("model"):
        return model.made(period)


def _filter(observer: LinearFilter, start: BeliefStart) -> Setup:
    with located("start"):
        observer.init(start.mean, start.covariance)
    return linear_setup(observer, lambda y: observer.init(start.mean, start.covariance))


def linear_setup(observer: Observer[Any], start: Callable[[Array], Any]) -> Setup:
    """The setup of any linear filter."""
    model = getattr(observer, "model", None)
    unseen = _unseen(model, "model") if isinstance(model, LinearModel) else ()
    fixed = isinstance(observer, FixedGainObserver)
    spread = observer.innovation_deviation if isinstance(observer, LinearFilter) else None
    return Setup(
        observer, start, _innovation, sigmas={} if fixed else {"state": "variance"},
        left_out=("variance", "innovation", "log_likelihood"), unseen=unseen,
        spread=None if fixed else spread,
    )  # fmt: skip


def _unseen(model: LinearModel, place: str) -> tuple[str, ...]:
    hidden = undetectable_modes(model.A, model.C)
    if not len(hidden):
        return ()
    return (
        f"state: a mode of {place} with the eigenvalue {hidden[0]:.4g} does not decay and is "
        "hidden from the measurements, so that its estimate is that of the start for ever",
    )


def _innovation(y: Array, estimates: Estimates) -> Array:
    return estimates["innovation"]


def _mixed_innovation(y: Array, estimates: Estimates) -> Array:
    """What the modes did not foretell, weighed by their probabilities."""
    return _weighed(estimates["probability"], estimates["innovation"])


@kernel
def _weighed(probability: Array, innovation: Array) -> Array:
    rows, modes, size = innovation.shape
    found = np.zeros((rows, size))
    for k in range(rows):
        for mode in range(modes):
            for place in range(size):
                found[k, place] += probability[k, mode] * innovation[k, mode, place]
    return found
