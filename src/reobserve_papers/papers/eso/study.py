"""Stage study: errors, lags and standard deviations of many designs.

The estimates are linear in faults, disturbances and noise. So errors are computed without
disturbance and noise, and the standard deviations due to these by a discrete Lyapunov equation.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from reobserve.core.errors import located
from reobserve.observers.extended_state import ExtendedStateObserver
from reobserve_papers.metrics.metrics import parse_name
from reobserve_papers.papers.eso import keys
from reobserve_papers.papers.eso import plant as plant_stage
from reobserve_papers.papers.eso.design import design
from reobserve_papers.papers.eso.deviation import held_deviation
from reobserve_papers.papers.eso.observe import run_on
from reobserve_papers.papers.eso.scoring import scores
from reobserve_papers.papers.eso.setup import augmented, experiment
from reobserve_papers.signals.series import Channel, Series

Row = dict[str, Any]


def run(job: keys.Job, plant: Series) -> list[Row]:
    """Compute lags, errors and standard deviations of each design."""
    undisturbed = replace(job.scenario, disturbance=[[0.0, 0.0], [0.0, 0.0]], noise_power=0.0)
    clean = plant_stage.simulate(replace(job, scenario=undisturbed))
    return [row for chosen in _designs(job.study) for row in _rows(job, clean, *chosen)]


def _designs(study: keys.Designs) -> Iterator[tuple[keys.Design, str, float]]:
    """The designs, each with the varied setting and its level."""
    solver = study.solver
    for rate, decay, solution in product(study.filter_rates, study.decays, study.solutions):
        yield keys.Feasible("pi_feasible", rate, decay, solution, solver), "decay", decay
    for kind in ("pi_optimised", "pd_pi_optimised"):
        base = keys.Optimised(kind, 1.0, "minimum_norm", 1.0, 1.0, study.radius, solver)
        for factor in study.factors:
            yield replace(base, factor=factor), "factor", factor
        for bound in study.pole_bounds:
            yield replace(base, criterion="minimum_gamma", pole_bound=bound), "bound", bound
        for bound, radius in product(study.pole_bounds[:1], study.radii):
            near = replace(base, criterion="minimum_gamma", pole_bound=bound, radius=radius)
            yield near, "radius", radius


def _rows(
    job: keys.Job, clean: Series, body: keys.Design, choice: str, level: float
) -> Iterator[Row]:
    with located(f"study.{body.name} at {choice} {level:g}"):
        certified = design(job.plant, body)
    system = augmented(job.plant, body.filter_rate)
    observer = ExtendedStateObserver(
        system, gains=certified.gains, sampling_period=2.0 * clean.step
    )
    run = run_on(observer, clean)
    estimate = Series(
        clean.time[::2],
        {
            "actuator_fault": Channel(run["actuator_fault"][:, 0], "V"),
            "sensor_fault": Channel(run["sensor_fault"][:, 0], "rad/s"),
        },
    )
    about = {
        "kind": body.name,
        "filter_rate": body.filter_rate,
        "choice": choice,
        "level": level,
    }
    numbers = [*_errors(job, clean, estimate), *_deviations(job, system, certified.gains)]
    numbers.append(("largest_gain", float(np.max(np.abs(certified.gains.L))), "1"))
    for quantity, value, unit in numbers:
        yield {**about, "quantity": quantity, "value": value, "unit": unit}


def _errors(job: keys.Job, clean: Series, estimate: Series) -> Iterator[tuple[str, float, str]]:
    """Errors where the faults vary, in which the lags count, and the lags."""
    for name, value, unit in scores(job.metrics, clean, estimate):
        quantity, at = parse_name(name)
        if "constant" not in quantity and at.get("lag") != "removed":
            yield quantity, value, unit


def _deviations(job: keys.Job, system: Any, gains: Any) -> Iterator[tuple[str, float, str]]:
    """Standard deviations of both estimates due to held disturbances and noise."""
    setup = experiment(job.plant, job.scenario)
    period = setup.hold * setup.step
    uniform = (setup.high - setup.low) / np.sqrt(12.0)
    faults = ("actuator", "V"), ("sensor", "rad/s")
    for source, deviations in (
        ("disturbance", np.array([*uniform, 0.0])),
        ("noise", np.array([0.0, 0.0, setup.deviation])),
    ):
        ends = held_deviation(system, gains, deviations, period).ends[-2:]
        for (name, unit), value in zip(faults, ends, strict=True):
            yield f"{source}_in_{name}_fault", float(value), unit
