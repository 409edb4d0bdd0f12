"""The columns that look like timestamps, and how they are written."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from itertools import pairwise, product
from statistics import median
from typing import Any

from reobserve.core.errors import InputError
from reobserve.core.units import readings
from reobserve.estimation.dates import DURATION, ISO, SPELLED_DURATION, looks_dated
from reobserve.estimation.layout import split_title
from reobserve.estimation.quantities import conversion

DAY = re.compile(r"\d{1,4}([-./])\d\d?\1\d{1,4}|\d\d?([-./ ])[A-Z][a-z]{2}\2\d{2,4}")
HOUR = re.compile(r"\d\d?:\d\d?(:\d\d?([.,]\d+)?)?( ?[AaPp][Mm])?")
DATE = re.compile(rf"(?:{DAY.pattern})[T ,_]{{1,2}}(?:{HOUR.pattern})(Z| ?[+-]\d\d:?\d\d)?")
_SPAN = re.compile(r"(\d+ ?d(ays?)?,? )?\d+:\d\d?(:\d\d?)?([.,]\d+)?( ?[AaPp][Mm])?")
_HALF = re.compile(r"[AaPp][Mm]")  # of a day
_DASHED = re.compile(r"\d{4}-\d\d-\d\d([-_T ])\d\d-\d\d-\d\d")
_COMPACT = re.compile(r"(19|20)\d\d[01]\d[0-3]\d([0-2]\d){0,1}([0-5]\d){0,2}")
_CLOCK = re.compile(r"([01]\d|2[0-3])[0-5]\d[0-5]\d")  # as 101559 for 10:15:59
_TITLE = re.compile(
    r"time|zeit|stamp|clock|epoch|date|datum|hora|fecha|^t$|^x_value$|^t[\W_]|(?<![a-z])[munµ]?s(ec)?$|"
    r"(milli|micro)s$|seconds$", re.IGNORECASE
)  # fmt: skip
_COUNTER = re.compile(r"count|packet|tick|seq|frame|sample|record|index", re.IGNORECASE)
_UNIT = re.compile(  # that ends a title, as in time_us and TimeUS
    r"(?:^|[\W_]|(?<=[a-z])(?=[A-Z]))((?i:[munµ]?s|(milli|micro|nano)?sec(ond)?s?|millis|micros|"
    r"min|minutes?|h|hours?))$"
)
_EPOCHS = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
_SINCE, _UNTIL = 9.4e8, 4.2e9  # [s] from 1970 to about 2000 and 2100
_SLOW = 20.0  # [s] between samples, that may be microseconds since a start, too
_PARTS = re.compile(r"(\d\d|(?:19|20)\d\d) \d\d?( \d\d?){2,4}")
_HOURS = (
    "%H:%M", "%H:%M:%S", "%H:%M:%S.%f", "%H:%M:%S,%f", "%I:%M %p", "%I:%M:%S %p", "%I:%M%p",
    "%I:%M:%S%p",
)  # fmt: skip
_CLOCKS = ("%H%M%S", "%H%M%S.%f", "%H%M%S,%f")
_A_DAY = "2000-01-01"  # on which times of day are read, to see how they go on
_DAY = 86400.0  # [s]
_FINE = 1e-4  # between samples, which is no time in seconds, but may be one in days
_FORMS = ("%Y", "%m", "%d", "%H", "%M", "%S")
_FEW = 9  # cells that rise by chance
_LOOKED_AT = 2000  # cells of a column

Column = Sequence[str]
Number = Callable[[str], float | None]


@dataclass
class Unsure:
    """Sentences on keys of a specification, and those ``asked`` for: only the user knows them."""

    sentences: dict[str, str] = field(default_factory=dict)
    asked: set[str] = field(default_factory=set)

    def of(self, key: str, sentence: str, ask: bool = False) -> None:
        """Take a sentence on a key, which may be asked for."""
        self.sentences[key] = sentence
        if ask:
            self.asked.add(key)


def find_time(
    titles: Sequence[str],
    columns: Sequence[Column],
    number: Number,
    unsure: Unsure,
    units: Sequence[str] = (),
) -> dict[str, Any]:
    """The key `time`, if columns look like timestamps. Where it is in doubt, it is the likeliest.

    A ``number`` is read from a cell, None if it has none; ``units`` are not in the titles.
    """
    some = [list(column[:_LOOKED_AT]) for column in columns[: len(titles)]]
    titles = titles[: len(some)]
    found = [group for group in _groups(titles, some) if len({*group[1]}) > 1 or len(some[0]) == 1]
    if not found:
        return _numbered(titles, some, number, unsure, [*units, *[""] * len(titles)])
    (names, cells), *others = found
    _mention(names[0], [other[0] for other, _ in others], unsure)
    return _dated(names, cells, unsure)


def _mention(chosen: str, others: Sequence[str], unsure: Unsure) -> None:
    """Say which columns may have the times, too."""
    if others:
        listed = " or ".join(map(repr, others[:5]))
        unsure.of("columns.time.column", f"{chosen!r} has times, and so may {listed}")


def _groups(titles: Sequence[str], columns: Sequence[Column]) -> list[tuple[list[str], Column]]:
    """Columns of dates, and those that are parts of one, those of dates with hours first."""
    found = list[tuple[int, int, int]]()
    for k, cells in enumerate(columns):
        compact = _all(_COMPACT, cells) and _rises(cells, float)
        if _all(DATE, cells) or _all(_DASHED, cells) or compact:
            found.append((1, k, 1))
        elif _all(DAY, cells):
            hours = k + 1 < len(columns) and _all(HOUR, columns[k + 1])
            half = hours and k + 2 < len(columns) and _all(_HALF, columns[k + 2])
            found.append((2, k, 1 + hours + half))
        elif _all(_SPAN, cells):
            found.append((4, k, 1))
        for count in (6, 5, 4) if cells[:1] and cells[0].isdigit() else ():
            joined = list(map(" ".join, zip(*columns[k : k + count], strict=True)))
            if k + count <= len(columns) and _all(_PARTS, joined):
                form = next(iter(_forms(joined[0])), "")
                dates = [date for cell in joined if (date := _read(form, cell))]
                if 0.9 * len(joined) < len(set(dates)) and dates == sorted(dates):
                    found.append((3, k, count))
                    break
    taken = {j for _, k, count in found for j in range(k + 1, k + count)}
    return [
        (list(titles[k : k + n]), list(map(" ".join, zip(*columns[k : k + n], strict=True))))
        for _, k, n in sorted(found) if k not in taken
    ]  # fmt: skip


def _all(form: re.Pattern[str], cells: Column) -> bool:
    """True if a form is that of nearly all cells that are not empty."""
    known = [cell for cell in cells if cell]
    fit = sum(form.fullmatch(cell) is not None for cell in known)
    return len(known) > 0.5 * len(cells) and fit > 0.9 * len(known)


def _rises(cells: Column, number: Number, named: bool = False) -> bool:
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
        return falls <= 0.05 * len(known) and rises >= 0.05 * len(known)
    return len(known) > _FEW and falls == 0 and rises >= 0.5 * (len(known) - 1)


def _numbered(
    titles: Sequence[str],
    columns: Sequence[Column],
    number: Number,
    unsure: Unsure,
    units: Sequence[str],
) -> dict[str, Any]:
    """The column of numbers that looks most like time."""
    words = [re.sub(r"[^\w ].*", "", title.lstrip("%# ")).strip() for title in titles]
    timed = [_TITLE.search(word) is not None or is_time(unit)
             for word, unit in zip(words, units, strict=False)]  # fmt: skip
    counts = [_COUNTER.search(word) is not None for word in words]
    rising = [k for k, cells in enumerate(columns) if _rises(cells, number, timed[k] or counts[k])]
    said = [split_title(title)[1] for title in titles]
    rising = [k for k in rising if is_time(said[k]) or not readings(said[k])]
    named = [k for k in rising if timed[k]]
    largest = [k for k in rising if (number(columns[k][0]) or 0.0) > _SINCE]
    chosen = next(iter([*(k for k in named if k in largest), *named, *largest, *rising]), None)
    if chosen is None:
        problem = "no column looks like timestamps; without them, rows are one period apart"
        unsure.of("columns.time", problem)
        return {}
    title = titles[chosen]
    _mention(title, [titles[k] for k in (named or rising) if k != chosen], unsure)
    read = [number(cell) for cell in columns[chosen] if cell]
    values = [value for value in read if value is not None]
    steps = [b - a for a, b in pairwise(values) if b > a]
    step = median(steps)
    if chosen not in named:
        even = all(abs(one - step) <= 0.01 * step for one in steps) and not counts[chosen]
        problem = f"{title!r} rises, and may be another quantity than time"
        unsure.of("columns.time.column", problem, ask=not even)
    if is_time(said[chosen]):
        return {"column": title}
    unit = units[chosen] if is_time(units[chosen]) else ""
    if match := None if said[chosen] else _UNIT.search(title.strip()):
        unit = {"millis": "ms", "micros": "us"}.get(match[1].lower(), match[1].lower())
    if not unit and (time := _clocked(title, columns[chosen], values, unsure)):
        return time
    return {"column": title, "unit": unit or _unit_of(title, values, step, unsure)}


def _unit_of(title: str, values: Sequence[float], step: float, unsure: Unsure) -> str:
    """The unit of times whose title does not say it."""
    epochs = [unit for unit, per in _EPOCHS.items() if _SINCE < values[0] / per < _UNTIL]
    whole = all(value == int(value) for value in values)
    problem = f"{title!r} has no unit of time, and goes on by {step:g}: s, ms, us or ns"
    for unit in epochs:
        if step > _SLOW * _EPOCHS[unit] and whole:
            unsure.of("columns.time.unit", f"{problem}; it may be {unit} since 1970")
        return unit
    unsure.of("columns.time.unit", problem, ask=whole or step < _FINE)
    return "s"


def _clocked(title: str, cells: Column, values: Sequence[float], unsure: Unsure) -> dict[str, Any]:
    """The key of numbers that are times of day, as 101559.95, if they go on more evenly so."""
    texts = [re.split("[.,]", cell)[0] for cell in cells if cell]
    if max(values) < 100 or not all(_CLOCK.fullmatch(text.zfill(6)) for text in texts):
        return {}
    # t = 3600 HH + 60 MM + SS.ss
    times = [value // 10000 * 3600 + value // 100 % 100 * 60 + value % 100 for value in values]
    plain, by_clock = _unevenness(values, math.inf), _unevenness(times, _DAY)
    if by_clock > 1.5 * plain:
        return {}
    time = _dated([title], cells, unsure)
    if plain < 1.5 * by_clock or any(len(text) != 6 for text in texts):
        problem = f"{title!r} may have times of day, as {texts[0]} for HHMMSS, or a unit of time"
        unsure.of("columns.time.format", problem, ask=True)
    return time


def _unevenness(numbers: Sequence[float], wrap: float) -> float:
    """The largest step of numbers that begin again, in medians of them."""
    steps = [(b - a) % wrap for a, b in pairwise(numbers) if b != a]
    return max(steps) / median(steps)


def is_time(unit: str) -> bool:
    """True if a unit is one of time."""
    try:
        conversion("unit", unit, "s")
    except InputError:
        return False
    return True


def _dated(names: list[str], cells: Column, unsure: Unsure) -> dict[str, Any]:
    """The key `time` of columns of dates."""
    known = [cell for cell in cells if cell]
    time: dict[str, Any] = {"column": names[0] if len(names) == 1 else names}
    if all(map(_is_iso, known)):
        return {**time, "unit": _with_offset(datetime.fromisoformat(known[0]), ISO, unsure)}
    if all(map(SPELLED_DURATION.fullmatch, known)) and not all(_read("%H:%M:%S", c) for c in known):
        return {**time, "unit": DURATION}
    forms = {form: None for cell in (known[0], known[len(known) // 2]) for form in _forms(cell)}
    read = {form: [_read(form, cell) for cell in known] for form in forms}
    lost = {form: dates.count(None) for form, dates in read.items()}
    if min(lost.values(), default=len(known)) == len(known):
        problem = f"dates such as {known[0]!r} in {names[0]!r} are of no format that is known"
        unsure.of("columns.time.format", problem, ask=True)
        return {**time, "format": "%d.%m.%Y"}
    best = sorted((form for form in forms if lost[form] == min(lost.values())),
                  key=lambda form: _steps(read[form]))  # fmt: skip
    (back, step), *others = (_steps(read[form]) for form in best)
    unclear = [
        form for form, (more, longer) in zip(best[1:], others, strict=True)
        if not (back == 0 < more or step < _DAY <= longer)
    ]  # fmt: skip
    if best[0] == "%H:%M":
        unclear = ["%M:%S"]
    if unclear:
        problem = f"dates such as {known[0]} may be of {' or '.join([best[0], *unclear])}"
        unsure.of("columns.time.format", problem, ask=True)
    elif lost[best[0]]:
        odd = known[read[best[0]].index(None)]
        problem = f"dates such as {odd!r} are of another format, and no key reads both"
        unsure.of("columns.time.format", problem, ask="%d" not in best[0])
    if "%d" not in best[0]:
        unsure.of("columns.time.day", f"{names[0]!r} has no day, that of the first row", ask=True)
        return {**time, "format": best[0], "day": _A_DAY}
    return {**time, "format": _with_offset(next(filter(None, read[best[0]])), best[0], unsure)}


def _with_offset(date: datetime, form: str, unsure: Unsure) -> str:
    """A format, of which it is said if its dates have no offset."""
    if date.tzinfo is None:
        problem = "dates have no offset, and are read as UTC unless it is stated"
        unsure.of("columns.time.zone", problem)
    return form


def _steps(dates: Sequence[datetime | None]) -> tuple[int, float]:
    """The number of dates that go back, and the longest step [s]."""
    known = [date.replace(tzinfo=None) for date in dates if date is not None]
    steps = [(b - a).total_seconds() for a, b in pairwise(known)] or [0.0]
    return sum(step < 0 for step in steps), max(map(abs, steps))


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
    if _PARTS.fullmatch(cell):
        year, *others = cell.split()
        return [" ".join(["%Y" if len(year) > 2 else "%y", *_FORMS[1 : 1 + len(others)]])]
    day = DAY.match(cell)
    if day is None:
        return [form for form in (*_HOURS, *_CLOCKS) if _read(form, cell)]
    mark, rest = day[1] or day[2], cell[day.end() :]
    orders = {
        "/": ("d m Y", "m d Y", "Y m d", "d m y", "m d y"), ".": ("d m Y", "Y m d", "d m y"),
        "-": ("d m Y", "m d Y", "Y m d", "d m y", "m d y", "y m d"),
    }.get(day[1], ("d b Y", "d b y"))  # fmt: skip
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
