"""Numbers as tables for readers: metrics by observer, and tables of the papers."""

from __future__ import annotations

import csv
import io
import math

from reobserve.errors import InputError
from reobserve.evidence.meanings import Meanings
from reobserve.evidence.report.model import Table
from reobserve.evidence.report.reading import Project
from reobserve.scoring.metrics import read_metrics

# Rows of a figure's table; sweeps of studies have hundreds, which only files serve well.
MOST_ROWS = 40

# More observers, or fewer of the metrics of each, and a column for each makes no good table.
_MOST_COLUMNS = 6
_LEAST_FILLED = 0.6


def metrics_table(
    project: Project, path: str, known: Meanings, most: int | None = MOST_ROWS
) -> Table:
    """The metrics of a file: a row a metric, a column an observer where that makes a good table.

    Rows after the first ``most`` are counted and left out.

    Raises
    ------
    InputError
        If the file is missing or no table of metrics.
    """
    rows = project.named(path, read_metrics)
    values = {(row.metric, row.unit, row.observer): _number(row.value) for row in rows}
    observers = list(dict.fromkeys(row.observer for row in rows))
    metrics = list(dict.fromkeys((row.metric, row.unit) for row in rows))
    full = len(values) >= _LEAST_FILLED * len(metrics) * len(observers)
    pivot = len(observers) <= _MOST_COLUMNS and full
    if pivot:
        header: tuple[str, ...] = ("metric", *observers, "unit")
        body = [
            (metric, *(values.get((metric, unit, name), "") for name in observers), unit)
            for metric, unit in metrics
        ]
    else:
        header = ("observer", "metric", "value", "unit")
        body = [
            (observer, metric, value, unit) for (metric, unit, observer), value in values.items()
        ]
    numeric = tuple(name in (*observers, "value") and (not pivot or 0 < column < len(header) - 1)
                    for column, name in enumerate(header))  # fmt: skip
    if known:
        place = header.index("metric")
        header = (*header, "what it is")
        body = [(*row, _meaning(row[place], known)) for row in body]
        numeric = (*numeric, False)
    kept = body[:most]
    return Table(header, tuple(kept), numeric, len(body) - len(kept))


def plain_table(project: Project, path: str) -> Table:
    """A CSV as it stands; `InputError` if it cannot be read or is empty."""
    try:
        rows = list(csv.reader(io.StringIO(project.text(path)), strict=True))
    except csv.Error as error:
        raise InputError(path, f"cannot be read ({error})") from None
    if not rows:
        raise InputError(path, "is empty")
    header, *body = rows
    if any(len(row) != len(header) for row in body):
        raise InputError(path, f"has rows that have not {len(header)} cells")
    numeric = tuple(
        all(_is_number(row[column]) for row in body if row[column]) for column in range(len(header))
    )
    return Table(tuple(header), tuple(map(tuple, body)), numeric)


def _number(value: float) -> str:
    return "nan" if math.isnan(value) else f"{value:.4g}".replace("-", "−")


def _meaning(metric: str, known: Meanings) -> str:
    return next((text for pattern, text in known if pattern.fullmatch(metric)), "")


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
