"""Timestamps that are dates with times of day, by ISO 8601 (``2026-03-29T01:59:58.250Z``).

They are read as whole nanoseconds since 1970, and what an observer is given counts from an origin
near the first of them, so that no digit is lost. In text, digits beyond a microsecond are cut.
"""

from __future__ import annotations

import re
from collections.abc import Container
from datetime import UTC, datetime, timedelta

from reobserve.core.errors import InputError, shown

ISO = "iso8601"  # in the place of a unit
SECOND = 10**9  # [ns]

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_DATED = re.compile(r"\d{4}-?\d\d-?\d\d[T ]\d")  # a day and the beginning of an hour


def nanoseconds(text: str, form: str = "") -> int:
    """Nanoseconds since 1970 of a date by ISO 8601 or a format, of UTC where it states no offset.

    Raises
    ------
    ValueError
        If the text spells no day with a time of day.
    """
    if form:
        moment = datetime.strptime(text, form)  # without an offset it is one of UTC
    elif looks_dated(text):
        moment = datetime.fromisoformat(text)
    else:
        raise ValueError
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=UTC)
    return (moment - _EPOCH) // timedelta(microseconds=1) * 1000


def looks_dated(text: str) -> bool:
    """True if a text begins as a timestamp by ISO 8601 does."""
    return _DATED.match(text) is not None


def check_format(place: str, form: str) -> None:
    """Refuse a format that does not have the day and the time of day.

    Raises
    ------
    InputError
        If a date that is written and read by it is another one.
    """
    moment = datetime(2026, 3, 29, 13, 58)
    try:
        same = datetime.strptime(moment.strftime(form), form).replace(tzinfo=None) == moment
    except (ValueError, re.error):
        same = False
    if not same:
        problem = "must have the day and the time of day, as %d.%m.%Y %H:%M:%S"
        raise InputError(place, f"{shown(form)} {problem}")


def timestamp(
    cell: str, nothing: Container[str], place: str, where: str, form: str = ""
) -> int | None:
    """The timestamp [ns] in a cell, or None where it holds one of the words for ``nothing``.

    Messages call the file ``place``, and the cell ``where``.

    Raises
    ------
    InputError
        If it spells something else.
    """
    text = cell.strip().strip('"')
    try:
        return nanoseconds(text, form)
    except ValueError:
        if text in nothing:
            return None
        wanted = f"by columns.time.format, {form}" if form else (
            "with a time, as 2026-03-29T01:59:58Z; columns.time.format states another form"
        )  # fmt: skip
        raise InputError(place, f"{where} is {shown(cell)}, must be a date {wanted}") from None


def spelled(origin: int) -> str:
    """A number of seconds since 1970 as ISO 8601 has it."""
    return (_EPOCH + timedelta(seconds=origin)).strftime("%Y-%m-%dT%H:%M:%SZ")
