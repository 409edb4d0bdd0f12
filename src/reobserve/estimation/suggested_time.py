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

from reobserve.core.units import readings
from reobserve.estimation.dates import DURATION, ISO, SPELLED_DURATION, moment, seconds_of

DAY = re.compile(r"\d{1,4}([-./])\d\d?\1\d{1,4}|\d\d?([-./ ])[A-Z][a-z]{2}\2\d{2,4}")
HOUR = re.compile(r"\d\d?:\d\d?(:\d\d?([.,]\d+|:\d{3})?)?( ?[AaPp][Mm])?")
DATE = re.compile(
    rf"(?:{DAY.pattern})[-T ,_]{{1,2}}(?:{HOUR.pattern}|\d\d-\d\d-\d\d)"
    r"(Z| ?[+-]\d\d:?\d\d| UTC| GMT)?"
)
_SPAN = re.compile(r"(\d+ ?d(ays?)?,? )?\d+:\d\d?(:\d\d?)?([.,]\d+)?( ?[AaPp][Mm])?")
_COMPACT = re.compile(r"(19|20)\d\d[01]\d[0-3]\d([0-2]\d){0,1}([0-5]\d){0,2}")
_CLOCK = re.compile(r"([01]\d|2[0-3])[0-5]\d[0-5]\d")  # as 101559 for 10:15:59
_PARTS = re.compile(r"(\d\d|(?:19|20)\d\d) \d\d?( \d\d?){2,4}")
_TITLE = re.compile(
    r"time|zeit|stamp|clock|epoch|date|datum|hora|fecha|^t$|^x_value$|^t[\W_]|(?<![a-z])[munµ]?s(ec)?$|"
    r"(milli|micro)s$|seconds$", re.IGNORECASE
)  # fmt: skip
_MILLI = re.compile(r"ms|milli.*", re.IGNORECASE)  # behind whole seconds
_COUNTER = re.compile(r"count|packet|tick|seq|frame|sample|record|index", re.IGNORECASE)
_UNIT = re.compile(  # that ends a title, as in time_us and TimeUS
    r"(?:^|[\W_]|(?<=[a-z])(?=[A-Z]))((?i:[munµ]?s|(milli|micro|nano)?sec(ond)?s?|millis|micros|"
    r"min|minutes?|h|hours?))$"
)
_EPOCHS = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
_SINCE, _UNTIL = 9.4e8, 4.2e9  # [s] from 1970 to about 2000 and 2100
_SLOW = 20.0  # [s] between samples, that may be microseconds since a start, too
_A_DAY = "2000-01-01"  # on which times of day are read, to see how they go on
_DAY = 86400.0  # [s]
_FINE = 1e-4  # between samples, which is no time in seconds, but may be one in days
_FEW = 9  # cells that rise by chance
_LOOKED_AT = 2000  # cells of a column
# Directives of the days of dates by the mark between their parts, and of hours behind them.
_DAYS = {
    "/": ("d m Y", "m d Y", "Y m d", "d m y", "m d y"), ".": ("d m Y", "Y m d", "d m y"),
    "-": ("d m Y", "m d Y", "Y m d", "d m y", "m d y", "y m d"), " ": ("Y m d", "y m d"),
}  # fmt: skip
_HOURS = ("", "H", "H M", "H M S", "H M S f", "I M p", "I M S p")
_CLOCKS = ("%H%M%S", "%H%M%S.%f", "%H%M%S,%f")
_ZONE = re.compile(r"(:\d\d(?:[.,]\d+)?)( ?)([+-]\d\d:?\d\d|Z)$")
_VALUES = re.compile(r"(\d+|[A-Z][a-z]{2}|[AaPp][Mm])")

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
    units: Sequence[str],
    columns: Sequence[Column],
    number: Number,
    unsure: Unsure,
) -> dict[str, Any]:
    """The key `time`, if columns look like timestamps. Where it is in doubt, it is the likeliest.

    A ``number`` is read from a cell, None if it has none.
    """
    some = [list(column[:_LOOKED_AT]) for column in columns[: len(titles)]]
    found = [group for group in _groups(titles, some) if len({*group[1]}) > 1 or len(some[0]) == 1]
    if not found:
        return _numbered(titles, units, some, number, unsure)
    (names, cells), *others = found
    repeats = len({*cells}) < 0.9 * len(cells)
    likely = [title for title, unit, column in zip(titles, units, some, strict=False)
              if repeats and is_time(unit) and _rises(column, number)]  # fmt: skip
    _mention(names[0], [*(other[0] for other, _ in others), *likely], unsure)
    return _dated(names, cells, unsure)


def _mention(chosen: str, others: Sequence[str], unsure: Unsure) -> None:
    """Say which columns may have the times, too."""
    if others:
        listed = " or ".join(map(repr, others[:5]))
        unsure.of("columns.time.column", f"{chosen!r} has times, and so may {listed}")


def _groups(titles: Sequence[str], columns: Sequence[Column]) -> list[tuple[list[str], Column]]:
    """Columns of dates that are not mostly empty, and parts of one, those with hours first."""
    found, taken = list[tuple[int, int, list[str], Column]](), 0
    for k, count in product(range(len(columns)), range(6, 0, -1)):
        if taken <= k <= len(columns) - count:
            parts = columns[k : k + count]
            if any(2 * sum(map(bool, part)) <= len(part) for part in parts):
                continue
            rows = [*zip(*parts, strict=True)]
            joined = [" ".join(row).strip() for row in rows]
            behind = count > 1 and _MILLI.fullmatch(titles[k + count - 1]) is not None
            dates = [" ".join(row[:-1]) for row in rows if len(row[-1]) < 4] if behind else joined
            if order := _order(dates, count - behind):
                found.append((order, k, list(titles[k : k + count]), joined))
                taken = k + count
    return [(names, cells) for _, _, names, cells in sorted(found)]


def _order(cells: Column, count: int) -> int:
    """The place of dates in a number of columns among others, 0 if they are none."""
    if count > 3:
        dates = []
        if _all(_PARTS, cells) and (forms := _forms(cells[0])):
            dates = [date for cell in cells if (date := _read(forms[0], cell))]
        return 3 * (0.9 * len(cells) < len(set(dates)) and dates == sorted(dates))
    if _all(DATE, cells):
        return 1 if count == 1 else 2
    if count > 1:
        return 0
    if _all(_COMPACT, cells):
        return int(_rises(cells, float))
    return 2 if _all(DAY, cells) else 4 * _all(_SPAN, cells)


def _all(form: re.Pattern[str], cells: Column) -> bool:
    """True if a form is that of nearly all cells that are not empty."""
    known = [cell for cell in cells if cell]
    fit = sum(form.fullmatch(cell) is not None for cell in known)
    return fit > 0.9 * len(known)


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
    units: Sequence[str],
    columns: Sequence[Column],
    number: Number,
    unsure: Unsure,
) -> dict[str, Any]:
    """The column of numbers that looks most like time."""
    words = [re.sub(r"[^\w ].*", "", title.lstrip("%# ")).strip() for title in titles]
    timed = [_TITLE.search(word) is not None or is_time(unit)
             for word, unit in zip(words, units, strict=True)]  # fmt: skip
    counts = [_COUNTER.search(word) is not None for word in words]
    rising = [
        k for k, cells in enumerate(columns)
        if _rises(cells, number, timed[k] or counts[k])
        and (is_time(units[k]) or units[k] == "-" or not readings(units[k]))
    ]  # fmt: skip
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
    if is_time(unit := units[chosen]):
        return {"column": title, "unit": unit}
    if match := None if unit else _UNIT.search(title.strip()):
        found = match[1].lower()
        return {"column": title, "unit": {"millis": "ms", "micros": "us"}.get(found, found)}
    clocked = _clocked(title, columns[chosen], values, unsure)
    return clocked or {"column": title, "unit": _unit_of(title, values, step, unsure)}


def _unit_of(title: str, values: Sequence[float], step: float, unsure: Unsure) -> str:
    """The unit of times whose title does not say it."""
    epochs = [unit for unit, per in _EPOCHS.items() if _SINCE < values[0] / per < _UNTIL]
    whole = all(value == int(value) for value in values)
    problem = f"{title!r} has no unit of time, and goes on by {step:g}: s, ms, us, ns or hns"
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
    return any(one.dimensionality == {"[time]": 1.0} for one in readings(unit))


def _dated(names: list[str], cells: Column, unsure: Unsure) -> dict[str, Any]:
    """The key `time` of columns of dates."""
    known = [cell for cell in cells if cell]
    time: dict[str, Any] = {"column": names[0] if len(names) == 1 else names}
    elapsed = all(map(SPELLED_DURATION.fullmatch, known))
    times = [float(seconds_of(cell)) for cell in known] if elapsed else []
    if (elapsed and times == sorted(times)) and not all(_read("%H:%M:%S", c) for c in known):
        return {**time, "unit": DURATION}
    forms = {form: None for cell in (known[0], known[len(known) // 2]) for form in _forms(cell)}
    if all(_read("", cell) for cell in known):
        forms = {"": None}  # of ISO 8601
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
    of_day = best[0] and "%d" not in best[0]
    if unclear:
        problem = f"dates such as {known[0]} may be of {' or '.join([best[0], *unclear])}"
        unsure.of("columns.time.format", problem, ask=True)
    elif lost[best[0]]:
        odd = known[read[best[0]].index(None)]
        problem = f"dates such as {odd!r} are of another format, and no key reads both"
        unsure.of("columns.time.format", problem, ask=bool(of_day))
    if of_day:
        unsure.of("columns.time.day", f"{names[0]!r} has no day, that of the first row", ask=True)
        return {**time, "format": best[0], "day": _A_DAY}
    if next(filter(None, read[best[0]])).tzinfo is None:
        problem = "dates have no offset, and are read as UTC unless it is stated"
        unsure.of("columns.time.zone", problem)
    return {**time, **({"format": best[0]} if best[0] else {"unit": ISO})}


def _steps(dates: Sequence[datetime | None]) -> tuple[int, float]:
    """The number of dates that go back, and the longest step [s]."""
    known = [date.replace(tzinfo=None) for date in dates if date is not None]
    steps = [(b - a).total_seconds() for a, b in pairwise(known)] or [0.0]
    return sum(step < 0 for step in steps), max(map(abs, steps))


def _forms(cell: str) -> list[str]:
    """Formats that read a date: directives for its digits and words, one after the other."""
    if cell.isdigit() and len(cell) > 6:
        return ["%Y%m%d%H%M%S"[: len(cell) - 2]]
    parts = _VALUES.split(_ZONE.sub(r"\1\2%z", cell))
    days: tuple[str, ...] = ("",)
    if len(parts) > 4:
        days = ("d b Y", "d b y") if parts[3].isalpha() else _DAYS.get(parts[2], days)
    forms = list(_CLOCKS)
    for day, hour in product(days, _HOURS):
        names = f"{day} {hour}".split()
        if len(names) == len(parts) // 2:
            parts[1::2] = [f"%{name}" for name in names]
            forms.append("".join(parts))
    return [form for form in forms if _read(form, cell)]


def _read(form: str, cell: str) -> datetime | None:
    """The moment of a date by a format, or by ISO 8601 without one."""
    try:
        return moment(cell, form)
    except (ValueError, re.error):  # of a directive that occurs twice
        return None
