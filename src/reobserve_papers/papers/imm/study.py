"""Stage study: many runs behind one figure, as one table.

The ``method`` of a study in the parameter file is one of

    neighbourhood    how far each tuned number may move before a quoted value leaves its band
    changes          the calibrated banks with one setting changed
    causes           SVSF-IMMs with one possible cause of their probabilities changed
    frozen           SVSF-IMMs, and filters with random gains, with their gains frozen
"""

from __future__ import annotations

from typing import Any

from reobserve.core.errors import located
from reobserve_papers.papers.imm import calibration, keys, study_causes
from reobserve_papers.papers.imm.study_rows import HEADER
from reobserve_papers.signals.series import Series


def run(job: keys.Job, plant: Series) -> list[dict[str, Any]]:
    """The rows of the study's method, with the columns of `HEADER`."""
    with located("study"):
        check_study(job)
    match job.study:
        case keys.Neighbourhood() as study:
            rows = calibration.run_neighbourhood(job, study, plant)
        case keys.Changes() as study:
            rows = calibration.run_changes(job, study, plant)
        case keys.Causes() as study:
            rows = study_causes.run(job, study, plant)
        case keys.Frozen():
            rows = study_causes.run_frozen(job, plant)
    return [dict(zip(HEADER, row, strict=True)) for row in rows]


def check_study(job: keys.Job) -> None:
    """Refuse what the study's method cannot use, with an `InputError` that names its key."""
    match job.study:
        case keys.Changes() as study:
            calibration.check_changes(job, study)
        case keys.Causes() | keys.Frozen():
            study_causes.check(job)
