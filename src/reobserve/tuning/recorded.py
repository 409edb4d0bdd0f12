"""Recorded data as a task: its methods are specifications of `reobserve estimate`.

    title: Rate of turn from a compass
    training: [{file: heading.csv, since: 44, until: 46, segments: 2}]
    held_out: [{file: heading.csv, since: 65, until: 72, segments: 7}]
    reference: {rate: {column: Gyroscope Z (deg/s), unit: deg/s}}
    candidates:
      kalman: {specification: kalman.yaml, ranges: {observer.Q.1: {range: [1, 1e4]}}}

An observer runs over a whole record, and its error counts in segments: the root mean square of
(estimate - reference) over that of the reference in all segments. Without a reference it is that of
the one-step prediction errors of the measurements over that of their changes from row to row in all
segments. At a row of the reference, the estimate is that of the nearest sample or, in a gap, the
last one.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import combinations, pairwise
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np

from reobserve.core.documents import read_yaml
from reobserve.core.errors import DivergenceError, InputError, located, nearest
from reobserve.core.validation import Count, Seed, Text, items, parse
from reobserve.estimation.estimate import Estimation
from reobserve.estimation.families.file import naming
from reobserve.estimation.layout import Layout, find_column
from reobserve.estimation.quantities import Conversion, conversion
from reobserve.estimation.specification import Column, Name
from reobserve.tuning.search import FAILURES, Settings
from reobserve.tuning.task import (
    Array,
    Condition,
    Method,
    Own,
    Runner,
    Seeds,
    SettingRange,
    Task,
    TaskRecord,
    Training,
)  # fmt: skip
from reobserve.tuning.tuned_specification import TunedSpecification

_HELD_OUT = 4  # segments: of fewer, an interval means nothing
_RECORDED = "held_out"  # the one condition

Outputs = dict[str, str]  # names of estimates, and the units of what they are compared with
Rows = tuple[Outputs, Array, Array]  # these, and times and values of a record


@dataclass(frozen=True)
class Part:
    """Part of a record, split into ``segments`` of equal length.

    ``since`` and ``until`` are times of the record, [s] or dates; those in seconds count from the
    first second of dates. Left out, they are its beginning and its end.
    """

    file: Text
    since: float | str | None = None
    until: float | str | None = None
    segments: Count = 1


@dataclass(frozen=True)
class ReferenceColumn:
    """A column of the records that an estimate is compared with."""

    column: Name
    unit: str = ""


@dataclass(frozen=True)
class KeyRange(SettingRange):
    """The range of a number in a specification."""

    unit: str = ""
    why: str = ""


@dataclass(frozen=True)
class Candidate:
    """A specification, and ranges of its numbers by dotted key, as ``observer.Q.1``."""

    specification: Text
    ranges: Annotated[dict[str, KeyRange], items()]
    label: str = ""


@dataclass(frozen=True)
class TuneFile:
    """Keys of a file, in which paths count from its folder.

    ``reference`` names columns of the estimates and what they are compared with. Without it, the
    score is the error of one-step predictions of the measurements.
    """

    title: Text
    training: Annotated[list[Part], items()]
    held_out: Annotated[list[Part], items()]
    candidates: Annotated[dict[str, Candidate], items()]
    reference: dict[str, ReferenceColumn] = field(default_factory=dict)
    budget: Count = 200
    seed: Seed = 1


@dataclass(frozen=True, eq=False)
class Segment(TaskRecord):
    """A segment of a record, scaled so that an error of ``size`` counts as 1."""

    path: Path
    size: ClassVar[float | None] = 1.0


@dataclass(frozen=True)
class RecordedTask(Task):
    """A file of candidates as a task, in which the seed of a record counts the segments from 1."""

    specifications: dict[str, TunedSpecification] = field(default_factory=dict)
    segments: Sequence[Segment] = ()
    compared: Outputs = field(default_factory=dict)
    scale: Array = field(default_factory=lambda: np.ones(1))
    predicts: bool = False
    own: ClassVar[str] = "as specified"
    place: ClassVar[str] = "candidates"

    @classmethod
    def read(cls, path: str | Path) -> RecordedTask:
        """The task in a file.

        Raises
        ------
        InputError
            With the file and the key of what is missing, unknown or not as it must be; or as
            `reobserve estimate` if a specification or a record cannot be used.
        """
        path = Path(path)
        tree = read_yaml(path)
        with naming(path):
            content = parse(TuneFile, tree)
        specifications, methods = {}, {}
        for name, candidate in content.candidates.items():
            tuned = specifications[name] = TunedSpecification(path.parent / candidate.specification)
            with located(f"{path}: candidates.{name}"):
                methods[name] = _method(name, candidate, tuned)
        predicts, unit = not content.reference, ""
        with naming(path):
            first = next(iter(specifications.values()))
            compared, training, held_out = _segments(content, path.parent, first)
            rows = [segment.truth for segment in (*training, *held_out)]
            moves = np.concatenate([np.diff(part, axis=0) if predicts else part for part in rows])
            scale = np.sqrt(np.mean(moves**2, axis=0))
            for name, size in zip(compared, scale, strict=True):
                if not size > 0:
                    raise InputError(f"reference.{name}", "does not differ from zero in a segment")
            paths = list(dict.fromkeys(segment.path for segment in (*training, *held_out)))
            for name, tuned in specifications.items():
                with located(f"candidates.{name}.specification"):
                    if predicts:
                        _check_predictions(tuned, first, paths[0])
                    for record in paths:
                        _check(tuned, record, compared)
        if len(scale) == 1:  # then an error in the column's unit can be read off
            unit = f" / {scale[0]:.3g} {next(iter(compared.values()))}".rstrip()
        scale = scale * np.sqrt(len(scale))
        return cls(
            title=content.title, estimates=", ".join(compared), period=first.period,
            scored_from=-np.inf, plant={}, methods=methods, table=[_RECORDED],
            conditions={_RECORDED: Condition(f"{'one-step ' * predicts}error{unit}")},
            training={"tuned": Training("tuned", [_RECORDED])}, shown=list(methods)[:5],
            budget=content.budget, seeds=Seeds(len(training), len(held_out), len(held_out)),
            seed=content.seed, name=path.stem, file=str(path), specifications=specifications,
            segments=[replace(part, truth=part.truth / scale) for part in (*training, *held_out)],
            compared=compared, scale=scale, predicts=predicts,
        )  # fmt: skip

    @property
    def module(self) -> Any:
        """None, as nothing is simulated."""
        return None

    @property
    def reads(self) -> list[Path]:
        """All files that it is made of."""
        paths = [tuned.path for tuned in self.specifications.values()]
        return [Path(self.file), *paths, *(segment.path for segment in self.segments)]

    def record(self, condition: str, seed: int) -> Segment:
        """The segment that a seed counts."""
        return self.segments[seed - 1]

    def training_seeds(self, repeat: int) -> list[int]:
        """The segments for training, which come first."""
        return [1 + k for k in range(self.seeds.training)]

    def held_out_seeds(self, count: int) -> list[int]:
        """The segments after them."""
        return [1 + self.seeds.training + k for k in range(count)]

    def make(self, method: str, settings: Settings, condition: str, *, given: bool) -> Runner:
        """A candidate with other numbers in its specification."""
        tuned = self.specifications[method]
        ready = {path: tuned.estimation(settings, path) for path in {s.path for s in self.segments}}

        @cache
        def estimates(path: Path) -> tuple[Array, Array] | Exception:
            """Times and estimates of the rows that have them, or why there are none."""
            try:
                parts = ready[path].feed(tuned.cells(path)), ready[path].finish()
            except FAILURES as error:
                return error
            time, numbers = (np.concatenate([part[k] for part in parts]) for k in (0, 1))
            columns = _columns(tuned, ready[path], self.compared)
            values = np.column_stack([way.of(numbers[:, c]) for c, way in columns]) / self.scale
            known = np.isfinite(values).all(axis=1)
            return time[known], values[known]

        def run(segment: Any) -> Array:
            result = estimates(segment.path)
            if isinstance(result, Exception):
                raise result
            time, values = result
            rows = np.searchsorted(time, segment.time + tuned.period / 2, "right") - 1
            if rows[0] < 0:
                return np.full_like(segment.truth, np.nan)
            estimate: Array = segment.truth - values[rows] if self.predicts else values[rows]
            return estimate

        return run


def _method(name: str, candidate: Candidate, specification: TunedSpecification) -> Method:
    if not re.fullmatch(r"[\w-]+", name):
        raise InputError("", "must be letters, digits, _ and -, as it names a file")
    with located("ranges"):
        own = {key: specification.number(key) for key in candidate.ranges}
    return Method(
        " ".join(candidate.label.split()) or name, "", "", dict(candidate.ranges),
        paper=Own(own, candidate.specification), fails={_RECORDED: "which the table shows"},
        causal=not specification.stated.smooth,
    )  # fmt: skip


def _segments(
    content: TuneFile, folder: Path, first: TunedSpecification
) -> tuple[Outputs, list[Segment], list[Segment]]:
    """The reference, and the segments for training and held-out ones."""
    files = dict.fromkeys(part.file for part in (*content.training, *content.held_out))
    truths = {file: _truth(content.reference, first, folder / file) for file in files}
    compared = next(iter(truths.values()))[0]
    copies: dict[str, str] = {}  # a record by the name that it has first
    for file, rows_in in truths.items():
        originals = (other for other in copies if _are_copies(rows_in, truths[other]))
        copies[file] = next(originals, file)
    ends: list[tuple[str, str, float, float]] = []
    by_kind: dict[str, list[Segment]] = {"training": [], "held_out": []}
    for kind, segments in by_kind.items():
        for k, part in enumerate(getattr(content, kind)):
            key, (units, time, values) = f"{kind}.{k}", truths[part.file]
            if units != compared:
                raise InputError(f"{key}.file", f"{part.file} has other units than {ends[0][1]}")
            since, until = time[0], np.nextafter(time[-1], np.inf)
            if part.since is not None:
                since = first.seconds(f"{key}.since", part.since, folder / part.file)
            if part.until is not None:
                until = first.seconds(f"{key}.until", part.until, folder / part.file)
            if until <= since:
                raise InputError(f"{key}.until", f"{until:g} must be later than since, {since:g}")
            for low, high in pairwise(np.linspace(since, until, part.segments + 1)):
                inside = (time >= low) & (time < high)
                if inside.sum() < 2:
                    said = f"{part.file} has {inside.sum()} from {low:g} s to {high:g} s"
                    raise InputError(key, f"must have two rows or more in each segment; {said}")
                none = np.empty((0, 0))
                segments.append(Segment(
                    time[inside], none, none, values[inside], folder / part.file
                ))  # fmt: skip
                ends.append((key, part.file, low, high))
    for (earlier, file, low, high), (key, same, start, end) in combinations(ends, 2):
        if copies[file] == copies[same] and start < high - 1e-9 and low < end - 1e-9:
            copy = "" if file == same else f", of which {same} is a copy"
            raise InputError(key, f"overlaps {earlier} in {file}{copy}; segments must not")
    if len(by_kind["held_out"]) < _HELD_OUT:
        said = f"has {len(by_kind['held_out'])} segments, must have {_HELD_OUT} or more"
        raise InputError("held_out", f"{said}; split a part by the key segments")
    return compared, by_kind["training"], by_kind["held_out"]


def _are_copies(rows: Rows, other: Rows) -> bool:
    return np.array_equal(rows[1], other[1]) and np.array_equal(rows[2], other[2])


def _truth(
    reference: Mapping[str, ReferenceColumn], first: TunedSpecification, record: Path
) -> Rows:
    """The columns that are compared, and their reference: times and values of a record."""
    columns = [
        find_column(f"reference.{name}", Column(ref.column, ref.unit), "", first.header(record),
                    str(record))
        for name, ref in reference.items()
    ]  # fmt: skip
    layout, time, values, truth = first.rows(record, *(title for title, _, _ in columns))
    compared = {name: unit for name, (_, _, unit) in zip(reference, columns, strict=True)}
    if not reference:
        truth = values[:, : layout.measurements]
        measured = slice(layout.timed, layout.timed + layout.measurements)
        pairs = zip(layout.names[measured], layout.units[measured], strict=True)
        compared = {f"residual {name}": unit for name, unit in pairs}
    known = np.isfinite(truth).all(axis=1) & np.isfinite(time)
    if not known.any():
        raise InputError(str(record), "has no row with a number in each column that is compared")
    return compared, time[known], truth[known]


def _check(tuned: TunedSpecification, record: Path, compared: Outputs) -> None:
    """Refuse a candidate that does not run over a record, or has not what is compared."""
    estimation = tuned.estimation({}, record)
    _columns(tuned, estimation, compared)
    with suppress(DivergenceError), tuned.file(record).lines():  # other numbers may be better
        estimation.feed(tuned.cells(record))


def _check_predictions(tuned: TunedSpecification, first: TunedSpecification, record: Path) -> None:
    """Refuse a candidate without predictions, or with those of something else."""
    if tuned.stated.sampling != first.stated.sampling:
        problem = (
            f"{tuned.path} must state the same sampling as {first.path}, as there is no reference"
        )
        raise InputError("", problem)
    layout, _, values, _ = tuned.rows(record)
    if _measured(layout) != _measured(first.rows(record)[0]):
        problem = f"{tuned.path} must measure the same as {first.path}, as there is no reference"
        raise InputError("", problem)
    # The residual of a row must change by as much as the measurement of that row does.
    estimation = tuned.estimation({}, record)
    y, u = np.split(values[np.isfinite(values).all(axis=1)][:20], [layout.measurements], axis=1)
    u = estimation.inputs.of(u)
    last = []
    for y_last in (y[-1], y[-1] + 1.0):
        y[-1] = y_last
        run = estimation.observer.run(y, u, start=estimation.design.begin(y[0]))
        last.append(estimation.design.residual(y, run.estimates)[-1])
    if not np.allclose(last[1] - last[0], 1.0):
        problem = "predicts no measurement from those before it, so there must be a reference"
        raise InputError("", f"{tuned.path} {problem}")


def _measured(layout: Layout) -> Sequence[str]:
    return layout.titles[layout.timed : layout.timed + layout.measurements]


def _columns(
    tuned: TunedSpecification, estimation: Estimation, compared: Outputs
) -> list[tuple[int, Conversion]]:
    """Places of compared columns among the estimates, and conversions to reference units."""
    columns = {column.name: (c, column.unit) for c, column in enumerate(estimation.outputs.columns)}
    places = []
    for name, unit in compared.items():
        if name not in columns:
            raise InputError("", f"{tuned.path} has no estimate {name!r}{nearest(name, columns)}")
        place, own = columns[name]
        way = conversion(name, own or unit or "1", unit or own or "1")
        places.append((place, way))
    return places
