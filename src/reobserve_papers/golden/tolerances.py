"""Tolerances of golden numbers, from other processors and from half the steps.

The tolerance of a number is the largest of

- ten times the largest change of its column as on other processors (`conditions`),
- twice its own change when every numerical step is halved,
- a rounding error of 1e-12 of the largest number of the column.

A number is not determined if that is more than one per cent of the largest number, or if another
processor moves the column by more than a millionth. Such a number would not notice a parameter
that is wrong by one per cent: it is listed with three digits, for pages that quote it, and not
compared. What is zero but for rounding, below a millionth of its unit, is determined by its bound.
"""

from __future__ import annotations

import math

MARGIN = 10  # over what was seen: not every processor can be emulated
_STEP_MARGIN = 2
_RELATIVE_ROUNDING = 1e-12
_ABSOLUTE_ROUNDING = 1e-15

_MAX = 1e-2  # a tolerance, of the size of the column
_MAX_BY_PROCESSOR = 1e-6
_NEARLY_ZERO = 1e-6  # in the unit of the number


def tolerance(size: float, moved: float, halved: float) -> float | None:
    """The tolerance of a number, rounded up to two digits, or None if it is not determined.

    ``size`` is the largest number of its column, ``moved`` the largest change of that on another
    processor, ``halved`` the change of the number with every step halved.
    """
    rounding = max(_RELATIVE_ROUNDING * size, _ABSOLUTE_ROUNDING)
    allowed = max(MARGIN * moved, _STEP_MARGIN * halved, rounding)
    if not is_determined(size, moved, allowed):
        return None
    return two_digits_up(allowed)


def is_determined(size: float, moved: float, allowed: float) -> bool:
    """True if a number with this tolerance says anything, in a column of this size."""
    if size + allowed <= _NEARLY_ZERO:
        return True
    return allowed <= _MAX * size and moved <= _MAX_BY_PROCESSOR * size


def two_digits_up(value: float) -> float:
    """The next number of two digits that is not below a positive ``value``."""
    power = math.floor(math.log10(value)) - 1
    digits = math.floor(value / 10.0**power)
    return next(up for more in range(3) if (up := float(f"{digits + more}e{power}")) >= value)
