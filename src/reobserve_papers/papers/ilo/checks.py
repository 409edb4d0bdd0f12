"""Checks of the parameter file that need plant and observers to be constructed."""

from __future__ import annotations

from reobserve.core.errors import InputError
from reobserve_papers.papers.ilo import keys, plant
from reobserve_papers.papers.ilo.scoring import check_rules
from reobserve_papers.papers.ilo.setup import build_observer
from reobserve_papers.papers.ilo.theory_runs import NEEDED
from reobserve_papers.parameters.parameter_checks import Checks
from reobserve_papers.signals.grid import noise_hold


def _study(job: keys.Job) -> None:
    levels, shown = job.study.noise_levels, job.study.shown_noise
    if shown not in levels:
        raise InputError("shown_noise", f"{shown:g} must be one of the noise_levels, {levels}")


_MATCHED = {"continuous": keys.Continuous, "adaptive": keys.Adaptive}

CHECKS = Checks(
    build={
        "plant": lambda job: noise_hold(job.plant.noise_period, job.plant.step),
        "scenario": plant.build,
        "metrics": lambda job: check_rules(job.metrics, job.plant.horizon, job.plant.step),
        "study": _study,
        "observer": lambda job: build_observer(job.plant, job.observer),
    },
    about={
        keys.Matching: _MATCHED,
        keys.MatchingFigure: {**_MATCHED, "matched": keys.Adaptive},
        keys.Theory: NEEDED,
    },
)
