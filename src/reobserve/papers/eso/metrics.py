"""Stage metrics: errors and lags of the estimated faults, and what the certificates say."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from reobserve.ledger.types import Settings, read_job
from reobserve.papers.eso import keys
from reobserve.papers.eso.scoring import check_rules, scores
from reobserve.scoring.metrics import Metric
from reobserve.timeseries.series import Series

Rows = Sequence[Mapping[str, Any]]


def measure(
    settings: Settings,
    plant: Series,
    estimates: Mapping[str, Series],
    study: Rows | None = None,
) -> list[Metric]:
    """The numbers of a figure; see ``results/README.md`` for their names.

    Raises
    ------
    InputError
        If a setting of the metrics cannot be used.
    """
    job = read_job(keys.Ledger, settings)
    check_rules(job.metrics, job.plant)
    found = []
    for name, estimate in estimates.items():
        found += [Metric(name, *score) for score in scores(job.metrics, plant, estimate)]
    if study is not None:
        found += _brief(study)
    return found


def _brief(study: Rows) -> Iterator[Metric]:
    """Each number of a design, named after what was chosen."""
    for row in study:
        place = f"rate_{float(row['filter_rate']):g}_{row['choice']}_{float(row['level']):g}"
        yield Metric(row["kind"], f"{row['quantity']}_at_{place}", float(row["value"]), row["unit"])
