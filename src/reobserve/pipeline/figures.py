"""A figure's numbers and its drawing, by what its paper says of both."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from reobserve.errors import located
from reobserve.ledger.figure_data import FigureData
from reobserve.ledger.types import Settings, declared_keys, read_job
from reobserve.pipeline.common import paper_module
from reobserve.scoring.metrics import Metric
from reobserve.scoring.study_table import StudyTable
from reobserve.timeseries.series import Series

Rows = Iterable[Mapping[str, Any]]


def figure_data(
    paper: str,
    settings: Settings,
    plant: Series,
    estimates: Mapping[str, Series],
    rows: Rows | None = None,
) -> FigureData:
    """The data of a figure of a paper; ``rows`` are those of its study, if it has one.

    Raises
    ------
    InputError
        If a setting cannot be used.
    """
    with located(paper):
        job = read_job(declared_keys(paper), settings)
    data = FigureData(job, plant, estimates)
    if rows is None:
        return data
    return replace(data, study=StudyTable.of(rows, paper_module(paper, "study_rows").KINDS))


def measure(paper: str, data: FigureData) -> list[Metric]:
    """The numbers of a figure; `InputError` if a setting of the metrics cannot be used."""
    with located(paper):
        return list(paper_module(paper, "metrics").measure(data))
