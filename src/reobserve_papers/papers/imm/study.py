"""Stage study: many runs behind one figure, as one table.

The ``method`` of a study in the parameter file is one of

    neighbourhood    how far each tuned number may move before a quoted value leaves its band
    changes          the calibrated banks with one setting changed
    causes           SVSF-IMMs with one possible cause of their probabilities changed
"""

from __future__ import annotations

from typing import Any

from reobserve.core.errors import located
from reobserve_papers.papers.imm import calibration, keys, study_causes
from reobserve_papers.papers.imm.study_rows import HEADER
from reobserve_papers.parameters.job import Job, Settings, read_job
from reobserve_papers.signals.series import Series

METHODS = {
    "neighbourhood": calibration.run_neighbourhood,
    "changes": calibration.run_changes,
    "causes": study_causes.run,
}
_CHECKS = {
    "changes": calibration.check_changes,
    "causes": study_causes.check,
}


def run(settings: Settings, plant: Series) -> list[dict[str, Any]]:
    """The rows of the study's method, with the columns of `HEADER`.

    Raises
    ------
    InputError
        If there is no such method or a setting cannot be used.
    """
    job = read_job(keys.Parameters, settings)
    with located("study"):
        check_study(job)
    rows = METHODS[job.study.method](job, plant)
    return [dict(zip(HEADER, row, strict=True)) for row in rows]


def check_study(job: Job) -> None:
    """Refuse what the study's method cannot use; `InputError` names the key of the study."""
    check = _CHECKS.get(job.study.method)
    if check is not None:
        check(job)
