"""The calibrated banks with one thing changed: what the quoted values depend on."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

from reobserve.core.errors import InputError
from reobserve.papers.imm import keys
from reobserve.papers.imm import plant as plant_stage
from reobserve.papers.imm.study_neighbourhood import trial_rows
from reobserve.papers.imm.tuning import Calibration
from reobserve.replication.parameters.job import Job
from reobserve.signals.series import Series

Row = tuple[str, str, float, int, str, float, str]
Change = tuple[str, float, dict[str, Any], dict[str, Any]]

# The study's keys for what changes the scenario, where it is not the name of the change.
_KEYS = {"period": "periods", "share": "shares"}

THREADS = 2


def run(job: Job, plant: Series) -> list[Row]:
    """Mean probabilities of all banks for each change of the scenario or of the observers.

    Raises
    ------
    InputError
        If a changed value cannot be used.
    """
    found = list(_changes(job.study))
    with ThreadPoolExecutor(THREADS) as pool:
        parts = pool.map(lambda change: _rows(job, plant, change), found)
        return [row for part in parts for row in part]


def _changes(study: keys.Changes) -> Iterator[Change]:
    """Name, level, and what differs in the scenario and in the observers."""
    yield "as_stated", 1.0, {}, {}
    yield "unmixed", 1.0, {}, {"mixing": False}
    yield "prbs", 1.0, {"input": study.prbs}, {}
    yield "square", 1.0, {"input": study.square}, {}
    yield "sweep", 1.0, {"input": study.sweep}, {}
    yield "friction", 1.0, {"fault": "friction"}, {}
    yield "states", 1.0, {"hand_over": "states"}, {}
    yield "outputs", 1.0, {"hand_over": "outputs"}, {}
    yield "certain", 1.0, {}, {"initial_mode": "normal"}
    yield "weighted", 1.0, {}, {"inverse": "weighted"}
    for variance in study.initial_covariances:
        yield "start", variance, {}, {"initial_covariance": variance}
    for period in study.periods:
        yield "period", period, {"period": period}, {}
    for share in study.shares:
        yield "share", share, {"share": share}, {}
    for factor in study.layer_factors:
        yield "layer", factor, {}, {"layer_factor": factor}
    yield "noise", 1.0, {"noise": study.noise}, {}


def check(job: Job) -> None:
    """Build the plant of each change and run none.

    Raises
    ------
    InputError
        With the key of the study whose value cannot be used.
    """
    for sweep, _, scenario, _ in _changes(job.study):
        for changed in scenario:
            try:
                plant_stage.build(_changed(job, scenario))
            except InputError as error:
                key, own = _KEYS.get(sweep, sweep), f"scenario.{changed}"
                if error.parameter.startswith(own):
                    place = key + error.parameter.removeprefix(own)
                    raise InputError(place, error.problem) from None
                raise InputError(key, f"with it, {error}") from None


def _changed(job: Job, scenario: dict[str, Any]) -> Job:
    """What the plant's stage sees, with something else in the scenario."""
    return replace(job, scenario=replace(job.scenario, **scenario))


def _rows(job: Job, plant: Series, change: Change) -> list[Row]:
    sweep, level, scenario, observer = change
    record = plant_stage.simulate(_changed(job, scenario)) if scenario else plant
    observers = {name: _moved(body, **observer) for name, body in job.observers.items()}
    calibration = Calibration(job.plant, observers, job.metrics, record)
    trial = calibration.try_out(calibration.stated())
    rows = list(trial_rows(sweep, level, trial))
    for name, (normal, leakage, _) in trial.means.items():
        rows.append((name, sweep, level, 0, "friction_after", 1.0 - normal - leakage, "1"))
    return rows


def _moved(body: keys.Observer, **changed: Any) -> keys.Observer:
    """An observer with other values, of which a Kalman filter has no layer and no inverse."""
    if not isinstance(body, keys.SmoothVariableStructure):
        shared = {key: changed[key] for key in changed if key not in ("layer_factor", "inverse")}
        return replace(body, **shared)
    factor = changed.pop("layer_factor", 1.0)
    return replace(body, layer_factor=body.layer_factor * factor, **changed)
