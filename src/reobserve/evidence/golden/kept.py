"""What golden numbers keep of an evaluation: rows of series, metrics, cells of tables."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.evidence.golden.digests import stage_digests
from reobserve.pipeline.common import paper_module
from reobserve.pipeline.evaluation import Evaluation, Evaluator
from reobserve.plain_data.files import cell
from reobserve.scoring.metrics import Metric
from reobserve.timeseries.series import Channel, Series

Array = NDArray[np.float64]

THEORY = "theory"
PERIOD = 0.1  # [s] between the rows kept of each series


@dataclass(frozen=True)
class Kept:
    """What is kept of a figure, of a table (``cells``), or of a theory (``metrics``)."""

    series: Mapping[str, Channel] = field(default_factory=dict)
    metrics: Mapping[str, Channel] = field(default_factory=dict)
    cells: tuple[Mapping[str, str], ...] | None = None


@dataclass(frozen=True)
class KeptPaper:
    """All parts of a paper by name, and the digests of what its stages gave; see `digests`."""

    parts: Mapping[str, Kept]
    digests: Mapping[str, str]


def part_names(tree: Mapping[str, Any]) -> list[str]:
    """The figures, the tables and the theory of a ledger."""
    theory = [THEORY] if THEORY in tree else []
    return [*tree["figures"], *tree.get("tables", {}), *theory]


def kept_paper(evaluator: Evaluator, parts: Iterable[str] | None = None) -> KeptPaper:
    """All that is kept of a paper, or of these parts.

    Raises
    ------
    InputError
        If a value of the ledger cannot be used.
    """
    names = list(part_names(evaluator.ledger.tree) if parts is None else parts)
    kept = {name: kept_part(evaluator, name) for name in names}
    return KeptPaper(kept, stage_digests(evaluator))


def kept_part(evaluator: Evaluator, name: str) -> Kept:
    """What is kept of a figure, a table or the theory; raises as `kept_paper`."""
    tree = evaluator.ledger.tree
    if name in tree["figures"]:
        return kept_figure(evaluator.figure(name))
    if name in tree.get("tables", {}):
        return Kept(cells=table_cells(evaluator.ledger.paper, evaluator.table(name)))
    return Kept(metrics=by_name(evaluator.theory()))


def kept_figure(evaluation: Evaluation) -> Kept:
    """The rows of all series of a figure, and its metrics."""
    return Kept(kept_rows(evaluation), by_name(evaluation.metrics))


def kept_rows(evaluation: Evaluation) -> dict[str, Channel]:
    """The rows of all series of a figure that golden numbers keep, by owner and column."""
    series = dict(_columns("plant", evaluation.plant))
    for observer, estimate in evaluation.estimates.items():
        series.update(_columns(observer, estimate))
    return series


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


def _columns(owner: str, series: Series) -> Iterator[tuple[str, Channel]]:
    every = round(PERIOD / series.step)
    units = {name: channel.unit for name, channel in series.channels.items()}
    for column, values in series.flat().items():
        name = column if column in units else column.rpartition("_")[0]
        if not name.endswith("_before"):
            yield f"{owner}.{column}", Channel(values[::every].copy(), units[name])
