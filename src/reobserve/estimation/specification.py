"""Specification of a record and of the observer for it: one YAML file, checked whole."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Annotated, Any, Literal

from reobserve.core.documents import Tree, read_yaml
from reobserve.core.errors import InputError, located, shown
from reobserve.core.units import check_unit
from reobserve.core.validation import NotNegative, Positive, checked, form, having, items, parse
from reobserve.estimation.dates import DURATION, ISO, check_day, check_format, time_zone
from reobserve.estimation.detector_alarms import DetectorRule
from reobserve.estimation.families.observer_section import DesignFile, as_observer
from reobserve.estimation.file_format import Decimal, Delimiter, Encoding, FileFormat, Thousands
from reobserve.estimation.quantities import conversion

Uneven = Literal["refuse", "linear", "previous", "pchip"]
Missing = Literal["refuse", "interpolate", "skip"]
AtGap = Literal["refuse", "restart", "coast"]
Repeated = Literal["refuse", "spread", "first", "last", "merge"]

_MOST_COLUMNS = 100


def _name(place: str, value: str) -> None:
    if not value or len(value) > 200 or not value.isprintable():
        raise InputError(place, f"{shown(value)} must be a name that can be printed")


def _few(place: str, value: Any) -> None:
    if len(value) > _MOST_COLUMNS:
        raise InputError(place, f"has {len(value)} entries, must have {_MOST_COLUMNS} or fewer")


Name = Annotated[str, checked(_name)]
Few = checked(_few)


@dataclass(frozen=True)
class TimeColumn:
    """The timestamps. Without ``column`` there are none, and rows are a sampling period apart.

    The ``unit`` is one of time, iso8601 for dates, or duration for hours that may pass 24, as
    26:30:00, perhaps with days, as 1d 02:30:00; dates of another form have a ``format`` in its
    place, as Python's strptime reads it: "%d.%m.%Y %H:%M:%S". Dates without an offset are those
    of the time ``zone``, as Europe/Berlin, or else of UTC. A list of columns, as of dates and
    times of day, is read as one, with a blank between their cells.
    Where the format has times of day alone, ``day`` is that of the first row, as 2026-03-29, and
    those of other rows are on the day on which they are nearest to the row before. ``wrap`` is the
    number at which a counter begins again, in ``unit``.
    """

    column: str | Annotated[tuple[Name, ...], items(2, 7)] = ""
    unit: str = ""
    format: str = ""
    zone: str = ""
    day: str = ""
    wrap: Positive | None = None

    def __post_init__(self) -> None:
        if self.zone:
            time_zone(self.zone)
        if self.day:
            check_day("day", self.day, self.format)
        if self.wrap is not None and self.dated == ISO:
            raise InputError("wrap", "is for counters, and must be left out where there are dates")
        if self.format:
            check_format("format", self.format, bool(self.day))
            if self.unit:
                raise InputError("unit", "must be left out where there is a format")
        elif self.unit not in (ISO, DURATION):
            conversion("unit", self.unit or "s", "s")

    @property
    def columns(self) -> tuple[str, ...]:
        """The names of the columns, none if there are no timestamps."""
        return tuple(filter(None, [self.column] if isinstance(self.column, str) else self.column))

    @property
    def dated(self) -> str:
        """The unit, or what stands in its place."""
        return ISO if self.format else self.unit


@dataclass(frozen=True)
class Column:
    """A column of numbers in ``unit``, which the observer reads in ``model_unit``.

    Without units, that of the title is taken, ``name [unit]``, or else the model's. At ``range`` in
    ``unit``, or beyond, the sensor is saturated: such values are counted, and kept or taken for
    missing. ``offset`` is the column's value at the operating point of a model that is linearised
    there, in ``unit``: the observer reads (column - offset), and estimates deviations from it.
    ``wrap`` is the period of an angle in ``unit``, such as 360: from sample to sample it turns the
    shortest way, and the observer reads angles that go on beyond a turn.
    ``missing: hold`` is for an input that is logged when it changes: in rows where its cell is
    empty it has its last value. Before the first one the observer does not start.
    """

    column: Name
    unit: str = ""
    model_unit: str = ""
    range: tuple[float, float] | None = None
    saturated: Literal["keep", "missing"] = "keep"
    offset: float | None = None
    wrap: Positive | None = None
    missing: Literal["hold"] | None = None

    def __post_init__(self) -> None:
        for place in ("unit", "model_unit"):
            if getattr(self, place):
                check_unit(place, getattr(self, place))
        if self.range is not None and not self.range[0] < self.range[1]:
            low, high = self.range
            raise InputError("range", f"[{low:g}, {high:g}] must be rising")


@dataclass(frozen=True)
class Constant:
    """An input that needs no column: it has this ``value`` in ``unit``, or in that of the model."""

    value: float
    unit: str = ""

    def __post_init__(self) -> None:
        if self.unit:
            check_unit("unit", self.unit)


# Distinguished by the key that states a constant.
Input = Annotated[
    Annotated[Constant, form("constant input")] | Annotated[Column, form("input column")],
    having({"value": "constant input"}, "input column"),
]


@dataclass(frozen=True)
class Columns:
    """The contents of a row by column, and the way its cells are written.

    The delimiter ``whitespace`` is any number of blanks and tabs. Where the delimiter is also a
    mark in numbers, these are in quotes. Where the mark of ``thousands`` is also the decimal one,
    the last one in a number is decimal.
    """

    measurements: Annotated[tuple[Column, ...], Few]
    inputs: Annotated[tuple[Input, ...], Few] = ()
    time: TimeColumn = field(default_factory=TimeColumn)
    delimiter: Delimiter = ","
    decimal: Decimal = "."
    thousands: Thousands = ""
    encoding: Encoding = "utf-8"

    def __post_init__(self) -> None:
        if not self.measurements:
            raise InputError("measurements", "are none, must be one or more")
        taken = list(self.time.columns)
        if len(set(taken)) < len(taken):
            raise InputError("time.column", f"takes the column {shown(taken[0])} a second time")
        for k, column in enumerate(self.measurements):
            if column.missing is not None:
                problem = "hold is for inputs; sampling.missing is for measurements"
                raise InputError(f"measurements.{k}.missing", problem)
        for place in ("measurements", "inputs"):
            for column in getattr(self, place):
                if isinstance(column, Constant):
                    continue
                if column.column in taken:
                    raise InputError(place, f"take the column {shown(column.column)} a second time")
                taken.append(column.column)

    @property
    def read(self) -> tuple[Column, ...]:
        """The columns that the observer reads, measurements first."""
        columns = (*self.measurements, *self.inputs)
        return tuple(column for column in columns if isinstance(column, Column))


@dataclass(frozen=True)
class Sampling:
    """The period [s], and the policies where a record does not keep to it.

    ``jitter`` is the largest offset of a timestamp from its place on the grid, in periods. What is
    farther off is refused where ``uneven`` is refuse; else all rows are resampled: measurements by
    straight lines, the value before or a monotone cubic (pchip). Inputs are held, and the observer
    reads their mean over the period that follows a row.
    ``missing``: samples that were lost are refused, filled likewise (straight lines where
    ``uneven`` is refuse), or skipped by observers that can predict without them. Filled or skipped
    is no more than ``gap`` [s]; what is longer is refused, the observer restarts after it, or
    coasts over it with predictions.
    ``repeated``: rows with the timestamp of the row before are refused, spread evenly up to the
    next timestamp (no farther than ``period`` apart), left out but for the first or the last, or
    merged. Where ``uneven`` resamples, rows that are the same in all columns are always left out.
    """

    period: Positive
    uneven: Uneven = "refuse"
    jitter: NotNegative = 0.01
    missing: Missing = "refuse"
    gap: NotNegative | None = None
    at_gap: AtGap = "refuse"
    repeated: Repeated = "refuse"

    def __post_init__(self) -> None:
        if self.missing == "refuse" and self.at_gap != "refuse":
            problem = f"{self.at_gap} has no gap to act on where missing is refuse"
            raise InputError("at_gap", problem)
        if self.jitter >= 0.5:
            raise InputError("jitter", f"{self.jitter:g} periods must be below half of one")

    @property
    def longest(self) -> float:
        """The longest stretch [s] between two samples that a policy bridges."""
        return 10.0 * self.period if self.gap is None else self.gap


@dataclass(frozen=True)
class StatedThreshold:
    """An alarm where a column is ``above`` or ``below`` a value, or its absolute value ``beyond``.

    With ``sigmas`` it must be so by that many of the standard deviations that the observer has for
    the column in that row; alone, they are those by which it differs from zero. ``of: innovation``
    and a measurement is the residual of that, where the observer predicts its deviation.
    It is not raised within ``start_up`` [s] of a start of the observer. Left out, that is how long
    the observer needs to forget its start, `reobserve.estimation.start_up`, and 0 with ``sigmas``.
    """

    name: Name
    of: Name
    above: float | None = None
    below: float | None = None
    beyond: Positive | None = None
    sigmas: Positive | None = None
    start_up: NotNegative | None = None

    def __post_init__(self) -> None:
        sides = [side for side in ("above", "below") if getattr(self, side) is not None]
        if sides and self.beyond is not None:
            problem = "must be left out beside beyond, which is for both signs"
            raise InputError(sides[0], problem)
        if self.above is not None and self.below is not None and self.below >= self.above:
            problem = (
                f"{self.below:g} must be less than above, {self.above:g}, as the alarm is raised "
                "outside of both; an alarm between two values is none"
            )
            raise InputError("below", problem)
        if not sides and self.beyond is None and self.sigmas is None:
            problem = (
                "is missing: above, below, beyond or sigmas, or sigma and until for a threshold "
                "that is learned, or a detector"
            )
            raise InputError("", f"a threshold {problem}")


@dataclass(frozen=True)
class LearnedThreshold:
    """An alarm ``sigma`` standard deviations off the mean, both of a stretch that is stated [s].

    ``since`` and ``until`` are [s] from the first estimate on, or dates; ``start_up`` is as for
    thresholds that are stated.
    """

    name: Name
    of: Name
    sigma: Positive
    until: Positive | str
    since: NotNegative | str = 0.0
    start_up: NotNegative | None = None

    def __post_init__(self) -> None:
        if isinstance(self.since, str) or isinstance(self.until, str):
            return  # which are compared with the record's first date
        if not self.since < self.until:
            raise InputError("until", f"{self.until:g} s must be after since, {self.since:g} s")


# Distinguished by the key that states a detector, or that a threshold is learned.
Alarm = Annotated[
    Annotated[StatedThreshold, form("stated threshold")]
    | Annotated[DetectorRule, form("detector")]
    | Annotated[LearnedThreshold, form("learned threshold")],
    having(
        {"detector": "detector"}
        | dict.fromkeys(("above", "below", "beyond", "sigmas"), "stated threshold")
        | dict.fromkeys(("sigma", "since", "until"), "learned threshold"),
        "stated threshold",
    ),
]


def _distinct_alarms(place: str, alarms: Any) -> None:
    names = [alarm.name for alarm in alarms]
    for name in names:
        if names.count(name) > 1:
            raise InputError(place, f"have the name {shown(name)} twice")


@dataclass(frozen=True)
class Specification:
    """All of it.

    ``observer`` is read as a mapping: a kind, and the keys of its family, or of a design file.
    ``smooth`` asks for estimates of which each takes the whole record, from a start of the observer
    to the next, by `reobserve.observers.smoother.rts_smoother`; residuals stay the filter's.
    """

    observer: Any
    columns: Columns
    sampling: Sampling
    estimates: dict[str, dict[str, str]] = field(default_factory=dict)
    alarms: Annotated[tuple[Alarm, ...], Few, checked(_distinct_alarms)] = ()
    smooth: bool = False
    file: FileFormat = field(default_factory=FileFormat)

    def __post_init__(self) -> None:
        if not isinstance(self.observer, Mapping):
            raise InputError(
                "observer", f"{shown(self.observer)} must be a model, as --example kalman has one"
            )
        with located("observer"):
            object.__setattr__(self, "observer", as_observer(self.observer, self.sampling.period))
        for name, parts in self.estimates.items():
            for part, unit in parts.items():
                with located("estimates"):
                    _name(f"{name}.{part}", part)
                    if unit:
                        check_unit(f"{name}.{part}", unit)

    @property
    def files(self) -> tuple[Path, ...]:
        """The files that it names, on whose content estimates depend as on its own."""
        return (Path(self.observer.file),) if isinstance(self.observer, DesignFile) else ()


SECTIONS = tuple(each.name for each in fields(Specification))


def as_specification(tree: Tree) -> Specification:
    """The specification in a tree.

    The observer's keys, and its kind, may also stand beside the sections, as in a model's file. Its
    sampling period may state ``sampling.period``.

    Raises
    ------
    InputError
        With the dotted key of what is missing, unknown or wrong.
    """
    flat = "observer" not in tree and any(name in tree for name in ("kind", "sampling_period"))
    if flat:
        keys = {name: part for name, part in tree.items() if name not in SECTIONS}
        tree = {name: part for name, part in tree.items() if name in SECTIONS}
        tree["observer"] = keys
    observer, sampling = tree.get("observer"), tree.get("sampling", {})
    if isinstance(observer, dict) and isinstance(sampling, dict) and "sampling_period" in observer:
        period = observer["sampling_period"]
        sampling = {"period": period, **sampling}
        if sampling["period"] == period:
            rest = {name: part for name, part in observer.items() if name != "sampling_period"}
            tree = {**tree, "observer": rest, "sampling": sampling}
    try:
        return parse(Specification, tree)
    except InputError as error:
        name = error.parameter.removeprefix("observer.") if flat else error.parameter
        raise error.renamed(name) from None


def read_specification(path: str | Path) -> Specification:
    """The specification in a file.

    Raises
    ------
    InputError
        With the file and the dotted key of what is missing, unknown or wrong.
    """
    tree = read_yaml(path)
    with located(str(path), ": "):
        return as_specification(tree)
