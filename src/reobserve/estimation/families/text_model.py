"""A nonlinear model as YAML states it, as text, and what filters on one have in common."""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Literal

import numpy as np

from reobserve.core.covariances import as_covariance
from reobserve.core.errors import DivergenceError, InputError, nearest
from reobserve.core.matrices import FloatArray, as_vector
from reobserve.core.validation import NotNegative, Positive
from reobserve.estimation.families.linear_system import FilterDesign
from reobserve.estimation.families.rules import periods
from reobserve.estimation.families.signals import NamedSignal, check_keys, listed, named
from reobserve.estimation.observer_design import Certificate, System
from reobserve.systems.nonlinear import NonlinearModel

Array = FloatArray
Texts = dict[str, str | float]

RECORD = """\
  time: continuous            # x' = f(x, u), integrated over each sample; or discrete: x(k+1)
  substeps: 1                 # Runge-Kutta steps in a sampling period
  states: {angle: rad, rate: rad/s}
  inputs: {torque: N m}       # held from sample to sample
  measurements: {angle: rad}
  parameters: {stiffness: 9.81, friction: 0.5, gain: 4}
  dynamics:                   # of each state
    angle: rate
    rate: -stiffness*sin(angle) - friction*rate + gain*torque
  output:                     # y = h(x, u), of each measurement
    angle: angle
  Q: [1.0e-10, 1.0e-7]        # variances of the process noise per sample
  R: 3.0e-8                   # of the measurement
  initial_state: [0.0, 0.0]
  initial_covariance: 1.0
"""


def check_texts(system: Any) -> None:
    """Refuse ``dynamics`` that are not of the states, ``output`` not of the measurements."""
    check_keys("dynamics", system.dynamics, system.states)
    check_keys("output", system.output, system.measurements)
    for name in system.inputs:
        if name in system.states:
            raise InputError(f"inputs.{name}", "is the name of a state, too")


@dataclass(frozen=True, eq=False, kw_only=True)
class ParameterState:
    """A parameter that is estimated: its variance at the start, and what that gains in a second."""

    initial_variance: Positive
    random_walk: NotNegative = 0.0
    unit: str = ""


@dataclass(frozen=True, eq=False, kw_only=True)
class TextSystem(System):
    """x' = f(x, u) or x(k+1) = f(x(k), u(k)), by the word ``time``, with y = h(x, u), as text.

    A model of continuous time is integrated by ``substeps`` Runge-Kutta steps in a sampling period,
    1 if left out, with inputs held. ``Q`` and ``R`` are covariances of the noise of a sample, in
    either time. ``parameters`` are further names in the texts, with their values; those named in
    ``parameter_states`` become states behind the others, from that value on. ``periods`` are those
    of states and measurements that are angles, and ``gate``, ``outliers`` and ``noise_memory`` [s]
    those of `KalmanFilter`.
    """

    time: Literal["continuous", "discrete"]
    dynamics: Texts
    output: Texts
    parameters: dict[str, float] = field(default_factory=dict)
    substeps: int | None = None
    Q: Array
    R: Array
    initial_covariance: Array
    parameter_states: dict[str, ParameterState] = field(default_factory=dict)
    periods: dict[str, float | str] = field(default_factory=dict)
    gate: float | None = None
    outliers: Literal["skip", "inflate"] | None = None
    noise_memory: float | None = None

    def __post_init__(self) -> None:
        for name in ("states", "measurements"):
            if not getattr(self, name):
                raise InputError(name, "are none, must be one or more")
        check_texts(self)
        texts = " ".join(map(str, (*self.dynamics.values(), *self.output.values())))
        for name in self.parameters:
            if name in self.states or name in self.inputs:
                kind = "a state" if name in self.states else "an input"
                raise InputError(f"parameters.{name}", f"is the name of {kind}, too")
            if not re.search(rf"\b{re.escape(name)}\b", texts):
                words = set(re.findall(r"[^\W\d]\w*", texts)) - {*self.states, *self.inputs}
                close = difflib.get_close_matches(name, sorted(words - {*self.parameters}), n=1)
                hint = f", which name {close[0]}" if close else ""
                raise InputError(
                    f"parameters.{name}", f"is in no text of dynamics or output{hint}"
                )  # fmt: skip
        if self.substeps is not None and self.time == "discrete":
            problem = "must be left out where time is discrete: nothing is integrated"
            raise InputError("substeps", problem)
        if self.initial_state is not None:
            as_vector("initial_state", self.initial_state, len(self.states))
        for name in self.parameter_states:
            if name not in self.parameters:
                problem = f"is no parameter{nearest(name, self.parameters)}"
                raise InputError(f"parameter_states.{name}", problem)

    @property
    def mean(self) -> Array:
        """The initial state, zero where it is not stated, and parameters that are states."""
        initial = self.initial_state
        first = [0.0] * len(self.states) if initial is None else initial
        return np.array([*first, *(self.parameters[name] for name in self.parameter_states)])

    @property
    def covariance(self) -> Array:
        """The initial covariance of the state and of parameters that are states."""
        n, more = len(self.states), list(self.parameter_states.values())
        covariance = np.diag([*np.zeros(n), *(state.initial_variance for state in more)])
        covariance[:n, :n] = as_covariance("initial_covariance", self.initial_covariance, n)
        return covariance

    @cached_property
    def model(self) -> NonlinearModel:
        """The model, or `InputError` for the key that is wrong."""
        arguments: Mapping[str, Any] = {
            "f": [str(self.dynamics[name]) for name in self.states],
            "h": [str(self.output[name]) for name in self.measurements],
            "Q": self.Q, "R": self.R, "parameters": self.parameters,
            "state_names": list(self.states), "input_names": list(self.inputs),
            "output_names": list(self.measurements), "sampling_period": self.sampling_period,
            **periods(self),
        }  # fmt: skip
        with self.naming():
            if self.time == "discrete":
                model = NonlinearModel(**arguments)
            else:
                steps = 1 if self.substeps is None else self.substeps
                model = NonlinearModel.from_ode(**arguments, substeps=steps)
            walks = {name: state.random_walk for name, state in self.parameter_states.items()}
            return model.with_parameter_states(walks) if walks else model

    def naming(self) -> AbstractContextManager[None]:
        """Let an `InputError` of a text name its key."""
        return named(f=("dynamics", self.states), h=("output", self.measurements))


@dataclass(frozen=True, eq=False, kw_only=True)
class TextFilterDesign(FilterDesign):
    """A filter on a model from text."""

    system: TextSystem

    about: ClassVar[str]  # what the filter is called

    @property
    def states(self) -> tuple[NamedSignal, ...]:
        """The states of the system, and parameters that are states."""
        more = self.system.parameter_states.items()
        return (*listed(self.system.states), *(NamedSignal(name, one.unit) for name, one in more))

    def start(self) -> Any:
        """Initial mean and covariance, at the first sample."""
        return self.observer.init(self.system.mean, self.system.covariance)  # type: ignore[attr-defined]

    def certify(self) -> Certificate:
        """Standard deviations of the first innovation, and of the state predicted a sample later.

        Inputs are zero. A row that is measured as predicted is corrected by, too, but what remains
        then of a large initial covariance may be all rounding, and is not certified.

        Raises
        ------
        InputError
            If the model or the start is none, or no such step can be taken from there.
        """
        with self.keyed():
            observer, state = self.observer, self.start()
        y, u = np.zeros(observer.measurements), np.zeros(observer.inputs)
        later, spreads = state, []
        try:
            for _ in range(2):
                later, predicted = observer.step(later, np.full_like(y, np.nan), u)
                expected = -observer.step(state, y, u)[1]["innovation"]
                state, estimates = observer.step(state, expected, u)
                spreads.append(np.diag(estimates["innovation_covariance"]))
        except DivergenceError as error:
            problem = f"takes no step from there with inputs of zero: {error.finding}"
            raise InputError("initial_state", problem) from None
        innovations = zip(self.measurements, spreads[0], strict=True)
        variances = {f"innovation_sigma_{signal.name}": value for signal, value in innovations}
        for component, value in zip(self.states, predicted["variance"], strict=True):
            variances[f"sigma_{component.name}"] = value
        return {name: float(np.sqrt(value)) for name, value in variances.items()}

    def summary(self) -> list[str]:
        """Sentences on what was checked, and what cannot be."""
        known = [
            f"{signal.name} {self.certificate[f'sigma_{signal.name}']:.4g} {signal.unit}"
            for signal in self.states
        ]
        kind = "integrated" if self.system.model.substeps else "discrete"
        return [
            f"{self.about}, {kind} model from text",
            "checked: texts, covariances, and a step from the start with inputs of zero",
            f"standard deviations predicted a sample after the start: {', '.join(known)}",
            "that it follows the plant is not certified: of a nonlinear model no gain proves it",
        ]
