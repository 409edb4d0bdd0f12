"""Every figure, table and theory that is expected or built, compared; nothing stops the rest."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from reobserve.errors import InputError, ReobserveError
from reobserve.evidence.figure_diff import pixels
from reobserve.evidence.figure_diff.built import built_series, drawings, why_missing
from reobserve.evidence.figure_diff.model import Item, MovedSeries
from reobserve.evidence.golden import claims as golden_claims
from reobserve.evidence.golden.comparison import metric_differences, series_differences
from reobserve.evidence.golden.files import folder, read_series
from reobserve.evidence.golden.kept import THEORY, by_name, kept_records
from reobserve.evidence.golden.tables import compare_rows, read_cells
from reobserve.ledger.ledger import Ledger
from reobserve.ledger.names import stored_parameters
from reobserve.scoring.metrics import read_metrics

_PARTS = (".metrics.csv", ".tolerances.csv")


def compare_all(project: Path, reference: Path, results: Path) -> list[Item]:
    """An item for each that is expected or built, paper by paper.

    Expected are the drawings in ``reference/PAPER`` and the golden numbers of ``project``; what is
    built stands in ``results/PAPER``, and the logs in a folder beside ``results``.
    """
    folders = [reference, results, project / "tests" / "golden"]
    papers = {path.name for folder in folders for path in folder.glob("*/") if path.is_dir()}
    items: list[Item] = []
    for paper in sorted(papers):
        comparison = _Paper(paper, project, reference, results)
        items += comparison.items()
    return items + list(_claims(project, results))


def _claims(project: Path, results: Path) -> Iterator[Item]:
    """The verdicts on the claims of each paper that has some, accepted or built."""
    golden_verdicts, found, said = {}, {}, ""
    try:
        if golden_claims.golden_file(project).exists():
            golden_verdicts = golden_claims.read_golden(project)
    except InputError as error:
        said = str(error)
    missing = ""
    try:
        found = golden_claims.read_built(results)
    except InputError as error:
        missing = str(error)
    for paper in dict.fromkeys([*golden_verdicts, *found]):
        item = Item(paper, "claims", "claims", gaps=[said] if said else [])
        if paper not in found:
            item.why_missing = missing or "no claim was decided"
        elif paper not in golden_verdicts and not said:
            item.extra = True
        elif not said:
            item.deviations += golden_claims.compare(golden_verdicts, found, paper)
        yield item


class _Paper:
    """The comparison of one paper; without a ledger there is no way from a figure to its files."""

    def __init__(self, paper: str, project: Path, reference: Path, results: Path) -> None:
        self.paper = paper
        self.golden = folder(project, paper)
        self.reference = reference / paper
        self.results = results / paper
        self.ledger: Ledger | None = None
        self.no_ledger = ""
        try:
            self.ledger = Ledger.read(self.results / Path(stored_parameters(paper)).name)
        except InputError as error:
            self.no_ledger = str(error)

    def items(self) -> Iterable[Item]:
        tree = self.ledger.tree if self.ledger else {}
        kept = {path.name for path in self.golden.glob("*.csv")}
        theory = f"{THEORY}.metrics.csv"
        figures = {path.stem for f in (self.reference, self.results) for path in drawings(f)}
        figures |= {name.removesuffix(_PARTS[0]) for name in kept - {theory} if _PARTS[0] in name}
        for name in sorted(figures | set(tree.get("figures", {}))):
            yield self._figure(name)
        tables = {name.removesuffix(".csv") for name in kept if not name.endswith(_PARTS)}
        for name in sorted(tables | set(tree.get("tables", {}))):
            yield self._numbers_only(name, "table", f"{name}.csv")
        if theory in kept or THEORY in tree:
            yield self._numbers_only(THEORY, THEORY, theory)

    def _figure(self, name: str) -> Item:
        pictures = [folder / f"{name}.png" for folder in (self.reference, self.results)]
        reference, new = (path if path.is_file() else None for path in pictures)
        item = Item(self.paper, name, reference=reference, new=new)
        if new is None:
            item.why_missing = self._why_missing(item)
        elif reference is None:
            item.extra = True
        else:
            with _gap_noted(item):
                self._compare_pixels(item, reference, new)
        if reference is None and not (self.golden / f"{name}{_PARTS[0]}").exists():
            return item
        # What is missing has said so; what it was to be drawn from may be there all the same.
        metrics = self.results / f"{name}{_PARTS[0]}"
        if new is None and not metrics.exists():
            return item
        with _gap_noted(item):
            self._compare_series(item)
        with _gap_noted(item):
            self._compare_metrics(item, metrics)
        return item

    def _numbers_only(self, name: str, kind: str, file: str) -> Item:
        item = Item(self.paper, name, kind)
        if not (self.results / file).exists():
            item.why_missing = self._why_missing(item)
        elif not (self.golden / file).exists():
            item.extra = True
        elif kind == "table":
            with _gap_noted(item):
                self._compare_table(item, self.results / file)
        else:
            with _gap_noted(item):
                self._compare_metrics(item, self.results / file)
        return item

    def _why_missing(self, item: Item) -> str:
        if self.ledger is None:
            return self.no_ledger
        try:
            return why_missing(self.ledger, item.name, item.kind, self.results.parent)
        except InputError as error:
            return str(error)

    def _compare_pixels(self, item: Item, reference: Path, new: Path) -> None:
        old, now = pixels.read_pixels(reference), pixels.read_pixels(new)
        item.pixels = pixels.compare(old, now, f"{self.paper} {item.name}")

    def _compare_series(self, item: Item) -> None:
        if self.ledger is None:
            raise ReobserveError(self.no_ledger)
        scenario = self.ledger.section("figures", item.name)["scenario"]
        evaluation = built_series(self.ledger, item.name, self.results.parent)
        for part, kept in kept_records(evaluation, scenario).items():
            for moved in series_differences(kept, self.paper, part, self.golden):
                if not moved.exceeds:
                    continue
                item.deviations.append(moved)
                new, golden = kept.series[moved.column], read_series(self.golden, part)
                name = f"{part.rpartition('/')[2]}.{moved.column}"
                values, allowed = (
                    golden[moved.column].values,
                    golden[moved.column].tolerance.allowed,
                )
                item.series.append(
                    MovedSeries(name, new.unit, values, new.values, allowed, kept.period)
                )

    def _compare_metrics(self, item: Item, file: Path) -> None:
        found = by_name(read_metrics(file))
        compared = metric_differences(found, self.paper, item.name, self.golden)
        item.deviations += (one for one in compared if one.exceeds)

    def _compare_table(self, item: Item, file: Path) -> None:
        rows = read_cells(file, self.paper)
        item.deviations += compare_rows(rows, self.paper, item.name, self.golden)


@contextmanager
def _gap_noted(item: Item) -> Iterator[None]:
    """What cannot be compared is a gap in the item and no reason to stop."""
    try:
        yield
    except ReobserveError as error:
        item.gaps.append(str(error))
