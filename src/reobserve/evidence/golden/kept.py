"""What golden numbers keep of an evaluation: rows of series, metrics, cells of tables.

They come in parts, each with files of its own: a figure, a table, the theory, and each record that
figures show, ``SCENARIO/plant`` or ``SCENARIO/OBSERVER``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.evidence.golden.digests import stage_digests
from reobserve.plain_data.files import cell
from reobserve.replication.evaluation import Evaluator, Replication
from reobserve.replication.steps import paper_module
from reobserve.scoring.metrics import Metric
from reobserve.timeseries.series import Channel, Series

Array = NDArray[np.float64]

THEORY = "theory"
PLANT = "plant"
PERIOD = 0.1  # [s] between the rows kept of each series, as near as its step allows


@dataclass(frozen=True)
class Kept:
    """What is kept of a part: the series of a record, the metrics of a figure or a theory, or the
    ``cells`` of a table. ``period`` is the time [s] between rows of the series.
    """

    series: Mapping[str, Channel] = field(default_factory=dict)
    metrics: Mapping[str, Channel] = field(default_factory=dict)
    cells: tuple[Mapping[str, str], ...] | None = None
    period: float = PERIOD


@dataclass(frozen=True)
class KeptPaper:
    """All parts of a paper by name, and the digests of what its stages gave; see `digests`."""

    parts: Mapping[str, Kept]
    digests: Mapping[str, str]


def part_names(tree: Mapping[str, Any]) -> list[str]:
    """What can be evaluated by itself: the figures, the tables and the theory of a ledger."""
    theory = [THEORY] if THEORY in tree else []
    return [*tree["figures"], *tree.get("tables", {}), *theory]


def record_names(tree: Mapping[str, Any]) -> list[str]:
    """The parts that hold series: what figures show of a scenario, once for each that shows it."""
    named = [
        f"{body['scenario']}/{owner}"
        for body in tree["figures"].values()
        for owner in (PLANT, *body["observers"])
    ]
    return list(dict.fromkeys(named))


def kept_paper(evaluator: Evaluator, parts: Iterable[str] | None = None) -> KeptPaper:
    """All that is kept of a paper, or of these of its `part_names` and the records behind them.

    Raises
    ------
    InputError
        If a value of the ledger cannot be used.
    """
    names = list(part_names(evaluator.ledger.tree) if parts is None else parts)
    kept: dict[str, Kept] = {}
    for name in names:
        kept |= kept_parts(evaluator, name)
    return KeptPaper(kept, stage_digests(evaluator))


def kept_parts(evaluator: Evaluator, name: str) -> dict[str, Kept]:
    """What is kept of a table or the theory, or of a figure and its records; as `kept_paper`."""
    tree = evaluator.ledger.tree
    if name in tree["figures"]:
        evaluation = evaluator.figure(name)
        records = kept_records(evaluation, tree["figures"][name]["scenario"])
        return {**records, name: Kept(metrics=by_name(evaluation.numbers))}
    if name in tree.get("tables", {}):
        return {name: Kept(cells=table_cells(evaluator.ledger.paper, evaluator.table(name)))}
    return {name: Kept(metrics=by_name(evaluator.theory()))}


def kept_records(evaluation: Replication, scenario: str) -> dict[str, Kept]:
    """The rows of the series behind a figure that golden numbers keep, by `record_names`."""
    records = {PLANT: evaluation.plant, **evaluation.estimates}
    return {
        f"{scenario}/{owner}": Kept(
            dict(_columns(series)), period=series.step * _rows_between(series)
        )
        for owner, series in records.items()
    }


def by_name(metrics: Iterable[Metric]) -> dict[str, Channel]:
    """Metrics as numbers with units, by ``observer:metric``."""
    return {
        f"{metric.observer}:{metric.metric}": Channel(np.array([metric.value]), metric.unit)
        for metric in metrics
    }


def table_cells(paper: str, rows: Iterable[Mapping[str, Any]]) -> tuple[dict[str, str], ...]:
    """The rows of a table as their file holds them."""
    header = paper_module(paper, "table").HEADER
    return tuple({column: cell(row.get(column)) for column in header} for row in rows)


def _rows_between(series: Series) -> int:
    """How many samples there are to a row that is kept.

    If the step does not divide `PERIOD` it is a power of two, so that a run with half the step
    keeps rows at the same times. Of a step beyond `PERIOD` each sample is kept.
    """
    ratio = PERIOD / series.step
    if ratio >= 1 and math.isclose(ratio, round(ratio), rel_tol=1e-9):
        return round(ratio)
    return 1 << max(0, math.floor(math.log2(ratio)))


def _columns(series: Series) -> Iterator[tuple[str, Channel]]:
    every = _rows_between(series)
    units = {name: channel.unit for name, channel in series.channels.items()}
    for column, values in series.flat().items():
        name = column if column in units else column.rpartition("_")[0]
        if not name.endswith("_before"):
            yield column, Channel(values[::every].copy(), units[name])
