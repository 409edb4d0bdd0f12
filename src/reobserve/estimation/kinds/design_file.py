"""An observer from a design file, with the names and units that are stated there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from reobserve.core.errors import InputError
from reobserve.core.matrices import FloatArray
from reobserve.estimation.designs.design import Design
from reobserve.estimation.designs.file import load_design
from reobserve.estimation.kinds.extended_state import eso_residual
from reobserve.estimation.kinds.linear import imm_setup, linear_setup
from reobserve.estimation.kinds.nonlinear import (
    extended_high_gain_setup,
    high_gain_setup,
    levant_setup,
    normal_form_setup,
)
from reobserve.estimation.kinds.rigid_body import rigid_body_setup
from reobserve.estimation.kinds.setup import Setup
from reobserve.observers.extended_high_gain import ExtendedHighGainObserver
from reobserve.observers.extended_state import ExtendedStateObserver
from reobserve.observers.high_gain import HighGainObserver
from reobserve.observers.imm import IMM
from reobserve.observers.levant import LevantDifferentiator
from reobserve.observers.linear_filter import LinearFilter
from reobserve.observers.normal_form_observer import NormalFormObserver
from reobserve.observers.rigid_body_observer import RigidBodyObserver

Array = FloatArray


@dataclass(frozen=True)
class DesignFile:
    """What `reobserve design` wrote, by its path; its gains are certified again."""

    kind: Literal["design"]
    file: str

    def set_up(self, period: float) -> Setup:
        """The observer, if it is one of this sampling period."""
        design = load_design(Path(self.file))
        observer = design.observer
        if abs(observer.sampling_period - period) > 1e-9 * period:
            raise InputError(
                "file", f"{self.file} is of a sampling period of {observer.sampling_period:g} s, "
                f"sampling.period says {period:g} s",
            )  # fmt: skip
        return from_design(design)


def from_design(design: Design) -> Setup:
    """What a design offers, as estimation takes it; the one place that knows both."""
    observer = design.observer

    def start(y: Array) -> Any:
        found = design.start()
        return observer._start(y) if found is None else found

    made = next(
        (set_up(observer, start) for kind, set_up in _SETUPS if isinstance(observer, kind)),
        Setup(observer, start),
    )
    measured, known = (
        tuple(unit for _, unit in signals) for signals in (design.measurements, design.inputs)
    )
    estimates = design.estimates
    return replace(
        made, measured=measured if all(measured) else (), known=known if all(known) else (),
        units={name: tuple(unit for _, unit in parts) for name, parts in estimates.items()},
        names={name: tuple(label for label, _ in parts) for name, parts in estimates.items()},
        widths=((len(measured),), (len(known),)),
    )  # fmt: skip


def _eso_setup(observer: ExtendedStateObserver, start: Callable[[Array], Any]) -> Setup:
    return Setup(observer, start, eso_residual(observer.system))


_SETUPS: tuple[tuple[type, Callable[..., Setup]], ...] = (
    (LinearFilter, linear_setup),
    (IMM, imm_setup),
    (RigidBodyObserver, rigid_body_setup),
    (NormalFormObserver, normal_form_setup),
    (LevantDifferentiator, levant_setup),
    (ExtendedStateObserver, _eso_setup),
    (HighGainObserver, high_gain_setup),
    (ExtendedHighGainObserver, extended_high_gain_setup),
)
