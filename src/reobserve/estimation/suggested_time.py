"""The columns that look like timestamps, and how they are written."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from datetime import datetime
from itertools import pairwise, product
from typing import Any

from reobserve.core.errors import InputError
from reobserve.core.units import readings
from reobserve.estimation.dates import ISO, looks_dated
from reobserve.estimation.layout import split_title
from reobserve.estimation.quantities import conversion

DAY = re.compile(r"\d{1,4}([-./])\d\d?\1\d{1,4}|\d\d?([-./ ])[A-Z][a-z]{2}\2\d{2,4}")
HOUR = re.compile(r"\d\d?:\d\d?(:\d\d?([.,]\d+)?)?( ?[AaPp][Mm])?")
DATE = re.compile(rf"(?:{DAY.pattern})[T ,_]{{1,2}}(?:{HOUR.pattern})(Z| ?[+-]\d\d:?\d\d)?")
_HALF = re.compile(r"[AaPp][Mm]")  # of a day
_DASHED = re.compile(r"\d{4}-\d\d-\d\d([-_T ])\d\d-\d\d-\d\d")
_COMPACT = re.compile(r"(19|20)\d\d[01]\d[0-3]\d([0-2]\d){0,1}([0-5]\d){0,2}")
_TITLE = re.compile(
    r"time|zeit|stamp|epoch|date|datum|hora|fecha|^t$|^t[\W_]|(?<![a-z])m?s(ec)?$", re.IGNORECASE
)
_EPOCHS = ((1e17, "ns"), (1e14, "us"), (1e11, "ms"))
_PARTS = ((1, 12), (1, 31), (0, 23), (0, 59), (0, 59))  # month, day, hour, minute, second
_HOURS = (
    "%H:%M", "%H:%M:%S", "%H:%M:%S.%f", "%H:%M:%S,%f", "%I:%M %p", "%I:%M:%S %p", "%I:%M%p",
    "%I:%M:%S%p",
)  # fmt: skip
_FORMS = ("%Y", "%m", "%d", "%H", "%M", "%S")
_FEW = 9  # cells that rise by chance
_LOOKED_AT = 2000  # cells of a column

Column = Sequence[str]


def find_time(
    titles: Sequence[str],
    columns: Sequence[Column],
    number: Callable[[str], float | None],
    notes: list[str],
) -> dict[str, Any]:
    """The key `time`, if columns look like timestamps.

    Parameters
    ----------
    titles, columns
        Of a text, with cells of as many rows each; those that are more than the other have no pair.
    number
        Reads a cell, None if it is no number.
    notes
        Takes what is in doubt.
    """
    some = [list(column[:_LOOKED_AT]) for column in columns[: len(titles)]]
    titles = titles[: len(some)]
    dated = [k for k, cells in enumerate(some) if _all(DATE, cells) or _all(_DASHED, cells)]
    dated += [k for k, cells in enumerate(some) if _all(_COMPACT, cells) and _rises(cells, float)]
    for k in dated:
        if time := _dated(titles[k], some[k], notes):
            return time
    for k, cells in enumerate(some):
        if not _all(DAY, cells):
            continue
        if k + 1 < len(some) and _all(HOUR, some[k + 1]):
            parts = 3 if k + 2 < len(some) and _all(_HALF, some[k + 2]) else 2
            joined = list(map(" ".join, zip(*some[k : k + parts], strict=True)))
            if time := _dated("", joined, notes):
                return {**time, "column": list(titles[k : k + parts])}
        elif time := _dated(titles[k], cells, notes):
            return time
    return (
        _in_parts(titles, some, number)
        or _of_day(titles, some, notes)
        or _numbered(titles, some, number, notes)
    )


def _of_day(titles: Sequence[str], columns: Sequence[Column], notes: list[str]) -> dict[str, Any]:
    """The first column of times of day, if there is no day beside it."""
    for title, cells in zip(titles, columns, strict=True):
        known = [cell for cell in cells if cell]
        if _all(HOUR, cells):
            form = next((f for f in _HOURS if all(_read(f, cell) for cell in known)), "")
            if form:
                notes.append(f"{title!r} has times of day; columns.time.day states the first day")
                return {"column": title, "format": form}
    return {}


def _all(form: re.Pattern[str], cells: Column) -> bool:
    """True if a form is that of nearly all cells that are not empty."""
    known = [cell for cell in cells if cell]
    fit = sum(form.fullmatch(cell) is not None for cell in known)
    return len(known) > 0.5 * len(cells) and fit > 0.9 * len(known)


def _rises(cells: Column, number: Callable[[str], float | None], named: bool = False) -> bool:
    """True if cells are numbers that never fall, and mostly rise.

    Where a column is ``named`` as time, some may fall, and many be repeated.
    """
    read = [number(cell) for cell in cells if cell]
    known = [value for value in read if value is not None]
    if len(known) < max(2.0, 0.9 * len(cells)):
        return False
    falls = sum(a > b for a, b in pairwise(known))
    rises = sum(a < b for a, b in pairwise(known))
    if named:
        return falls <= 0.02 * len(known) and rises >= 0.05 * len(known)
    return len(known) > _FEW and falls == 0 and rises >= 0.5 * (len(known) - 1)


def _numbered(
    titles: Sequence[str],
    columns: Sequence[Column],
    number: Callable[[str], float | None],
    notes: list[str],
) -> dict[str, Any]:
    """The column of numbers that looks most like time."""
    names = [_TITLE.search(re.sub(r"[^\w ].*", "", title).strip()) for title in titles]
    rising = [k for k, cells in enumerate(columns) if _rises(cells, number, names[k] is not None)]
    rising = [k for k in rising if not _is_clock(columns[k], number)]
    rising = [k for k in rising if not _is_quantity(titles[k])]
    named = [k for k in rising if names[k] is not None]
    largest = [k for k in rising if (number(columns[k][0]) or 0.0) > 1e8]
    chosen = next(iter([*(k for k in named if k in largest), *named, *largest, *rising]), None)
    if chosen is None:
        notes.append("no column looks like timestamps; without one, rows are one period apart")
        return {}
    first = number(next(filter(None, columns[chosen]))) or 0.0
    unit = next((unit for most, unit in _EPOCHS if first > most), "")
    if chosen not in named or len(named) > 1:
        others = [titles[k] for k in rising if k != chosen][:5]
        also = f", as do {', '.join(map(repr, others))}" if others else ""
        notes.append(f"time may be another column than {titles[chosen]!r}, which rises{also}")
    said = split_title(titles[chosen])[1]
    if said and not unit and not is_time(said):
        unit = "s"
    if not said and first <= 1e8:
        notes.append(f"{titles[chosen]!r} is in seconds unless columns.time.unit states another")
    return {"column": titles[chosen], **({"unit": unit} if unit else {})}


def _is_quantity(title: str) -> bool:
    """True if a title ends in a unit that is none of time."""
    unit = split_title(title)[1]
    return bool(unit and readings(unit)) and not is_time(unit)


def is_time(unit: str) -> bool:
    """True if a unit is one of time."""
    try:
        conversion("unit", unit, "s")
    except InputError:
        return False
    return True


def _is_clock(cells: Column, number: Callable[[str], float | None]) -> bool:
    """True if numbers are hours and minutes, such as 2359, and not those of rows."""
    read = [number(cell) for cell in cells if cell]
    whole = [int(value) for value in read if value is not None and value == int(value)]
    return len(whole) == len(read) > 100 and max(whole) in (2300, 2330, 2345, 2350, 2355, 2359)


def _in_parts(
    titles: Sequence[str], columns: Sequence[Column], number: Callable[[str], float | None]
) -> dict[str, Any]:
    """Year, month, day, hour and so on in columns side by side."""
    for k in range(len(titles) - 3):
        parts = [_whole(cells, number) for cells in columns[k : k + 6]]
        year, *rest = parts
        if not year or not (_within(year, 1970, 2100) or _within(year, 0, 99)):
            continue
        count = 0
        for values, (low, high) in zip(rest, _PARTS, strict=False):
            if not values or not _within(values, low, high):
                break
            count += 1
        if count < 3 or len(set(rest[count - 1] or ())) < 2 or len(set(year)) > 5:
            continue
        joined = list(zip(*parts[: count + 1], strict=True))
        if any(a > b for a, b in pairwise(joined)) or len(set(joined)) < 0.9 * len(joined):
            continue
        form = " ".join(["%Y" if max(year) > 99 else "%y", *_FORMS[1 : count + 1]])
        return {"column": [*titles[k : k + 1 + count]], "format": form}
    return {}


def _whole(cells: Column, number: Callable[[str], float | None]) -> list[int]:
    """Cells as whole numbers without a sign or a point, or nothing."""
    if not all(cell.isascii() and cell.isdigit() for cell in cells):
        return []
    return [int(cell) for cell in cells]


def _within(numbers: Sequence[int], low: int, high: int) -> bool:
    return min(numbers) >= low and max(numbers) <= high


def _dated(title: str, cells: Column, notes: list[str]) -> dict[str, Any]:
    """The key `time` of a column of dates, nothing if no format reads most of them."""
    known = [cell for cell in cells if cell]
    if all(map(_is_iso, known)):
        return {"column": title, "unit": ISO}
    forms = {form: None for cell in (known[0], known[len(known) // 2]) for form in _forms(cell)}
    read = {form: [_read(form, cell) for cell in known] for form in forms}
    most = max((_count(dates) for dates in read.values()), default=0)
    if most < 0.5 * len(known):
        notes.append(f"dates such as {known[0]!r} in {title!r} are of no format that is known")
        return {}
    best = sorted((f for f in forms if _count(read[f]) == most), key=lambda f: _extent(read[f]))
    if most < len(known):
        odd = next(a for a, date in zip(known, read[best[0]], strict=True) if date is None)
        notes.append(f"dates such as {odd!r} are of another format, and no key reads both")
    if len(best) > 1:
        others = " or ".join(best[1:])
        notes.append(f"dates such as {known[0]} may also be of {others}")
    return {"column": title, "format": best[0]}


def _count(dates: Sequence[datetime | None]) -> int:
    return sum(date is not None for date in dates)


def _extent(dates: Sequence[datetime | None]) -> tuple[int, float]:
    """The number of dates that go back, and the time from the first to the last one."""
    known = [date.replace(tzinfo=None) for date in dates if date is not None]
    back = sum(a > b for a, b in pairwise(known))
    return back, abs((max(known) - min(known)).total_seconds())


def _is_iso(cell: str) -> bool:
    try:
        datetime.fromisoformat(cell)
    except ValueError:
        return False
    return looks_dated(cell)


def _forms(cell: str) -> list[str]:
    """Formats that a date may have."""
    if _COMPACT.fullmatch(cell):
        return ["".join(_FORMS[: len(cell) // 2 - 1])]
    if match := _DASHED.fullmatch(cell):
        return [f"%Y-%m-%d{match[1]}%H-%M-%S"]
    day = DAY.match(cell)
    if day is None:
        return []
    mark, rest = day[1] or day[2], cell[day.end() :]
    orders = ("d m Y", "m d Y", "Y m d", "d m y", "m d y") if day[1] else ("d b Y", "d b y")
    days = ["%" + f"{mark}%".join(order.split()) for order in orders]
    if not rest:
        return days
    between = rest[: len(rest) - len(rest.lstrip("T ,_"))]
    ends = product(_HOURS, ("", "%z", " %z"))
    found_forms = [f"{date}{between}{hour}{zone}" for date, (hour, zone) in product(days, ends)]
    return [form for form in found_forms if _read(form, cell) is not None]


def _read(form: str, cell: str) -> datetime | None:
    try:
        return datetime.strptime(cell, form)
    except ValueError:
        return None
