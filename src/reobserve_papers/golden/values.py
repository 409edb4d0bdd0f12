"""The numbers behind a figure, a table or the theory: of a build, or of an evaluation in memory."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from reobserve.core.files import cell, read_rows
from reobserve_papers.golden.number_files import GoldenNumber, Key
from reobserve_papers.metrics.metrics import Metric, read_metrics
from reobserve_papers.signals.series import Series
from reobserve_papers.steps.compute import paper_module
from reobserve_papers.steps.evaluation import Evaluator

THEORY = "theory"
_PLANT = "plant"
_SAMPLES = 25  # intervals between the samples of a series that are kept


def part_names(tree: Mapping[str, Any]) -> list[str]:
    """The parts with a golden file: the figures, the tables and the theory of a parameter file."""
    theory = [THEORY] if THEORY in tree else []
    return [*tree["figures"], *tree.get("tables", {}), *theory]


def records(tree: Mapping[str, Any], figure: str) -> list[str]:
    """The plant and the observers whose series no earlier figure shows in the same scenario."""
    seen: set[str] = set()
    for name, body in tree["figures"].items():
        shown = [_PLANT, *body["observers"]]
        if name == figure:
            return [source for source in shown if f"{body['scenario']}/{source}" not in seen]
        seen.update(f"{body['scenario']}/{source}" for source in shown)
    return []


def built_numbers(folder: Path, tree: Mapping[str, Any], part: str) -> dict[Key, GoldenNumber]:
    """The numbers of a part that was built, or `InputError` if a file is missing or damaged."""
    if part in tree.get("tables", {}):
        header, lines = read_rows(folder / f"{part}.csv")
        return _cells([dict(zip(header, line, strict=True)) for line in lines])
    numbers = _metrics(read_metrics(folder / f"{part}.metrics.csv"))
    if part in tree["figures"]:
        scenario = folder / tree["figures"][part]["scenario"]
        for source in records(tree, part):
            numbers |= _samples(source, Series.read(scenario / f"{source}.parquet"))
    return numbers


def evaluated_numbers(evaluator: Evaluator, part: str) -> dict[Key, GoldenNumber]:
    """The numbers of a part, computed here, or `InputError` if a parameter cannot be used."""
    tree = evaluator.parameters.tree
    if part in tree.get("tables", {}):
        header = paper_module(evaluator.parameters.package, "table").HEADER
        rows = evaluator.table(part)
        return _cells([{name: cell(row.get(name)) for name in header} for row in rows])
    if part == THEORY:
        return _metrics(evaluator.theory())
    result = evaluator.figure(part)
    numbers = _metrics(result.numbers)
    for source in records(tree, part):
        numbers |= _samples(source, result.plant if source == _PLANT else result.estimates[source])
    return numbers


def _cells(rows: Iterable[Mapping[str, str]]) -> dict[Key, GoldenNumber]:
    return {
        (f"row {line}", column, ""): GoldenNumber(value)
        for line, row in enumerate(rows, start=1)
        for column, value in row.items()
    }


def _metrics(metrics: Iterable[Metric]) -> dict[Key, GoldenNumber]:
    return {(m.observer, m.metric, ""): GoldenNumber(_text(m.value), m.unit) for m in metrics}


def _samples(source: str, series: Series) -> dict[Key, GoldenNumber]:
    """Samples at even distances, and two in the first interval for how an estimate starts.

    If the step is halved they are at the same times.
    """
    steps = len(series.time) - 1
    if steps % _SAMPLES == 0:
        every = steps // _SAMPLES
    else:  # a power of two: 20 to 40 intervals
        every = 1 << max(0, (steps // 20).bit_length() - 1)
    rows = [0, *(every // n for n in (4, 2) if every % n == 0), *range(every, steps + 1, every)]
    numbers = {}
    for column, values in series.flat().items():
        name = column if column in series.channels else column.rpartition("_")[0]
        if name.endswith("_before"):  # left limits at jumps
            continue
        for time, value in zip(series.time[rows], values[rows], strict=True):
            numbers[source, column, f"{time:.9g}"] = GoldenNumber(
                _text(value), series.channels[name].unit
            )
    return numbers


def _text(value: float) -> str:
    return f"{value:.14g}"
