"""Stage study: errors, lags and deviations of many designs, undisturbed, and their certificates.

The estimates are linear in what drives them: errors without disturbance and noise, and the
deviations that these cause, tell all. The deviations come from a discrete Lyapunov equation.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from reobserve.errors import InputError, located
from reobserve.matrices import as_floats, as_positive
from reobserve.observers.extended_state import ExtendedStateObserver
from reobserve.papers.eso import plant as plant_stage
from reobserve.papers.eso.design import design
from reobserve.papers.eso.observe import run_on
from reobserve.papers.eso.scoring import scores
from reobserve.papers.eso.setup import augmented, experiment
from reobserve.series import Channel, Series
from reobserve.synthesis.extended_state.deviation import held_deviation

HEADER = ("kind", "filter_rate", "choice", "level", "quantity", "value", "unit")

Row = dict[str, Any]


def run(settings: dict[str, Any], plant: Series) -> list[Row]:
    """For each design: what its estimates are worth, and its certificate.

    Raises
    ------
    InputError
        If a level cannot be used, or one of the designs fails.
    """
    with located("study"):
        check_study(settings["study"])
    scenario = {
        **settings["scenario"],
        "disturbance_low": [0.0, 0.0],
        "disturbance_high": [0.0, 0.0],
        "noise_power": 0.0,
    }
    clean = plant_stage.simulate({**settings, "scenario": scenario})
    return [row for body in _bodies(settings["study"]) for row in _rows(settings, clean, body)]


def _bodies(study: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The designs, each with the choice that is varied."""
    shared = {"solver": study["solver"]}
    for rate in study["filter_rates"]:
        for decay in study["decays"]:
            yield {**shared, "kind": "pi_feasible", "filter_rate": rate, "choice": "decay",
                   "decay": decay, "level": decay}  # fmt: skip
    for kind in ("pi_least_norm", "pd_pi_least_norm"):
        for factor in study["factors"]:
            yield {**shared, "kind": kind, "filter_rate": 1.0, "choice": "factor",
                   "factor": factor, "level": factor}  # fmt: skip
    for bound in study["pole_bounds"]:
        yield {**shared, "kind": "pd_pi_bounded", "filter_rate": 1.0, "choice": "bound",
               "pole_bound": bound, "radius": study["radius"], "level": bound}  # fmt: skip


def _rows(settings: dict[str, Any], clean: Series, body: dict[str, Any]) -> Iterator[Row]:
    with located(f"study.{body['kind']} at {body['choice']} {body['level']:g}"):
        found = design(settings["plant"], body)
    system = augmented(settings["plant"], body["filter_rate"])
    observer = ExtendedStateObserver(system, found.gains, 2.0 * clean.step, "second")
    run = run_on(observer, clean)
    estimate = Series(
        clean.time[::2],
        {
            "actuator_fault": Channel(run.actuator_fault[:, 0], "V"),
            "sensor_fault": Channel(run.sensor_fault[:, 0], "rad/s"),
        },
    )
    about = {
        "kind": body["kind"],
        "filter_rate": body["filter_rate"],
        "choice": body["choice"],
        "level": body["level"],
    }
    numbers = list(scores(settings["metrics"], clean, estimate))
    numbers += _deviations(settings, system, found.gains)
    certificate = found.certificate
    numbers += [
        ("norm", certificate.norm_upper, "1"),
        ("largest_gain", float(np.abs(found.gains.L).max()), "1/s"),
        ("slowest_pole", -certificate.poles[0][0], "1/s"),
        ("fastest_pole", -min(real for real, _ in certificate.poles), "1/s"),
    ]
    for quantity, value, unit in numbers:
        yield {**about, "quantity": quantity, "value": value, "unit": unit}


def _deviations(
    settings: dict[str, Any], system: Any, gains: Any
) -> Iterator[tuple[str, float, str]]:
    """What held disturbances and noise of the ledger's noisy setting do to both faults."""
    setup = experiment(settings["plant"], settings["scenario"])
    period = setup.hold * setup.step
    uniform = (setup.high - setup.low) / np.sqrt(12.0)
    faults = ("actuator", "V"), ("sensor", "rad/s")
    for source, deviations in (
        ("disturbance", np.array([*uniform, 0.0])),
        ("noise", np.array([0.0, 0.0, setup.deviation])),
    ):
        found = held_deviation(system, gains, deviations, period)[-2:]
        for (name, unit), value in zip(faults, found, strict=True):
            yield f"{source}_in_{name}_fault", float(value), unit


def check_study(study: dict[str, Any]) -> None:
    """Refuse a method that there is not, and levels that are no numbers of zero or more."""
    if study.get("method") != "designs":
        raise InputError("method", f"{study.get('method')!r} must be designs")
    for name in ("filter_rates", "decays", "factors", "pole_bounds"):
        levels = as_floats(name, study[name])
        if levels.ndim != 1 or (levels < 0).any():
            raise InputError(name, f"{study[name]} must be a list of numbers, none below zero")
    as_positive("radius", study["radius"])
