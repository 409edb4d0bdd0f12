"""Stamps that are dates with times of day, as ISO 8601 spells them: ``2026-03-29T01:59:58.250Z``.

They are counted in seconds since 1970, and by the observer's clock from the ``origin``, the whole
second at or before the first of them. As double numbers they are known to 0.3 us until 2038.
"""

from __future__ import annotations

import math
from datetime import UTC, datetime, timedelta

from reobserve.errors import InputError, shown

ISO = "iso8601"  # in the place of a unit

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def seconds(text: str) -> float:
    """Seconds [s] since 1970; a stamp without an offset from UTC is one of UTC.

    Raises
    ------
    ValueError
        If the text spells no such stamp.
    """
    moment = datetime.fromisoformat(text)
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=UTC)
    return (moment - _EPOCH).total_seconds()


def stamp(cell: str, nothing: tuple[str, ...], title: str, row: int) -> float:
    """The stamp in a cell of text; nan where the cell holds one of the words for ``nothing``.

    Raises
    ------
    InputError
        If it spells something else.
    """
    text = cell.strip().strip('"')
    try:
        return seconds(text)
    except (ValueError, OverflowError):
        if text in nothing:
            return math.nan
        problem = f"row {row} is {shown(cell)}, must be a date with a time, as 2026-03-29T01:59:58Z"
        raise InputError(title, problem) from None


def origin_of(first: float) -> float:
    """The origin [s since 1970] of a record whose first stamp this is."""
    return float(math.floor(first))


def spelled(origin: float) -> str:
    """An origin as ISO 8601 has it."""
    return (_EPOCH + timedelta(seconds=origin)).strftime("%Y-%m-%dT%H:%M:%SZ")
