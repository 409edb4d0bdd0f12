"""Stage metrics: errors and lags of the estimated faults, and what the certificates say."""

from __future__ import annotations

from collections.abc import Iterator

from reobserve.ledger.figure_data import FigureData
from reobserve.papers.eso.scoring import check_rules, scores
from reobserve.scoring.metrics import Metric, scores_of

_CHOSEN = ("filter_rate", "choice", "level")  # of a design, by its kind


def measure(data: FigureData) -> Iterator[Metric]:
    """The numbers of a figure; see `MEANINGS`.

    Raises
    ------
    InputError
        If a setting of the metrics cannot be used.
    """
    job = data.job
    check_rules(job.metrics, job.plant)
    for name, estimate in data.estimates.items():
        yield from scores_of(name, scores(job.metrics, data.plant, estimate))
    if data.study:
        for design, numbers in data.study.groups("kind", *_CHOSEN, "quantity", "unit"):
            kind, rate, choice, level, quantity, unit = design
            at = {"rate": rate, choice: level}
            yield Metric.at(kind, (quantity, numbers.value(), unit), **at)
