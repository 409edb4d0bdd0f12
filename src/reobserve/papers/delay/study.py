"""Stage study: many runs behind one figure, as one table.

The ``method`` of a study in the ledger is one of

    tradeoff    error of the delay against rho, for both Taylor orders, without and with noise
    tuning      errors of the four methods of Fig. 3 against the tuning of each
"""

from __future__ import annotations

from typing import Any

from reobserve.papers.delay import keys, study_tradeoff, study_tuning
from reobserve.papers.delay.study_rows import HEADER
from reobserve.replication.parameters.job import Settings, read_job
from reobserve.signals.series import Series

METHODS = {"tradeoff": study_tradeoff.run, "tuning": study_tuning.run}


def run(settings: Settings, plant: Series) -> list[dict[str, Any]]:
    """The rows of the study's method, with the columns of `HEADER`.

    Raises
    ------
    InputError
        If there is no such method or a setting cannot be used.
    """
    job = read_job(keys.Ledger, settings)
    rows = METHODS[job.study.method](job, plant)
    return [dict(zip(HEADER, row, strict=True)) for row in rows]
