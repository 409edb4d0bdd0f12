"""The units of a parameter file: those that a paper declares for its keys, beside shape and sign.

    initial_rate: Annotated[list[float], vector(3), Unit("rad/s")]

A key without a declared unit may have any.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Annotated, Any, get_args, get_type_hints

from reobserve.core.errors import InputError, shown
from reobserve.core.units import check_unit, same
from reobserve.core.validation import Positive, Window
from reobserve_papers.parameters.parameters import Parameters, leaves

_NO_UNITS = ("word", "file", "name")  # in place of a unit, of text

# Of times, frequencies, phases and clocks in the terms of a signal.
TIMING = ("s", "rad/s", "rad", "Hz")


class Unit:
    """The unit of a key as it is written, with commas or ``to`` between those of components.

    Entries have it, or one of several, in any spelling, but no multiple of it: numbers are taken as
    they stand. Those of a signal list the units in its terms: its own, and some ``beside`` it.
    """

    def __init__(self, *allowed: str, beside: Sequence[str] = ()) -> None:
        self.allowed, self.beside = allowed, beside

    def __str__(self) -> str:
        beside = f", with {', '.join(self.beside)} in its terms" if self.beside else ""
        return " or ".join(self.allowed) + beside

    def fits(self, text: str) -> bool:
        """True if an entry may have this unit."""
        units, wanted = _units(text), [_units(other) for other in self.allowed]
        if self.beside:
            own = [one for (one,) in wanted]
            found = {_like(unit, (*own, *self.beside)) for unit in units}
            return None not in found and not found.isdisjoint(own)
        return units in wanted or any(
            len(units) == len(one) and all(map(same, units, one)) for one in wanted
        )


class UnitBy(Unit):
    """The unit of a key where another key of its branch, such as a model, decides which it is."""

    def __init__(self, key: str, units: Mapping[str, Unit]) -> None:
        super().__init__(*(text for unit in units.values() for text in unit.allowed))
        self.key, self.units = key, units


PURE, SECONDS, PER_SECOND = Unit("1"), Unit("s"), Unit("1/s")
Duration = Annotated[Positive, SECONDS]
Span = Annotated[Window, SECONDS]


def check_units(parameters: Parameters, stated: Any) -> None:
    """Refuse units other than those of the types of ``stated``, the same parameters as types."""
    for key, entry in parameters.entries():
        place, unit = f"{parameters.paper}.{key}.unit", entry["unit"]
        branch, *path = stated, *key.split(".")
        for name in path[:-1]:
            branch = branch[name] if isinstance(branch, Mapping) else getattr(branch, name)
        declared = _declared(branch.__class__).get(path[-1])
        values = [value for _, value in leaves(entry["value"])]
        if isinstance(declared, UnitBy):
            declared = declared.units[getattr(branch, declared.key)]
        if declared is not None:
            if not declared.fits(unit):
                raise InputError(place, f"{shown(unit)} must be {declared}")
        elif values and all(isinstance(value, str | bool) for value in values):
            if unit not in (*_NO_UNITS, "1"):
                raise InputError(place, f"{shown(unit)} must be word; the value is no number")
        elif unit not in _NO_UNITS:
            for one in _units(unit):
                check_unit(place, one)


def _units(text: str) -> list[str]:
    """The units in a text, with base units for y and u, which stand for any that are not stated."""
    return re.split(", | to ", re.sub(r"\by\b", "cd", re.sub(r"\bu\b", "mol", text)))


def _like(unit: str, others: Sequence[str]) -> str | None:
    """The unit of several that is the same, preferably as a text."""
    return next((one for one in sorted(others, key=unit.__ne__) if same(unit, one)), None)


@cache
def _declared(kind: Any) -> dict[str, Unit | None]:
    """The units of the keys of a branch."""
    return {key: _unit_in(hint) for key, hint in get_type_hints(kind, include_extras=True).items()}


def _unit_in(hint: Any) -> Unit | None:
    """The outermost unit in a type."""
    parts = get_args(hint)
    found = [part for part in parts if isinstance(part, Unit)]
    return found[-1] if found else next(filter(None, map(_unit_in, parts)), None)
