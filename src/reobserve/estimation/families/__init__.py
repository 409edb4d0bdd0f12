"""Families of observers: how each is declared, designed, run on a record and exported.

A family is one module with one class, a `reobserve.estimation.families.design.Design`. The table
below is the only list of them. A package of a user's adds one by an entry point of the group
``reobserve.families``, with the name of the family and ``module:Class``.
"""

from __future__ import annotations

from importlib import import_module, metadata
from typing import TYPE_CHECKING, Any

from reobserve.core.errors import InputError, one_line, shown

if TYPE_CHECKING:
    from reobserve.estimation.families.design import Design

GROUP = "reobserve.families"  # of entry points

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
    """The class of a family.

    Raises
    ------
    InputError
        If there is none of that name.
    """
    found: type[Design]
    if isinstance(name, str) and name in FAMILIES:
        module, _, attribute = FAMILIES[name].partition(":")
        found = getattr(import_module(f"{__name__}.{module}"), attribute)
        return found
    added = metadata.entry_points(group=GROUP)
    for entry in added:
        if entry.name == name:
            try:
                found = entry.load()
            except Exception as error:
                problem = f"{name} ({entry.value}) cannot be imported: {one_line(error)}"
                raise InputError(place, problem) from error
            return found
    names = (*FAMILIES, *(entry.name for entry in added))
    problem = f"{shown(name)} must be one of {', '.join(names)}"
    raise InputError(place, problem)


def name_of(kind: type[Design]) -> str:
    """The name of a family by its class.

    Raises
    ------
    InputError
        If it is in no table.
    """
    named = f"{kind.__module__}:{kind.__qualname__}"
    tables = {
        **{name: f"{__name__}.{where}" for name, where in FAMILIES.items()},
        **{entry.name: entry.value for entry in metadata.entry_points(group=GROUP)},
    }
    for name, where in tables.items():
        if where == named:
            return name
    raise InputError("design", f"{shown(kind.__name__)} must be a design of a family that there is")
