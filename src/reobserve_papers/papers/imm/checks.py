"""Checks of parameters that need the plant and observers to be constructed."""

from __future__ import annotations

from reobserve_papers.papers.imm import keys, observe, plant, search, theory
from reobserve_papers.papers.imm.scoring import check_rules
from reobserve_papers.papers.imm.setup import start
from reobserve_papers.papers.imm.study import check_study
from reobserve_papers.parameters.parameter_checks import Checks

PERIOD = 1e-3  # [s]: any one shows whether a bank can be built


def _start(job: keys.Job) -> object:
    return start(observe.build(job, PERIOD), job.observer)


def _metrics(job: keys.Job) -> None:
    check_rules(job.metrics, job.plant.horizon, PERIOD)


CHECKS = Checks(
    build={
        "scenario": plant.build,
        "observer": _start,
        "metrics": _metrics,
        "study": check_study,
        "search": lambda job: search.check(job.search),
        "theory": lambda job, _: theory.check(job.theory, job.observers),
    }
)
