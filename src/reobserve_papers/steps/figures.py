"""The data behind a figure, from the results that it reads, and its metrics."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from reobserve.core.errors import InputError, ReobserveError, located
from reobserve_papers.metrics.metrics import Metric
from reobserve_papers.metrics.study_table import StudyTable
from reobserve_papers.parameters.figure_data import FigureData
from reobserve_papers.parameters.job import AnyJob, Settings, declared_keys, read_job
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.signals.series import Series
from reobserve_papers.steps.chain import Step
from reobserve_papers.steps.compute import paper_module

Rows = Iterable[Mapping[str, Any]]  # of a study


@contextmanager
def rows_from(study: Path | None) -> Iterator[None]:
    """Blame a study's file for what a figure misses among its rows.

    Each row has been checked by itself; which rows there must be, only who asks for them knows.
    """
    try:
        yield
    except (LookupError, ValueError) as error:
        if study is None or isinstance(error, ReobserveError):
            raise
        problem = f"has not the rows that the figure needs ({error}); run the study again"
        raise InputError(str(study), problem) from error


def behind_figure(
    results: Mapping[Step, Any],
) -> tuple[Series, dict[str, Series], list[dict[str, Any]] | None]:
    """The plant, the estimates by observer and the rows of a study, of what a figure reads."""
    by_kind = {step[0]: result for step, result in results.items()}
    estimates = {step[2]: result for step, result in results.items() if step[0] == "observe"}
    return by_kind["plant"], estimates, by_kind.get("study")


def figure_data(
    parameters: Parameters,
    settings: Settings,
    plant: Series,
    estimates: Mapping[str, Series],
    rows: Rows | None = None,
) -> FigureData[AnyJob]:
    """The data of a figure of a paper. ``rows`` are those of its study, if it has one."""
    with located(parameters.paper):
        job = read_job(declared_keys(parameters), settings)
    data = FigureData(job, plant, estimates)
    if rows is None:
        return data
    return replace(
        data, study=StudyTable.of(rows, paper_module(parameters.package, "study_rows").KINDS)
    )


def measure(parameters: Parameters, data: FigureData[AnyJob]) -> list[Metric]:
    """The metrics of a figure, or `InputError` if a setting of the metrics cannot be used."""
    with located(parameters.paper):
        return list(paper_module(parameters.package, "metrics").measure(data))
