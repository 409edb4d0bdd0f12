"""Checks of parameters that construct models and observers, done before a long build."""

from __future__ import annotations

from collections.abc import Mapping

from reobserve.core.errors import InputError
from reobserve_papers.papers.delay import keys, observe, plant
from reobserve_papers.papers.delay.scoring import check_rules
from reobserve_papers.papers.delay.study import TUNED
from reobserve_papers.papers.delay.theory_runs import NEEDED
from reobserve_papers.parameters.job import named
from reobserve_papers.parameters.parameter_checks import Checks
from reobserve_papers.signals.grid import stride


def _observer(job: keys.Job) -> None:
    observe.build(job)
    stride(job.plant.step, job.observer.sampling_period)


def _study(job: keys.Job) -> None:
    """Check that the steps fit the grid and that the observers have a gain to vary."""
    if isinstance(job.study, keys.Tradeoff):
        stride(job.plant.step, job.study.sampling_period)
        for name in job.observers:
            named(job.observers, name, keys.HighGain)


def _figure(job: keys.Job) -> None:
    """Check that observers are for the model of the scenario and have what the layout plots."""
    model, layout = job.scenario.model, job.figure.layout
    for name, observer in job.observers.items():
        # Estimators of the delay alone have no key `model`; they are for the scalar plant.
        known = getattr(observer, "model", "lag")
        if known != model:
            problem = f"{name!r} is for the model {known}, the scenario has {model}"
            raise InputError("observers", problem)
        if layout == "comparison" and isinstance(observer, keys.Standard):
            raise InputError("observers", f"{name!r} does not estimate the delay")
    if layout == "states" and model != "pendulum":
        raise InputError("scenario", "must be of the pendulum, whose states are plotted")


def _metrics(job: keys.Job) -> None:
    """Check the windows, with the samples that are furthest apart."""
    periods = [body.sampling_period for body in job.observers.values()]
    check_rules(job.metrics, job.plant.horizon, max(periods, default=job.plant.step))


def _theory(job: keys.Job, _: Mapping[str, object]) -> None:
    stride(job.plant.step, job.theory.sampling_period)
    named(job.observers, "order2_noise", keys.Extended).levant()


CHECKS = Checks(
    build={
        "scenario": plant.build,
        "observer": _observer,
        "study": _study,
        "figure": _figure,
        "metrics": _metrics,
        "theory": _theory,
    },
    about={keys.Tuning: TUNED, keys.TuningFigure: TUNED, keys.Theory: NEEDED},
)
