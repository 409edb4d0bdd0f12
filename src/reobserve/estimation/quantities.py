"""Units of columns, by pint: what they are, and the way from one to another."""

from __future__ import annotations

import math
import re
from functools import cache
from typing import Any, NamedTuple

from reobserve.core.errors import InputError, shown
from reobserve.core.extras import package

_LONGEST = 60  # characters
_MOST_POWERS = 1000  # multiplied: pint works out powers of numbers

_POWER = re.compile(r"\*\*|\^")
_RAISED = re.compile("[⁰¹²³⁴⁵⁶⁷⁸⁹⁻]+")
_DIGITS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
_NUMBER = r"[+-]?\s*(\d{1,4}|\d{0,4}\.\d{1,9})(?:\s*/\s*\d{1,4})?"
_EXPONENT = re.compile(rf"\s*(?:{_NUMBER}|\(\s*{_NUMBER}\s*\))(?!\w)\s*+(?![(\d._])")


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


@cache
def _registry() -> Any:
    import pint

    return pint.UnitRegistry(autoconvert_offset_to_baseunit=True, cache_folder=None)


@cache
def _parsed(text: str) -> Any:
    """The unit that a text names, or None if it is none."""
    pint = package("pint", "convert units")
    try:
        unit = _registry().parse_units(text)
        _registry().Quantity(1.0, unit).to_base_units()
    except (pint.errors.PintError, ValueError, TypeError, AttributeError, ArithmeticError):
        return None
    except Exception:  # of pint's tokenizer, which raises what Python's does
        return None
    return unit


def check_unit(place: str, text: str) -> None:
    """Refuse what is no unit.

    Raises
    ------
    InputError
        If pint, and so nobody, knows it; or it is one of a logarithm.
    """
    good = 0 < len(text) <= _LONGEST and text.isprintable() and text == text.strip()
    good = good and not _numeric(text) and _has_low_powers(text)
    unit = _parsed(text) if good else None
    if unit is None:
        problem = f"{shown(text)} is no unit that is known; rad/s, deg/s, N m, °C, V and 1 are some"
        raise InputError(place, problem)
    if not _registry().Quantity(1.0, unit)._is_multiplicative and _step(text) is None:
        raise InputError(place, f"{shown(text)} counts by a logarithm, which has no conversion")


def _has_low_powers(text: str) -> bool:
    """True if each exponent is a number, none is a power itself, and their product is small."""
    plain = _RAISED.sub(lambda found: f"**{found[0].translate(_DIGITS)}", text)
    *between, last = _POWER.split(plain)[1:] or [""]
    found = [_EXPONENT.match(rest) for rest in (*between, *[last] * bool(last))]
    whole = any(one is None or one.end() == len(one.string) for one in found[: len(between)])
    if whole or (last and found[-1] is None):
        return False
    powers = [float(one[1] or one[2]) for one in found if one is not None]
    return math.prod(max(1.0, power) for power in powers) <= _MOST_POWERS


def _numeric(text: str) -> bool:
    """True if text is a number other than 1, which pint would take for a unit of that size."""
    return text != "1" and text.replace(".", "", 1).isdigit()


def _step(text: str) -> float | None:
    """The size in kelvin, say, of a degree on a scale with an offset, or None for a logarithm."""
    try:
        quantity = _registry().Quantity
        at = [quantity(value, _parsed(text)).to_base_units().magnitude for value in (0.0, 1.0, 2.0)]
    except Exception:  # pint's, of which there are many
        return None
    even = abs((at[2] - at[1]) - (at[1] - at[0])) <= 1e-9 * abs(at[1] - at[0])
    return float(at[1] - at[0]) if even else None


def conversion(place: str, given: str, wanted: str) -> Conversion:
    """The conversion of a value in one unit into the other.

    Raises
    ------
    InputError
        If one is no unit, they are of different dimensions, or one counts turns and the other
        says only how often a second.
    """
    check_unit(place, given)
    check_unit(place, wanted)
    if given == wanted:
        return SAME
    one, other = _parsed(given), _parsed(wanted)
    if one.dimensionality != other.dimensionality:
        raise InputError(
            place,
            f"{shown(given)} cannot become {shown(wanted)}: "
            f"{one.dimensionality} is not {other.dimensionality}",
        )
    if _is_angular(one) != _is_angular(other) and "hertz" in str(one) + str(other):
        raise InputError(
            place,
            f"{shown(given)} cannot become {shown(wanted)}: hertz does not say whether turns or "
            "radians are counted; rpm and rad/s do",
        )
    quantity = _registry().Quantity
    zero = float(quantity(0.0, one).to(other).magnitude)
    factor = float(quantity(1.0, one).to(other).magnitude)
    return Conversion(factor - zero if zero else factor, zero)


def _is_angular(unit: Any) -> bool:
    return any(name in str(unit) for name in ("radian", "degree", "revolution", "turn"))
