"""Observers of nonlinear models that are written as text, and the differentiator."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from reobserve.core.errors import located
from reobserve.core.matrices import FloatArray
from reobserve.estimation.kinds.linear import as_poles
from reobserve.estimation.kinds.setup import Estimates, Setup
from reobserve.observers.extended_high_gain import ExtendedHighGainObserver
from reobserve.observers.high_gain import HighGainObserver
from reobserve.observers.levant import LevantDifferentiator
from reobserve.observers.normal_form import normal_form_observer
from reobserve.observers.normal_form_observer import NormalFormObserver
from reobserve.systems.triangular import TriangularModel
from reobserve.systems.triangular_text import triangular_model

Array = FloatArray


@dataclass(frozen=True)
class StateStart:
    """An estimate of the state at the first row."""

    state: Array


@dataclass(frozen=True)
class NormalForm:
    """A normal-form observer of x' = f(x, u), y = h(x), where u may be left out."""

    kind: Literal["normal_form"]
    variables: list[str]
    dynamics: list[str]
    output: list[str]
    order: int
    poles: list[float | tuple[float, float]] | None = None
    injection: Array | None = None
    form: str = "identity"
    gain: str = "series"
    degree: int | None = None
    expanded: int = 9
    inputs: list[str] = field(default_factory=list)
    start: StateStart | None = None

    def set_up(self, period: float) -> Setup:
        """The observer."""
        poles = None if self.poles is None else as_poles(self.poles)
        observer = normal_form_observer(
            self.dynamics, self.output, self.variables, order=self.order, sampling_period=period,
            poles=poles, injection=self.injection, form=self.form, gain=self.gain,
            degree=self.degree, expanded=self.expanded, inputs=self.inputs,
        )  # fmt: skip
        n = len(self.variables)
        given = np.zeros(n) if self.start is None else self.start.state
        with located("start"):
            observer.init(given)
        made = normal_form_setup(observer, lambda y: observer.init(given))
        return replace(made, names={"state": tuple(self.variables)})


def normal_form_setup(observer: NormalFormObserver, start: Callable[[Array], Any]) -> Setup:
    """The setup of any normal-form observer."""
    read = observer.normal_form.problem.system.output

    def residual(y: Array, estimates: Estimates) -> Array:
        found: Array = y - np.array([read(row) for row in estimates["state"]])
        return found

    return Setup(observer, start, residual)


@dataclass(frozen=True)
class Triangular:
    """x1' = x2 + f1(x1), ..., xn' = fn(x) + G(x1) u; y = x1, the first of the variables."""

    variables: list[str]
    drift: list[str]
    input_gain: str

    def made(self) -> TriangularModel:
        """The model, compiled."""
        with located("model"):
            return triangular_model(self.variables, self.drift, self.input_gain)


@dataclass(frozen=True)
class HighGain:
    """The standard high-gain observer; the input column is the input as it reaches the plant."""

    kind: Literal["high_gain"]
    model: Triangular
    rho: float
    start: StateStart

    def set_up(self, period: float) -> Setup:
        """The observer."""
        observer = HighGainObserver(self.model.made(), self.rho, sampling_period=period)
        with located("start"):
            observer.init(self.start.state)
        made = high_gain_setup(observer, lambda y: observer.init(self.start.state))
        return replace(made, names={"state": tuple(self.model.variables)})


def high_gain_setup(observer: HighGainObserver, start: Callable[[Array], Any]) -> Setup:
    """The setup of a standard high-gain observer."""
    return Setup(observer, start, _first_state)


@dataclass(frozen=True)
class DelayedStart:
    """Estimates of the state and of the delay [s] at the first row."""

    state: Array
    delay: float


@dataclass(frozen=True)
class ExtendedHighGain:
    """The extended high-gain observer of state and input delay.

    Its input is one column, of which it finds the derivatives, or has them in columns of their own.
    """

    kind: Literal["extended_high_gain"]
    model: Triangular
    rho: float
    order: int
    delay_bounds: tuple[float, float]
    start: DelayedStart
    threshold: float = 0.0
    switched: str = "delay"
    initial_matrix: Array | None = None

    def set_up(self, period: float) -> Setup:
        """The observer."""
        observer = ExtendedHighGainObserver(
            self.model.made(), self.rho, self.order, self.delay_bounds, self.threshold,
            self.switched, self.initial_matrix, sampling_period=period,
        )  # fmt: skip

        def begin(y: Array | None = None) -> Any:
            return observer.init(self.start.state, self.start.delay)

        with located("start"):
            begin()
        made = extended_high_gain_setup(observer, begin)
        return replace(made, names={"state": tuple(self.model.variables)})


def extended_high_gain_setup(
    observer: ExtendedHighGainObserver, start: Callable[[Array], Any]
) -> Setup:
    """The setup of an extended high-gain observer."""
    return Setup(
        observer, start, _first_state, units={"delay": ("s",), "switched_off": ("1",)},
        widths=((1,), (1, observer.order + 1)), holds_inputs=False,
    )  # fmt: skip


def _first_state(y: Array, estimates: Estimates) -> Array:
    found: Array = y - estimates["state"][:, :1]
    return found


@dataclass(frozen=True)
class DerivativesStart:
    """Estimates of the signal and its derivatives at the first row."""

    derivatives: Array


@dataclass(frozen=True)
class Levant:
    """The robust exact differentiator of one column."""

    kind: Literal["levant"]
    L: float
    order: int = 2
    lambdas: Array | None = None
    start: DerivativesStart | None = None

    def set_up(self, period: float) -> Setup:
        """The differentiator, which starts from the first measurement if nothing is given."""
        observer = LevantDifferentiator(self.L, self.order, self.lambdas, sampling_period=period)
        if self.start is not None:
            with located("start"):
                observer.init(self.start.derivatives)

        def begin(y: Array) -> Any:
            given = np.append(y, np.zeros(self.order)) if self.start is None else (
                self.start.derivatives
            )  # fmt: skip
            return observer.init(given)

        return levant_setup(observer, begin)


def levant_setup(observer: LevantDifferentiator, start: Callable[[Array], Any]) -> Setup:
    """The setup of a differentiator."""

    def residual(y: Array, estimates: Estimates) -> Array:
        found: Array = y - estimates["derivatives"][:, :1]
        return found

    return Setup(observer, start, residual)
