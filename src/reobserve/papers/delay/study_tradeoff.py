"""Errors against rho, for both Taylor orders and the standard observer, without and with noise.

The observers are those of Fig. 2, so that the level of its rho shows Fig. 2 over other noise.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from reobserve.core.errors import located
from reobserve.papers.delay.observe import estimate
from reobserve.papers.delay.plant import simulate
from reobserve.papers.delay.scoring import rms_scores
from reobserve.replication.parameters.job import Job
from reobserve.signals.series import Series

Row = tuple[str, str, float, int, str, float, str]


def run(job: Job, plant: Series) -> Iterator[Row]:
    """For each observer, rho and run: RMS errors of delay and states; run 0 is without noise.

    Run 1 has the noise of ``plant``.

    Raises
    ------
    InputError
        If a setting cannot be used.
    """
    study = job.study
    for number in range(study.runs + 1):
        record = plant
        if number == 0:
            quiet = replace(job.scenario, noise_share=0.0)
            record = simulate(replace(job, scenario=quiet))
        elif number > 1:
            record = simulate(replace(job, seed=job.seed + number - 1))
        for name, body in job.observers.items():
            for rho in study.rhos:
                changed = replace(body, rho=rho, sampling_period=study.sampling_period)
                with located(f"observers.{name}"):
                    found = estimate(Job(job.plant, observer=changed), record)
                sweep = "noise_rho" if number else "rho"
                for quantity, value, unit in rms_scores(job.metrics, body.model, record, found):
                    if "start" not in quantity:
                        yield name, sweep, rho, number, quantity, value, unit
