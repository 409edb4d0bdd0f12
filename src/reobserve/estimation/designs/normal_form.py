"""Design of a normal-form observer, from right-hand sides as text."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np

from reobserve.core.documents import Tree
from reobserve.core.errors import InputError, nearest
from reobserve.core.matrices import FloatArray, as_vector
from reobserve.core.validation import checked, parse
from reobserve.estimation.designs.design import Certificate, Design, pairs, told
from reobserve.estimation.designs.linear_system import Period, check_shape
from reobserve.estimation.designs.poles import as_pole_list, check_poles, parse_poles
from reobserve.estimation.designs.signals import Signal, Signals, numbered
from reobserve.observers.normal_form import normal_form_observer
from reobserve.observers.normal_form_observer import NormalFormObserver, State

Array = FloatArray
Form = Literal["identity", "transformed"]
Reading = Literal["series", "jacobian", "composed"]

EXAMPLE = """\
# A pendulum whose angle is measured. Right-hand sides are text in states and inputs.
sampling_period: 0.01       # [s]
states: {angle: rad, rate: rad/s}
inputs: {torque: N m}       # known; must enter so that errors stay linear, which is checked
measurements: {angle: rad}
dynamics:
  angle: rate
  rate: -sin(angle) - rate/10 + torque
output:
  angle: angle
injection:                  # terms of l(y) from degree 2 on, in y1, y2, ...; none if left out
  rate: sin(y1) - y1        # here they make the observer exact, and known inputs possible
order: 3                    # of the gain
poles: [-1.5, -2.2]         # [1/s] of the error; complex ones are written as "-1+2j"
initial_state: [0.3, 0]
"""


@dataclass(frozen=True, eq=False, kw_only=True)
class NonlinearSystem:
    """x' = f(x, u), y = h(x) with an equilibrium at the origin, expanded there."""

    sampling_period: Period
    states: Signals
    inputs: Signals = field(default_factory=dict)
    measurements: Signals
    dynamics: dict[str, str | float]
    output: dict[str, str | float]
    injection: dict[str, str | float] | None = None
    order: int
    poles: Annotated[list[Any], checked(check_poles)] | None = None
    form: Form = "identity"
    gain: Reading = "series"
    degree: int | None = None
    initial_state: list[float] | None = None

    def __post_init__(self) -> None:
        for name, signals in (("dynamics", self.states), ("output", self.measurements)):
            given = getattr(self, name)
            for key in given:
                if key not in signals:
                    raise InputError(f"{name}.{key}", f"is of no signal{nearest(key, signals)}")
            for key in signals:
                if key not in given:
                    raise InputError(f"{name}.{key}", "is missing; each signal needs one")
        for key in self.injection or {}:
            if key not in self.states:
                raise InputError(f"injection.{key}", f"is of no state{nearest(key, self.states)}")
        if self.initial_state is not None:
            as_vector("initial_state", self.initial_state, len(self.states))
        for name in self.inputs:
            if name in self.states:
                raise InputError(f"inputs.{name}", "is the name of a state, too")

    def built(self, **chosen: Any) -> NormalFormObserver:
        """The observer with poles, or with an injection; raises as `normal_form_observer`."""
        higher = None
        if self.injection:
            higher = [self.injection.get(name, 0) for name in self.states]
        try:
            return normal_form_observer(
                [self.dynamics[name] for name in self.states],
                [self.output[name] for name in self.measurements],
                list(self.states),
                inputs=list(self.inputs),
                higher=higher,
                sampling_period=self.sampling_period,
                degree=self.degree,
                **chosen,
            )
        except InputError as error:
            raise InputError(self._place(error.parameter), error.problem) from None

    def _place(self, parameter: str) -> str:
        """The key of what a list has for it: ``dynamics[0]`` is that of the first state."""
        found = re.fullmatch(r"(dynamics|output|higher)\[(\d+)\]", parameter)
        if found is None:
            return parameter
        signals = self.measurements if found[1] == "output" else self.states
        key = "injection" if found[1] == "higher" else found[1]
        return f"{key}.{list(signals)[int(found[2])]}"


@dataclass(frozen=True, eq=False)
class NormalFormGains:
    """``injection`` is L0, the linear part of l, shape (n, p); the rest as the observer has it."""

    injection: Array
    order: int
    form: Form = "identity"
    gain: Reading = "series"


@dataclass(frozen=True, eq=False, kw_only=True)
class NormalFormDesign(Design):
    """A normal-form observer."""

    system: NonlinearSystem
    gains: NormalFormGains
    certificate: Certificate = field(default_factory=dict)

    example: ClassVar[str] = EXAMPLE

    @classmethod
    def designed(cls, model: Tree, *, poles: str | None = None, **chosen: Any) -> Self:
        """The observer of a model's file; raises as `of`, and for wrong keys."""
        placed = None if poles is None else parse_poles(poles)
        return cls.of(parse(NonlinearSystem, model), poles=placed, **chosen)

    @classmethod
    def of(
        cls,
        system: NonlinearSystem,
        *,
        poles: Sequence[complex] | None = None,
        order: int | None = None,
        form: Form | None = None,
    ) -> Self:
        """The observer whose error in z has these poles [1/s]; left out, all is as the system says.

        Raises
        ------
        InputError
            As `reobserve.observers.normal_form.normal_form_observer`, or if poles are nowhere.
        """
        if poles is None and system.poles is None:
            raise InputError("poles", "are missing; the model or the command line states them")
        chosen = as_pole_list("poles", system.poles or []) if poles is None else poles
        order = system.order if order is None else order
        form = system.form if form is None else form
        built = system.built(poles=chosen, order=order, form=form, gain=system.gain)
        matrix = np.asarray(built.normal_form.problem.injection.matrix, dtype=np.float64)
        gains = NormalFormGains(matrix, order, form, system.gain)
        return cls(system=system, gains=gains)

    def __post_init__(self) -> None:
        shape = (len(self.system.states), len(self.system.measurements))
        check_shape("gains.injection", self.gains.injection, shape)

    @cached_property
    def observer(self) -> NormalFormObserver:
        """The observer."""
        gains = self.gains
        return self.system.built(
            injection=gains.injection, order=gains.order, form=gains.form, gain=gains.gain
        )

    @property
    def estimates(self) -> Mapping[str, tuple[Signal, ...]]:
        """The state, and of the transformed form its coordinates."""
        found = {"state": self.states}
        if self.gains.form == "transformed":
            found["coordinates"] = numbered("z", len(self.states))
        return found

    def start(self) -> State | None:
        """The initial state; None for the origin."""
        stated = self.system.initial_state
        return None if stated is None else self.observer.init(stated)

    def certify(self) -> Certificate:
        """Poles of the error in z, the smallest divisor of the series, the size of S beyond x.

        Raises
        ------
        InputError
            If A is not stable or resonant, or an input leaves no linear error dynamics.
        """
        form = self.observer.normal_form
        poles = np.linalg.eigvals(np.asarray(form.problem.A, dtype=np.float64))
        poles = poles[np.lexsort((poles.imag, -poles.real))]
        largest = np.abs(form.S.coefficients[:, form.problem.system.states + 1 :])
        certificate: Certificate = {
            "poles": pairs(poles), "nonlinearity": float(largest.max(initial=0.0)),
        }  # fmt: skip
        if form.resonance is not None:
            certificate["smallest_divisor"] = form.resonance.distance
        return certificate

    def summary(self) -> list[str]:
        """Poles, and what they are of."""
        known, gains = self.certificate, self.gains
        lines = [
            f"normal-form observer, {gains.form} form, order {gains.order}",
            f"poles: {told(known['poles'])} 1/s, of the error in z = S(x)",
        ]
        if known["nonlinearity"] < 1e-9:
            lines.append("S(x) = x: the error is linear in x itself")
        else:
            lines.append(
                f"largest coefficient of S beyond x: {known['nonlinearity']:.4g}; the error is "
                "linear in z, up to what the order cuts off"
            )
        if "smallest_divisor" in known:
            lines.append(f"smallest divisor of the series: {known['smallest_divisor']:.4g} 1/s")
        return lines
