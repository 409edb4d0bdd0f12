"""How far a golden number may be off: what was seen on other processors and on halving steps.

Neither part is a matter of taste. Rounding is ten times the largest deviation that was seen under
any of `processors`, rounded up to 1, 2 or 5; the step is twice the change on halving every
numerical step, rounded up to two digits, since it is what decides how small a change is noticed.
Both are kept as they are while what is seen anew leaves them right, so that renewing where nothing
has changed changes nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

MARGIN = 10  # over what was seen: processors differ that could not be emulated
_SPARE = 2  # a kept tolerance may be this much too small against `MARGIN`
_GENEROUS = 100  # and this much too large

# Some thousand units in the last place of the largest number of a column: what a processor may do
# to a number that no emulated one moves.
_RELATIVE_FLOOR = 1e-12
_ABSOLUTE_FLOOR = 1e-15  # and of one, where what is kept is a zero but for rounding

# A number is determined if rounding moves it by no more than a millionth of itself. What is so
# small that it is nothing but rounding is determined, too: by its bound.
_DETERMINED = 1e-6
_ROUNDING_ALONE = 1e-9


@dataclass(frozen=True)
class Tolerance:
    """Two parts in the unit of the number; a ``step`` of 0 is below the rounding."""

    rounding: float
    step: float = 0.0

    @property
    def allowed(self) -> float:
        """How far off a number may be: the larger part."""
        return max(self.rounding, self.step)


def measured(moved: float, halved: float, size: float, kept: Tolerance | None = None) -> Tolerance:
    """The tolerance of a number, or of a column, of this largest ``size``.

    ``moved`` is the largest deviation seen on another processor, ``halved`` that on halving every
    step; ``kept`` is the tolerance that it has, which stays if it is right.
    """
    rounding = max(MARGIN * moved, _RELATIVE_FLOOR * size, _ABSOLUTE_FLOOR)
    if kept is None or not rounding / _SPARE <= kept.rounding <= _GENEROUS * rounding:
        rounding = rounded_up(rounding)
    else:
        rounding = kept.rounding
    step = 2 * halved
    if kept is not None and kept.step == 0 and step <= _SPARE * rounding:
        step = 0.0
    elif kept is not None and step / _SPARE <= kept.step <= _GENEROUS * step:
        step = kept.step
    else:
        step = 0.0 if step <= rounding else two_digits_up(step)
    return Tolerance(rounding, step)


def determined(moved: float, size: float, *, before: bool = True) -> bool:
    """Whether a number of this ``size`` that rounding moves so far can be kept at all.

    What was found undetermined ``before`` must move ten times less to be kept again.
    """
    limit = _DETERMINED if before else _DETERMINED / 10
    return moved <= max(limit * size, _ROUNDING_ALONE)


def rounded_up(value: float) -> float:
    """The next of 1, 2, 5 times a power of ten that is not below a positive ``value``."""
    if not 0 < value < math.inf:
        return value
    power = math.floor(math.log10(value)) - 1
    steps = (float(f"{digit}e{power + more}") for more in range(3) for digit in (1, 2, 5))
    return next(step for step in steps if step >= value)


def two_digits_up(value: float) -> float:
    """The next number of two digits that is not below a positive ``value``."""
    if not 0 < value < math.inf:
        return value
    power = math.floor(math.log10(value)) - 1
    digits = math.floor(value / 10.0**power)
    return next(up for more in range(3) if (up := float(f"{digits + more}e{power}")) >= value)
