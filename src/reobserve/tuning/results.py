"""Tables of a comparison: files of scores and of comparisons, and the summary."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from reobserve.core.files import NAME, SCORE, YES_NO, Kind, read_table, write_table
from reobserve.tuning.scoring import DECIDED, PAPER, Cell
from reobserve.tuning.task import Task
from reobserve.tuning.tuned_file import TunedMethod, read_tuned

_ROW = ("condition", "method", "training", "given_noise")
SCORES = (*_ROW, "seed", "error", "lag", "quantile", "missed", "nees", "failed")
CELLS = (
    *_ROW, "seeds", "error", "low", "high", "first", "ratio", "ratio_low", "ratio_high", "within",
    "failed", "lag", "quantile", "missed", "nees", "repeat_low", "repeat_high",
)  # fmt: skip


_MEANS = ("lag", "quantile", "missed", "nees")  # arithmetic means over records
NONE = "–"  # in a cell of the summary
UNDECIDED = "?"  # after an error
_NOTES = {  # of columns of the summary
    "lag": "lag: the delay of the truth that fits the estimate best, the first minimum of the "
    "squared error, mean over the records of the first column.",
    "95 %": "95 %: this quantile of the error, over the root mean square of the truth.",
    "missed": "missed: share of records without an alarm in time.",
    "NEES": "NEES: mean of (estimate - truth)^2 over its variance, 1 if the variance is right.",
}
_WITHIN = Kind(
    lambda cell: cell in ("yes", "no", "undecided", "late"), "yes, no, undecided or late"
)
_SCORE_OR_NONE = Kind(lambda cell: not cell or SCORE.allows(cell), "a number, nan, inf or empty")


def write_scores(task: Task, cells: Iterable[Cell], path: Path) -> None:
    """Write one row for each run on a held-out record."""
    write_table(
        path,
        (
            {**_row(cell), "seed": seed, "error": score.error, "lag": score.lag,
             "quantile": score.quantile, "missed": score.missed, "nees": score.nees,
             "failed": _said(score.failed)}
            for cell in cells
            for seed, score in zip(
                task.held_out_seeds(len(cell.scores)), cell.scores, strict=True
            )
        ),
        SCORES,
    )  # fmt: skip


def write_cells(cells: Iterable[Cell], path: Path, *, seal: bool = False) -> None:
    """Write one row for each method in a condition: geometric means, intervals, comparisons."""
    write_table(path, map(_cell, cells), CELLS, seal=seal)


_WORDS = {"condition": NAME, "method": NAME, "training": NAME, "given_noise": YES_NO,
          "within": _WITHIN}  # fmt: skip


def read_cells(path: Path) -> list[dict[str, Any]]:
    """The rows that `write_cells` wrote, numbers as numbers, or `InputError` if damaged."""
    kinds = dict.fromkeys(CELLS, _SCORE_OR_NONE) | _WORDS
    return [
        {key: text if key in _WORDS else float(text or "nan") for key, text in row.items()}
        for row in read_table(path, CELLS, kinds, _ROW)
    ]


def _row(cell: Cell) -> dict[str, Any]:
    row = cell.row
    return {
        "condition": cell.condition, "method": row.method, "training": row.training,
        "given_noise": _said(row.given),
    }  # fmt: skip


def _cell(cell: Cell) -> dict[str, Any]:
    ended = [score for score in cell.scores if not score.failed]
    return {
        **_row(cell),
        "seeds": len(cell.scores),
        **dict(zip(("error", "low", "high"), cell.error, strict=True)),
        "first": cell.first,
        **dict(zip(("ratio", "ratio_low", "ratio_high"), cell.ratio, strict=True)),
        "within": cell.within,
        "failed": 1.0 - len(ended) / len(cell.scores),
        **{key: _mean(getattr(score, key) for score in ended) for key in _MEANS},
        **dict(zip(("repeat_low", "repeat_high"), cell.repeats or (None, None), strict=True)),
    }


def _mean(values: Iterable[float]) -> float | None:
    """The mean of those that exist, if some do."""
    known = [value for value in values if not math.isnan(value)]
    return float(np.mean(known)) if known else None


def _said(value: bool) -> str:
    return "yes" if value else "no"


@dataclass(frozen=True)
class Results:
    """A task with its cells as the file has them, numbers as numbers, and its tuned methods."""

    task: Task
    cells: Sequence[Mapping[str, Any]]
    tuned: Mapping[str, TunedMethod]

    @classmethod
    def read(cls, task: Task, table: Path, tuned: Path) -> Results:
        """Read the table and a folder of settings, or `InputError` if one is missing or damaged."""
        return cls(task, read_cells(table), read_tuned(task, tuned))

    def cell(
        self, condition: str, method: str, training: str = "", given: bool = False
    ) -> Mapping[str, Any] | None:
        """A row of the table, if there is one, by default that of the main training set."""
        wanted = (condition, method, training or self.task.main, _said(given))
        matches = (cell for cell in self.cells if tuple(cell[key] for key in _ROW) == wanted)
        return next(matches, None)

    def rows(self) -> list[tuple[str, str, str, bool]]:
        """The rows of the table: label, method, training set and whether the noise is given."""
        rows = []
        for name, method in self.task.methods.items():
            rows.append((method.label, name, self.task.main, False))
            if method.given_noise:
                rows.append((f"{method.label}, given R", name, self.task.main, True))
            if method.paper is not None:
                rows.append((f"{method.label}, {self.task.own}", name, PAPER, False))
        return rows

    def held_out(self, method: str) -> list[dict[int, float]]:
        """The held-out errors over evaluations, for each repeat of the main training set."""
        repeats = self.tuned[method].training[self.task.main].repeats
        return [{int(n): error for n, error in repeat.held_out.items()} for repeat in repeats]

    def evaluations_needed(self, method: str) -> list[int]:
        """The evaluations after which the error stays within 5 % of the final, for each repeat."""
        counts = []
        for errors in self.held_out(method):
            final = list(errors.values())[-1]
            late = max((n for n, one in errors.items() if one > (1 + DECIDED) * final), default=0)
            counts.append(next(n for n in errors if n > late))
        return counts


def summary(results: Results) -> str:
    """The table of a task in Markdown: what a method needs, guarantees, costs and reaches."""
    task = results.task
    titles = [task.conditions[condition].title for condition in task.table]
    columns = getattr(task.module, "COLUMNS", ("lag", "95 %"))
    head = [
        "method", "needs", "guarantees", "p", "n95", *titles, *columns, "missed", "NEES",
        "cost", "edges",
    ]  # fmt: skip
    lines = []
    for label, name, training, given in results.rows():
        method, first = task.methods[name], results.cell(task.table[0], name, training)
        cells = [results.cell(condition, name, training, given) for condition in task.table]
        tuning, cost = results.tuned[name].training[task.main], results.tuned[name].cost
        edges = sorted(
            {f"{key} ({end})" for repeat in tuning.repeats for key, end in repeat.edges.items()}
        )
        about = [method.needs, method.guarantees, str(len(method.ranges)),
                 str(median(results.evaluations_needed(name)))]  # fmt: skip
        of_first = first if first and not given else {}
        lines.append([
            label, *(about if training != PAPER and not given else [""] * 4), *map(_shown, cells),
            _number(of_first.get("lag"), ".0f", 1000, " ms"),
            _number(of_first.get("quantile"), ".2f"),
            _number(of_first.get("missed"), ".0f", 100, " %"),
            _number(of_first.get("nees"), ".3g"),
            f"{cost.sample:g} µs, {cost.construction:g} ms" if not given else "",
            ", ".join(sorted(edges)) if training == task.main and not given else "",
        ])  # fmt: skip
    filled = [k for k in range(len(head)) if any(line[k] for line in lines)]
    rows = [[line[k] or NONE for k in filled] for line in (head, ["---"] * len(head), *lines)]
    notes = [
        "Geometric means over held-out records, with intervals of 95 %.",
        f"Bold: within 5 % of the best row in the column; {UNDECIDED}: undecided; neither: not.",
        *(text for title, text in _NOTES.items() if title in rows[0]),
        getattr(task.module, "NOTE", ""),
        f"{NONE}: there is none for this row, or it is that of a row above.",
    ]
    said = " ".join(filter(None, notes))
    return "\n".join([f"### {task.title}", "", *map(_line, rows), "", said]) + "\n"


def _number(value: float | None, digits: str, factor: float = 1.0, unit: str = "") -> str:
    """A number in a cell, empty if there is none."""
    return "" if value is None or math.isnan(value) else f"{factor * value:{digits}}{unit}"


def _shown(cell: Mapping[str, Any] | None) -> str:
    """Error and interval: bold where it is within 5 % of the best, with ? if that is undecided."""
    if cell is None:
        return ""
    mean, low, high = (f"{cell[key]:#.3g}" for key in ("error", "low", "high"))
    text = {"yes": f"**{mean}**", "undecided": f"{mean}{UNDECIDED}"}.get(cell["within"], mean)
    failed = f", {100 * cell['failed']:.0f} % failed" if cell["failed"] else ""
    missed = f", {100 * cell['missed']:.0f} % missed" if cell["missed"] > 0 else ""
    return f"{text} [{low} {high}]{failed}{missed}"


def _line(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"
