"""Data behind a figure, from which its numbers and its plot are made."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from reobserve_papers.metrics.metrics import Numbers
from reobserve_papers.metrics.study_table import StudyTable
from reobserve_papers.signals.series import Series

JobType = TypeVar("JobType")  # that of the paper, `keys.Job`


@dataclass(frozen=True)
class FigureData(Generic[JobType]):
    """The job of a figure with its records.

    Attributes
    ----------
    job
        The branches of the parameter file that the figure depends on.
    plant
        The record of its scenario.
    estimates
        Those of its observers, by name.
    study
        The table of its study; empty if it has none.
    metrics
        Its numbers, for those who draw.
    """

    job: JobType
    plant: Series
    estimates: Mapping[str, Series]
    study: StudyTable = field(default_factory=StudyTable)
    metrics: Numbers = field(default_factory=Numbers)
