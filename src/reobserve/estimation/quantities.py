"""Conversions of columns from one unit into another, by pint."""

from __future__ import annotations

import itertools
import math
from functools import cache
from typing import Any, NamedTuple

from reobserve.core.errors import InputError, shown
from reobserve.core.units import angles, check_unit, is_affine, readings, registry

# In which rates are stated, of events as well as of turns and radians.
_COUNTING = {"minute", "hour", "hertz", "count", "bit", "percent"}


class Conversion(NamedTuple):
    """A value less ``zero``, times ``factor``, plus ``offset``, skipping what does nothing."""

    factor: float
    offset: float
    zero: float = 0.0

    def of(self, values: Any) -> Any:
        """A number or an array in the other unit."""
        if self.zero:
            values = values - self.zero
        if self.factor != 1.0:
            values = values * self.factor
        return values + self.offset if self.offset else values


SAME = Conversion(1.0, 0.0)


def conversion(place: str, given: str, wanted: str) -> Conversion:
    """The conversion of a value in one unit into the other.

    A unit that can be read in two ways is read in the one that can be converted.

    Raises
    ------
    InputError
        If one is no unit, they are of different dimensions, both ways of reading one can be
        converted, or one counts turns or radians and the other does not say which.
    """
    check_unit(place, given)
    check_unit(place, wanted)
    if given == wanted:
        return SAME
    pairs = _pairs(given, wanted)
    failed = f"{shown(given)} cannot become {shown(wanted)}"
    if not pairs:
        one, other = readings(given)[0].dimensionality, readings(wanted)[0].dimensionality
        why = "one of them has no conversion" if one == other else f"{one} is not {other}"
        raise InputError(place, f"{failed}: {why}")
    clear = [(unit, other) for unit, other in pairs if not _is_unclear(unit, other)]
    if not clear:
        bare = shown(given if angles(pairs[0][1]) else wanted)
        problem = f"{bare} does not say whether turns or radians are counted, as rpm and rad/s do"
        raise InputError(place, f"{failed}: {problem}")
    ways = {way: pair for pair in clear if (way := _way(*pair)) is not None}
    if len({(f"{way.factor:.9g}", f"{way.offset:.9g}") for way in ways}) > 1:
        meant = " or ".join(f"{unit} to {other}" for unit, other in ways.values())
        raise InputError(place, f"{failed}, as this may be {meant}; name the unit in full")
    return next(iter(ways))


def agree(title: str, stated: str) -> bool:
    """True if a unit in a title may be the stated one. The title's may leave open what is counted.

    An unknown one may be any.
    """
    if title == stated or not readings(title):
        return True
    turn = registry().Unit("turn")
    pairs = _pairs(title, stated)
    if any(_is_unclear(unit, other) for unit, other in pairs):
        pairs += [(unit * turn, other) for unit, other in pairs if not angles(unit)]
    return any(
        math.isclose(way.factor, 1.0, rel_tol=1e-12) and not way.offset
        for way in itertools.starmap(_way, pairs)
        if way is not None
    )


def _pairs(given: str, wanted: str) -> list[tuple[Any, Any]]:
    return [
        (unit, other)
        for unit, other in itertools.product(readings(given), readings(wanted))
        if unit.dimensionality == other.dimensionality and _way(unit, other) is not None
    ]


@cache
def _way(unit: Any, other: Any) -> Conversion | None:
    """The conversion of one unit of pint into another, None if it has none."""
    quantity = registry().Quantity
    if not (is_affine(unit) and is_affine(other)):
        return None
    try:
        zero = float(quantity(0.0, unit).to(other).magnitude)
        factor = float(quantity(1.0, unit).to(other).magnitude)
    except Exception:  # pint's, of which there are many
        return None
    way = Conversion(factor - zero if zero else factor, zero)
    return way if math.isfinite(way.factor + way.offset) and way.factor else None


@cache
def _is_unclear(unit: Any, other: Any) -> bool:
    """True if one counts turns or radians, and the other does not say which.

    That radians are left out, as in N m s for N m s/rad, is clear.
    """
    if angles(unit) == angles(other):
        return False
    angular, bare = (unit, other) if angles(unit) else (other, unit)
    rate = set(bare.dimensionality) == {"[time]"}
    turns = any(name != "radian" and angles(registry().Unit(name)) for name in _names(angular))
    return rate or bool(_names(bare) & _COUNTING) or angles(bare) != 0 or turns


@cache
def _names(unit: Any) -> frozenset[str]:
    """Names of the factors of a unit, as it is written and in base units, without prefixes."""
    parts = [registry().parse_unit_name(name)[0][1] for name in unit._units]
    return frozenset([*parts, *registry().get_root_units(unit)[1]._units])
