"""Checks of parameters that need the plant to be constructed."""

from __future__ import annotations

from reobserve.core.errors import InputError, nearest
from reobserve.synthesis.extended_state.system import AugmentedSystem
from reobserve_papers.papers.eso import keys, plant
from reobserve_papers.papers.eso.scoring import check_rules
from reobserve_papers.papers.eso.setup import augmented
from reobserve_papers.parameters.parameter_checks import Checks


def _observer(job: keys.Job, _: AugmentedSystem) -> None:
    other = job.observer.compared_with
    if other and other not in job.observers:
        problem = f"{other!r} must be one of the observers{nearest(other, job.observers)}"
        raise InputError("compared_with", problem)


# Designs are not computed here; their stage shows whether a solver finds one.
CHECKS = Checks(
    build={
        # Errors of the plant do not depend on the filter.
        "plant": lambda job: augmented(job.plant, 1.0),
        "scenario": plant.build,
        "design": lambda job: augmented(job.plant, job.design.filter_rate),
        "observer": _observer,
        "metrics": lambda job: check_rules(job.metrics, job.plant),
    }
)
