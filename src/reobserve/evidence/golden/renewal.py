"""New golden numbers from evaluations under all conditions; what has not moved keeps its bytes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from reobserve.errors import InputError, ReobserveError
from reobserve.evidence.golden import digests, files, tables
from reobserve.evidence.golden.comparison import compare, off_by
from reobserve.evidence.golden.files import Golden, text_of
from reobserve.evidence.golden.kept import Array, Kept, KeptPaper
from reobserve.evidence.golden.tolerances import determined, measured
from reobserve.timeseries.series import Channel


@dataclass(frozen=True)
class Evidence:
    """What was found of a paper: where code paths are pinned, elsewhere, and with steps halved."""

    pinned: KeptPaper
    elsewhere: Sequence[KeptPaper]
    refined: KeptPaper


@dataclass
class Renewal:
    """The new golden files of a paper: what moved, a line each, and how to write them."""

    moved: list[str] = field(default_factory=list)
    writes: list[Callable[[], None]] = field(default_factory=list)

    def write(self) -> None:
        """Write all files. Nothing was written before, so that a refusal leaves none behind."""
        for write in self.writes:
            write()


def prepare(paper: str, found: Evidence, golden: Path, *, anew: bool = False) -> Renewal:
    """The renewal of all parts of a paper that were evaluated.

    What has not moved keeps its digits and its tolerance, unless all is to be ``anew``.

    Raises
    ------
    InputError
        If a golden file is there and damaged in a way that hides what else is kept.
    ReobserveError
        If a word of a table depends on the processor.
    """
    renewal = Renewal()
    left_out = {} if anew else files.read_undetermined(golden)
    unmoved = not anew
    for part, kept in found.pinned.parts.items():
        others = [paper_there.parts[part] for paper_there in found.elsewhere]
        refined = found.refined.parts[part]
        try:
            renewal.moved += map(str, compare(kept, paper, part, golden))
        except InputError as error:
            renewal.moved.append(f"{paper} {part}: written anew ({error})")
        work = _Part(paper, part, golden, left_out.get(part, {}), anew)
        renewal.writes += work.renew(kept, others, refined)
        left_out[part] = work.left_out
        unmoved = unmoved and work.unmoved
    renewal.writes.append(lambda: files.write_undetermined(golden, left_out))
    if not (unmoved and _made_elsewhere(golden)):
        stages, where = found.pinned.digests, digests.environment()
        renewal.writes.append(lambda: digests.write(golden, stages, where))
    return renewal


def _made_elsewhere(golden: Path) -> bool:
    """Whether digests are kept, and hold for another environment than this one."""
    try:
        return digests.read(golden)[0] != digests.environment()
    except InputError:
        return False


class _Part:
    """A part on its way to its files."""

    def __init__(
        self, paper: str, part: str, golden: Path, left_out: dict[str, float], anew: bool
    ) -> None:
        self.paper, self.part, self.golden, self.anew = paper, part, golden, anew
        self.before = left_out
        self.left_out: dict[str, float] = {}
        self.unmoved = True

    def renew(self, kept: Kept, others: Sequence[Kept], refined: Kept) -> list[Callable[[], None]]:
        """What writes the files."""
        golden, part = self.golden, self.part
        if kept.cells is not None:
            rows, columns = self._table(kept.cells, [other.cells or () for other in others])
            return [lambda: tables.write_rows(golden, self.paper, part, rows, columns)]
        writes: list[Callable[[], None]] = []
        if kept.metrics or not kept.series:
            metrics = self._numbers(
                self._before(files.read_metrics),
                kept.metrics, [other.metrics for other in others], refined.metrics,
            )  # fmt: skip
            writes.append(lambda: files.write_metrics(golden, part, metrics))
        if kept.series:
            series = self._numbers(
                self._before(files.read_series),
                kept.series, [other.series for other in others], _at_times_of(kept, refined),
            )  # fmt: skip
            writes.append(lambda: files.write_series(golden, part, series, kept.period))
        return writes

    def _before(self, read: Callable[[Path, str], dict[str, Golden]]) -> dict[str, Golden]:
        """The golden numbers as they are; none where they cannot be read, or all is to be anew."""
        try:
            return {} if self.anew else read(self.golden, self.part)
        except InputError:
            return {}

    def _numbers(
        self,
        before: Mapping[str, Golden],
        found: Mapping[str, Channel],
        others: Sequence[Mapping[str, Channel]],
        refined: Mapping[str, Channel],
    ) -> dict[str, Golden]:
        new = {}
        for name, number in found.items():
            there = [other[name].values if name in other else np.empty(0) for other in others]
            column, moved = self._column(
                before.get(name), text_of(number.values), number.unit, [number.values, *there],
                refined[name].values,
            )  # fmt: skip
            size = _size(number.values)
            if determined(moved, size, before=name not in self.before):
                new[name] = column
            else:
                part = min(moved / size, 1.0) if size else 1.0
                self.left_out[name] = self.before.get(name, float(f"{part:.0e}"))
        return new

    def _column(
        self,
        before: Golden | None,
        text: tuple[str, ...],
        unit: str,
        everywhere: Sequence[Array],
        refined: Array,
    ) -> tuple[Golden, float]:
        """A column, and how far it was seen to move; ``everywhere`` begins with its own values.

        It keeps its text where that is within half its rounding: the rest is for processors.
        """
        values = everywhere[0]
        moved = max(_furthest(one, values) for one in everywhere)
        halved = _furthest(*_common(refined, values))
        tolerance = measured(moved, halved, _size(values), before.tolerance if before else None)
        if before is not None:
            off = _furthest(values, before.values)
            if unit == before.unit and off <= tolerance.rounding / 2:
                text = before.text
            else:
                self.unmoved = False
        return Golden(text, unit, tolerance), moved

    def _table(
        self,
        rows: Sequence[Mapping[str, str]],
        others: Sequence[Sequence[Mapping[str, str]]],
    ) -> tuple[list[dict[str, str]], dict[str, Golden]]:
        """The rows with the golden text wherever it is within rounding, and the tolerances."""
        numeric = tables.numeric_columns(rows)
        before = self._before(_columns_of(self.paper))
        new = [dict(row) for row in rows]
        columns = {}
        for name in rows[0] if rows else ():
            text = [row[name] for row in rows]
            there = [[row[name] for row in other] for other in others]
            if name not in numeric:
                if any(texts != text for texts in there):
                    raise ReobserveError(
                        f"{self.paper} {self.part}: the words in {name!r} depend on the processor"
                    )
                continue
            values = [np.array([files.as_number(cell) for cell in texts]) for texts in there]
            here = np.array([files.as_number(cell) for cell in text])
            columns[name], _ = self._column(
                before.get(name), tuple(text), "", [here, *values], here
            )
            for row, cell in zip(new, columns[name].text, strict=True):
                row[name] = cell
        return new, columns


def _columns_of(paper: str) -> Callable[[Path, str], dict[str, Golden]]:
    """How the columns of a table of a paper are read, those that have a tolerance."""

    def read(golden: Path, table: str) -> dict[str, Golden]:
        rows = tables.read_rows(golden, paper, table)
        tolerances = files.read_tolerances(golden, table)
        return {
            name: Golden(tuple(row[name] for row in rows), unit, tolerance)
            for name, (unit, tolerance) in tolerances.items()
            if all(name in row for row in rows)
        }

    return read


def _furthest(values: Array, others: Array) -> float:
    """The largest deviation; inf where one has more rows."""
    if values.shape != others.shape:
        return float("inf")
    return float(np.max(off_by(values, others), initial=0.0))


def _at_times_of(kept: Kept, refined: Kept) -> dict[str, Channel]:
    """The series of a refined run at the times of the rows kept; nan where it has no such row."""
    found = {}
    for name, channel in refined.series.items():
        rows = len(kept.series[name].values) if name in kept.series else 0
        times = np.arange(rows) * kept.period
        places = np.round(times / refined.period).astype(int)
        there = (np.abs(places * refined.period - times) < 1e-6 * refined.period) & (
            places < len(channel.values)
        )
        values = np.full(rows, np.nan)
        values[there] = channel.values[places[there]]
        found[name] = Channel(values, channel.unit)
    return found


def _common(values: Array, others: Array) -> tuple[Array, Array]:
    """The rows that both have and that are numbers in both; halving a step may end a run later."""
    rows = min(len(values), len(others))
    both = np.isfinite(values[:rows]) & np.isfinite(others[:rows])
    return values[:rows][both], others[:rows][both]


def _size(values: Array) -> float:
    return float(np.max(np.abs(values), initial=0.0, where=np.isfinite(values)))
