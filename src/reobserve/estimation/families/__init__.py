"""Families of observers: how each is declared, designed, run on a record and exported.

A family is one module with one class, a `reobserve.estimation.observer_design.Design`. The table
below is the only list of them.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from reobserve.core.errors import InputError, shown

if TYPE_CHECKING:
    from reobserve.estimation.observer_design import Design

# By name: the module here and its class, imported when the family is asked for.
FAMILIES = {
    "kalman": "kalman:KalmanDesign",
    "luenberger": "luenberger:LuenbergerDesign",
    "augmented-kalman": "augmented_kalman:AugmentedKalmanDesign",
    "extended-kalman": "extended_kalman:ExtendedKalmanDesign",
    "unscented-kalman": "unscented_kalman:UnscentedKalmanDesign",
    "svsf": "svsf:SvsfDesign",
    "imm": "imm:ImmDesign",
    "fault-bank": "fault_bank:FaultBankDesign",
    "delay-grid": "delay_grid:DelayGridDesign",
    "eso": "eso:EsoDesign",
    "normal-form": "normal_form:NormalFormDesign",
    "high-gain": "high_gain:HighGainDesign",
    "extended-high-gain": "extended_high_gain:ExtendedHighGainDesign",
    "ilo": "ilo:IloDesign",
    "adaptive": "adaptive:AdaptiveDesign",
    "levant": "levant:LevantDesign",
}


def family(name: Any, place: str = "kind") -> type[Design]:
    """The class of a family."""
    if not isinstance(name, str) or name not in FAMILIES:
        raise InputError(place, f"{shown(name)} must be one of {', '.join(FAMILIES)}")
    module, _, attribute = FAMILIES[name].partition(":")
    kind: type[Design] = getattr(import_module(f"{__name__}.{module}"), attribute)
    return kind


def name_of(kind: type[Design]) -> str:
    """The name of a family by its class.

    Raises
    ------
    InputError
        If it is not in the table.
    """
    address = f"{kind.__module__}:{kind.__qualname__}"
    for name, where in FAMILIES.items():
        if f"{__name__}.{where}" == address:
            return name
    raise InputError("design", f"{shown(kind.__name__)} must be a design of a family that there is")
