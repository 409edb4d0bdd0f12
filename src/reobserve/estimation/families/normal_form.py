"""Normal-form observer, from right-hand sides as text."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Literal

import numpy as np

from reobserve.core.errors import InputError, nearest
from reobserve.core.matrices import FloatArray
from reobserve.estimation.families.linear_system import check_shape
from reobserve.estimation.families.poles import Poles, stable_poles
from reobserve.estimation.families.signals import NamedSignal, named, numbered
from reobserve.estimation.families.text_model import check_texts
from reobserve.estimation.observer_design import (
    Certificate,
    Design,
    Estimates,
    Example,
    System,
    pairs,
    pole_text,
)
from reobserve.observers.normal_form import (
    IdentityObserver,
    NormalFormObserver,
    TransformedObserver,
    normal_form_observer,
)

Array = FloatArray
Form = Literal["identity", "transformed"]
Variant = Literal["series", "jacobian", "composed"]


def _record(about: str, chosen: str) -> str:
    return f"""\
# Normal-form observer {about}, of a system x' = f(x), y = h(x) that is written as text.
observer:
  kind: normal-form
  states: {{angle: rad, rate: rad/s}}
  measurements: {{angle: rad}}
  dynamics: {{angle: rate, rate: -sin(angle) - rate/10}}
  output: {{angle: angle}}
  poles: [-1.5, -2.0]        # [1/s] of the error; complex ones are written as "-1+2j"
  # injection: {{rate: sin(y1) - y1}}   # terms of l(y) from degree 2 on; known inputs may need some
{chosen}"""


@dataclass(frozen=True, eq=False, kw_only=True)
class NonlinearSystem(System):
    """x' = f(x, u), y = h(x) with an equilibrium at the origin, expanded there."""

    dynamics: dict[str, str | float]
    output: dict[str, str | float]
    injection: dict[str, str | float] | None = None
    order: int
    poles: Poles | None = None
    form: Form = "identity"
    gain: Variant = "series"
    degree: int | None = None
    expanded: int = 9

    def __post_init__(self) -> None:
        check_texts(self)
        for key in self.injection or {}:
            if key not in self.states:
                raise InputError(f"injection.{key}", f"is of no state{nearest(key, self.states)}")

    def built(self, **chosen: Any) -> NormalFormObserver:
        """The observer with poles, or with an injection (raises as `normal_form_observer`)."""
        higher = None
        if self.injection:
            higher = [self.injection.get(name, 0) for name in self.states]
        with named(
            dynamics=("dynamics", self.states), output=("output", self.measurements),
            higher=("injection", self.states),
        ):  # fmt: skip
            return normal_form_observer(
                [self.dynamics[name] for name in self.states],
                [self.output[name] for name in self.measurements],
                list(self.states),
                inputs=list(self.inputs),
                higher=higher,
                sampling_period=self.sampling_period,
                degree=self.degree,
                expanded=self.expanded,
                order=self.order,
                form=self.form,
                gain=self.gain,
                **chosen,
            )


@dataclass(frozen=True, eq=False)
class NormalFormGains:
    """L0, the linear part of l, shape (n, p)."""

    injection: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class NormalFormDesign(Design):
    """A normal-form observer."""

    system: NonlinearSystem
    gains: NormalFormGains

    programs: ClassVar = {
        IdentityObserver: "integrating:identity", TransformedObserver: "integrating:transformed",
    }  # fmt: skip
    records: ClassVar = {
        "normal-form-constant": Example("pendulum", _record("of constant gain", """\
  order: 0                   # a constant gain
""")),
        "normal-form-identity": Example("pendulum", _record("in identity form", """\
  order: 4                   # degree up to which the gain is kept
  form: identity
  gain: series               # series, jacobian or composed
""")),
        "normal-form-transformed": Example("pendulum", _record("in transformed coordinates", """\
  order: 4                   # degree up to which the series are kept
  form: transformed
""")),
    }  # fmt: skip

    @classmethod
    def find_gains(cls, system: NonlinearSystem) -> NormalFormGains:
        """The injection that gives the error in z the poles [1/s] that the system states."""
        if system.poles is None:
            raise InputError("poles", "are missing, and so are gains; one of them must be stated")
        built = system.built(poles=stable_poles("poles", system.poles))
        matrix = np.asarray(built.normal_form.problem.injection.matrix, dtype=np.float64)
        return NormalFormGains(matrix)

    def __post_init__(self) -> None:
        shape = (len(self.system.states), len(self.system.measurements))
        check_shape("gains.injection", self.gains.injection, shape)

    @cached_property
    def observer(self) -> NormalFormObserver:
        """The observer."""
        return self.system.built(injection=self.gains.injection)

    @property
    def estimates(self) -> Mapping[str, tuple[NamedSignal, ...]]:
        """The state, and of the transformed form its coordinates."""
        if self.system.form == "identity":
            return super().estimates
        return {**super().estimates, "coordinates": numbered("coordinates", len(self.states))}

    def residual(self, y: Array, estimates: Estimates) -> Array:
        """y - h(x)."""
        read = self.observer.normal_form.problem.system.output
        residual: Array = y - np.array([read(row) for row in estimates["state"]])
        return residual

    def certify(self) -> Certificate:
        """Poles of the error in z, the smallest divisor of the series, the size of S beyond x."""
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
        known, system = self.certificate, self.system
        lines = [
            f"normal-form observer, {system.form} form, order {system.order}",
            f"poles: {pole_text(known['poles'])} 1/s, of the error in z = S(x)",
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
