"""Timestamps that are dates, by ISO 8601 (``2026-03-29T01:59:58.250Z``) or a stated format.

They are read as whole nanoseconds since 1970, and what an observer is given counts from an origin
near the first of them, so that no digit is lost. In text, digits beyond a microsecond are cut.
"""

from __future__ import annotations

import re
from datetime import UTC, date, datetime, timedelta, tzinfo
from decimal import Decimal
from functools import cache
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from reobserve.core.errors import InputError, shown

ISO, DURATION = "iso8601", "duration"  # in the place of a unit
SECOND = 10**9  # [ns]

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_DATED = re.compile(r"\d{4}-?\d\d-?\d\d[T ]\d|\d{4}-\d\d-\d\d$")  # a day, and perhaps an hour
# Hours that may pass 24, minutes and seconds, perhaps with days.
SPELLED_DURATION = re.compile(
    r"([+-]?)(?:(\d+)(?: ?d(?:ays?)?,? ?|\.))?(\d+):([0-5]\d):([0-5]\d(?:\.\d*)?)", re.ASCII
)
_DIGITS = re.compile(r"((?:%[HMSIdmyj]){2,}(?:%f)?|(?<![.,])%f)")  # without marks between
_FINE = re.compile(r"([.,:]\d{6})\d+", re.ASCII)  # than a microsecond
_MIDNIGHT = re.compile(  # at the end of a day
    r"(?<![\d:.,-])24(?=:?00(?::?00(?:[.,]0+)?)?(?:Z| ?[+-]\d\d:?\d\d)?$)"
)
# Of each day of the year on which clocks are put forward, one zone that many live in.
_FORWARD = (
    "Europe/Berlin", "Europe/London", "Europe/Athens", "America/New_York", "Australia/Sydney",
    "Pacific/Auckland", "America/Santiago", "Asia/Jerusalem", "Africa/Cairo", "Asia/Beirut",
)  # fmt: skip


def moment(text: str, form: str) -> datetime:
    """The moment of a date by ISO 8601 or a format (raises ValueError if it is none)."""
    text = _padded(text, form) if form else text
    text, midnights = _MIDNIGHT.subn("00", text) if "24" in text else (text, 0)
    if not form and not looks_dated(text):
        raise ValueError
    date = datetime.strptime(text, form) if form else datetime.fromisoformat(text)
    return date + timedelta(days=midnights)


def _padded(text: str, form: str) -> str:
    """A date with zeros that numbers lack in front, and without digits beyond a microsecond.

    They may lack in 110 for 01:10 by %H%M, and in 5 ms by %f, but behind a point or comma.
    """
    pattern, widths = _numbers(form)
    match = pattern.fullmatch(text) if len(widths) > 1 else None
    text = text if match is None else "".join(map(str.zfill, match.groups(), widths))
    return _FINE.sub(r"\1", text) if "%f" in form else text


@cache
def _numbers(form: str) -> tuple[re.Pattern[str], list[int]]:
    """The split of a date at numbers that may lack zeros, and their digits."""
    parts = _DIGITS.split(form)
    between = [".+?".join(map(re.escape, re.split("%.", part))) for part in parts[::2]]
    widths = [k % 2 * (len(part) + len(re.findall("[jf]", part))) for k, part in enumerate(parts)]
    return re.compile("(" + r")(\d+)(".join(between) + ")"), widths


def seconds_of(duration: str) -> str:
    """The seconds of a duration, with all their digits (raises ValueError if it is none)."""
    match = SPELLED_DURATION.fullmatch(duration)
    if match is None:
        raise ValueError
    sign, days, hours, minutes, seconds = match.groups()
    whole = 86400 * int(days or 0) + 3600 * int(hours) + 60 * int(minutes)
    return f"{sign}{whole + Decimal(seconds)}"


def since_1970(date: datetime) -> int:
    """Nanoseconds since 1970."""
    return (date - _EPOCH) // timedelta(microseconds=1) * 1000


def of_nanoseconds(timestamp: int) -> datetime:
    """The date of nanoseconds since 1970, in UTC, whose last three digits are cut."""
    return _EPOCH + timedelta(microseconds=timestamp // 1000)


def looks_dated(text: str) -> bool:
    """True if a text begins as a timestamp by ISO 8601 does."""
    return _DATED.match(text) is not None


@cache
def time_zone(name: str) -> tzinfo:
    """The time zone of a name, as Europe/Berlin, or of an offset, as +01:00.

    Raises
    ------
    InputError
        If zoneinfo knows none of this name.
    """
    try:
        if re.fullmatch(r"[+-]\d\d:\d\d", name):
            return datetime.strptime(name, "%z").tzinfo or UTC
        return ZoneInfo(name)
    except (ZoneInfoNotFoundError, OSError, ValueError):
        problem = f"{shown(name)} must be a time zone, as Europe/Berlin, UTC or +01:00"
        raise InputError("zone", problem) from None


def skipping_zone(before: datetime, after: datetime) -> str:
    """A time zone whose clocks skip the hour between two local times, or nothing."""
    hour = before.replace(minute=0, second=0, microsecond=0, tzinfo=None) + timedelta(hours=1)
    if hour > after.replace(tzinfo=None) - timedelta(hours=1):
        return ""
    for name in _FORWARD:
        try:
            zone = time_zone(name)
        except InputError:  # without a database of zones
            continue
        first, second = (since_1970(hour.replace(tzinfo=zone, fold=fold)) for fold in (0, 1))
        if first > second:
            return name
    return ""


def check_day(place: str, day: str, form: str) -> None:
    """Refuse what is no day, and a day where there is no format of times of day.

    Raises
    ------
    InputError
        If it does not spell a day as 2026-03-29, or the format has the day.
    """
    try:
        date.fromisoformat(day)
    except ValueError:
        raise InputError(place, f"{shown(day)} must be a day, as 2026-03-29") from None
    if not form or re.search(r"%[-a-zA-Z]*[djyYcxuUwWGVmbBz]", form):
        problem = "is for a format of times of day alone, as %H:%M:%S, and else to be left out"
        raise InputError(place, problem)


def check_format(place: str, form: str, of_day: bool = False) -> None:
    """Refuse a format that does not have the day, and may have more, or just times ``of_day``.

    Raises
    ------
    InputError
        If a date that is written and read by it is another one, but for digits that it leaves out.
    """
    stamp = datetime(2026, 3, 29, 13, 58, 43, tzinfo=UTC)
    others = [stamp.replace(second=0), stamp.replace(minute=0, second=0)]
    others.append(datetime(2026, 3, 29, tzinfo=UTC))
    try:
        read = datetime.strptime(stamp.strftime(form), form)
        if of_day:
            read = datetime.combine(stamp, read.timetz())
        same = read.replace(tzinfo=read.tzinfo or UTC) in (stamp, *others) and "%Z" not in form
    except (ValueError, re.error):
        same = False
    if not same:
        problem = "must have the day, and hours before minutes, as %d.%m.%Y %H:%M:%S, and no %Z"
        hint = "; of times of day alone, columns.time.day states the first day" * (not of_day)
        raise InputError(place, f"{shown(form)} {problem}{hint}")


def spelled(timestamp: int, zone: str = "UTC", digits: int | None = None) -> str:
    """Nanoseconds since 1970 as ISO 8601 has them, by clocks of a zone, of none without an offset.

    Of seconds there are 0, 6 or 9 ``digits`` behind the point, or as many as there are not zero.
    """
    moment = of_nanoseconds(timestamp)
    moment = moment.astimezone(time_zone(zone)) if zone else moment.replace(tzinfo=None)
    fraction = f".{timestamp % SECOND:09d}"
    fraction = fraction.rstrip("0").rstrip(".") if digits is None else fraction[: digits + 1]
    offset = "Z" if zone == "UTC" else offset_of(moment)
    return moment.isoformat()[:19] + ("" if digits == 0 else fraction) + offset


def offset_of(date: datetime) -> str:
    """The offset of a date, such as +02:00, or nothing."""
    return date.isoformat()[19:].lstrip(".0123456789")
