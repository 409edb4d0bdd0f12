"""Timestamps that are dates with times of day, by ISO 8601 (``2026-03-29T01:59:58.250Z``).

They are read as whole nanoseconds since 1970, and what an observer is given counts from an origin
near the first of them, so that no digit is lost. In text, digits beyond a microsecond are cut.
"""

from __future__ import annotations

import re
from datetime import UTC, datetime, timedelta

from reobserve.core.errors import InputError, shown

ISO = "iso8601"  # in the place of a unit
SECOND = 10**9  # [ns]

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_DATED = re.compile(r"\d{4}-?\d\d-?\d\d[T ]\d")  # a day and the beginning of an hour


def nanoseconds(text: str) -> int:
    """Since 1970; a timestamp without an offset from UTC is one of UTC.

    Raises
    ------
    ValueError
        If the text spells no day with a time of day.
    """
    if not looks_dated(text):
        raise ValueError
    moment = datetime.fromisoformat(text)
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=UTC)
    return (moment - _EPOCH) // timedelta(microseconds=1) * 1000


def looks_dated(text: str) -> bool:
    """Whether a text begins as such a timestamp does."""
    return _DATED.match(text) is not None


def timestamp(cell: str, nothing: tuple[str, ...], title: str, row: int) -> int | None:
    """The timestamp [ns] in a cell; None where it holds one of the words for ``nothing``.

    Raises
    ------
    InputError
        If it spells something else.
    """
    text = cell.strip().strip('"')
    try:
        return nanoseconds(text)
    except ValueError:
        if text in nothing:
            return None
        problem = f"row {row} is {shown(cell)}, must be a date with a time, as 2026-03-29T01:59:58Z"
        raise InputError(title, problem) from None


def spelled(origin: int) -> str:
    """A number of seconds since 1970 as ISO 8601 has it."""
    return (_EPOCH + timedelta(seconds=origin)).strftime("%Y-%m-%dT%H:%M:%SZ")
