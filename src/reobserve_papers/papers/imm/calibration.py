"""Calibration of three banks to the quoted probabilities, and two studies of the result.

Nine numbers are tuned: the variances of the process noise of five states and of the measurement
noise of three outputs, and the probability to leave a mode. All banks share them. One study moves
each number alone until a quoted value leaves its band. The other changes one setting of the
calibrated banks at a time.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.documents import read_json
from reobserve.core.errors import InputError, located
from reobserve.core.matrices import as_vector
from reobserve.core.validation import parse
from reobserve.observers.imm import ImmState
from reobserve.observers.run import Run
from reobserve_papers.metrics.responses import scored
from reobserve_papers.papers.imm import keys
from reobserve_papers.papers.imm import plant as plant_stage
from reobserve_papers.papers.imm.plant import modes
from reobserve_papers.papers.imm.scoring import off_quoted, quoted_distance
from reobserve_papers.papers.imm.setup import bank, measured_columns, run, saturation
from reobserve_papers.papers.imm.study_rows import OUTPUTS, STATES, TUNED
from reobserve_papers.plants.hydraulic_actuator import ActuatorModel
from reobserve_papers.signals.series import Series

Array = NDArray[np.float64]
Row = tuple[str, str, float, int, str, float, str]
Change = tuple[str, float, dict[str, Any], dict[str, Any]]

QUANTITIES = ("normal_after", "leakage_after", "normal_before")

# Keys of the study for changes of the scenario, where they differ from the name of the change.
_KEYS = {"period": "periods", "share": "shares"}

THREADS = 2

_HALVINGS = 6  # of an interval between two factors


@dataclass(frozen=True)
class CalibrationTrial:
    """Results of one choice of the tuned numbers.

    ``means`` has three mean probabilities by observer: of the normal and the leakage mode after the
    fault, and of the normal mode before it. ``distance`` is that from all quoted values, nan if a
    filter diverged. ``outside`` is, by SVSF, the share of the innovations after the fault that lie
    outside the boundary layer.
    """

    means: Mapping[str, tuple[float, float, float]]
    distance: float
    outside: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Calibration:
    """Banks on one record, to run with any values of the tuned numbers."""

    plant: keys.Plant
    observers: Mapping[str, keys.Observer]
    rules: keys.Metrics
    record: Series

    def tuned_numbers(self) -> Array:
        """The tuned numbers of the parameter file, in the order of `TUNED`."""
        rows = []
        for name, body in self.observers.items():
            if body.realisation != "motion":
                raise InputError(f"observers.{name}.realisation", "must be motion to be tuned")
            with located(f"observers.{name}"):
                process = as_vector("process_noise", body.process_noise, STATES)
                measurement = as_vector("measurement_noise", body.measurement_noise, OUTPUTS)
            rows.append(np.concatenate([process, measurement, [1.0 - body.self_transition]]))
            if not np.array_equal(rows[0], rows[-1]):
                raise InputError(f"observers.{name}", "must have the noise of the others tuned")
        return rows[0]

    def try_out(self, numbers: Array) -> CalibrationTrial:
        """Run all banks with these numbers, in the order of `TUNED`."""
        means, squares, weights = {}, [], []
        outside: dict[str, float] = {}
        for name, body in self.observers.items():
            changed: keys.Observer = replace(
                body,
                process_noise=numbers[:STATES].tolist(),
                measurement_noise=numbers[STATES:-1].tolist(),
                self_transition=1.0 - float(numbers[-1]),
            )
            run = self._run(changed)
            if run.diverged_at is not None:
                return CalibrationTrial({}, float("nan"))
            probability = run["probability"]
            time, rules = self.record.time[1:], self.rules
            if isinstance(changed, keys.SmoothVariableStructure):
                later = time > self.record.events["fault"][0]
                saturated, _ = saturation(changed, run["innovation"])
                outside[name] = float(np.mean(saturated[later]))
            late = np.mean(
                probability[scored("metrics.after", time, *rules.after, closed="right")], axis=0
            )
            early = np.mean(
                probability[scored("metrics.before", time, *rules.before, closed="right")], axis=0
            )
            means[name] = (float(late[0]), float(late[2]), float(early[0]))
            high = bool(body.quoted_high)
            squares.append(quoted_distance(rules, time, probability, body.quoted, high) ** 2)
            weights.append(3 if high else 2)
        return CalibrationTrial(
            means, float(np.sqrt(np.average(squares, weights=weights))), outside
        )

    def keeps(self, trial: CalibrationTrial, band: float) -> bool:
        """True if all quoted values are met within a band."""
        return bool(trial.means) and all(
            off_quoted(self.observers, name, quantity, mean) <= band
            for name, means in trial.means.items()
            for quantity, mean in zip(QUANTITIES, means, strict=True)
        )

    @cached_property
    def _models(self) -> list[ActuatorModel]:
        return modes(self.plant)

    def _run(self, observer: keys.Observer) -> Run[ImmState]:
        chosen = bank(self.plant, observer, self.record.step, self._models)
        measured = self.record["measured"][1:, measured_columns(observer)]
        return run(chosen, observer, measured, self.record["input"][:-1])


def switches(
    trial: CalibrationTrial, observers: Mapping[str, keys.Observer], minimum: float
) -> bool:
    """True if at least a share of the innovations leaves the thin layers, and fewer the others."""
    for name, share in trial.outside.items():
        body = observers[name]
        thin = isinstance(body, keys.SmoothVariableStructure) and body.layer_factor < 1
        if (share >= minimum) != thin:
            return False
    return bool(trial.outside)


def run_neighbourhood(job: keys.Job, study: keys.Neighbourhood, plant: Series) -> list[Row]:
    """Mean probabilities of all banks by tuned number and factor, and the results of the search.

    Between the last factor with which all quoted values stay in their band and the next one the
    interval is bisected.
    """
    result = read_kept(Path(study.kept))
    calibration = Calibration(job.plant, job.observers, job.metrics, plant)
    tuned = calibration.tuned_numbers()
    rows: list[Row] = [
        ("search", "kept", 1.0, 0, name, float(getattr(result, name)), "1")
        for name in ("trials", "tuned", "targets", "distance")
    ]
    tasks: list[tuple[int | None, float]] = [(None, 1.0)]
    tasks += [
        (index, level)
        for index in range(len(TUNED))
        for factor in study.factors
        for level in (1.0 / factor, factor)
    ]

    def trial(task: tuple[int | None, float]) -> CalibrationTrial:
        numbers = tuned.copy()
        if task[0] is not None:
            numbers[task[0]] *= task[1]
        return calibration.try_out(numbers)

    def ends(side: tuple[int, bool]) -> list[tuple[tuple[int | None, float], CalibrationTrial]]:
        index, upwards = side
        inside = 1.0
        for factor in sorted(study.factors):
            outside = factor if upwards else 1.0 / factor
            if not calibration.keeps(known[index, outside], study.band):
                break
            inside = outside
        else:
            return []
        trials: list[tuple[tuple[int | None, float], CalibrationTrial]] = []
        for _ in range(_HALVINGS):
            middle = math.sqrt(inside * outside)
            trials.append(((index, middle), trial((index, middle))))
            if calibration.keeps(trials[-1][1], study.band):
                inside = middle
            else:
                outside = middle
        return trials

    with ThreadPoolExecutor(THREADS) as pool:
        known = dict(zip(tasks, pool.map(trial, tasks), strict=True))
        both = [(index, upwards) for index in range(len(TUNED)) for upwards in (False, True)]
        known |= dict(chain.from_iterable(pool.map(ends, both)))
    for (index, level), outcome in known.items():
        rows += trial_rows("stated" if index is None else TUNED[index], level, outcome)
    return rows


def trial_rows(sweep: str, level: float, trial: CalibrationTrial) -> Iterator[Row]:
    """Rows of a trial: the distance, and the mean probabilities of each bank."""
    yield "all", sweep, level, 0, "distance", trial.distance, "1"
    for name, means in trial.means.items():
        for quantity, mean in zip(QUANTITIES, means, strict=True):
            yield name, sweep, level, 0, quantity, mean, "1"


@dataclass(frozen=True)
class KeptSearch:
    """The result of `reobserve_papers.papers.imm.search.run`."""

    found: dict[str, float]
    distance: float
    worst_nearby: float
    means: dict[str, tuple[float, float, float]]
    trials: int
    tuned: int
    targets: int
    history: tuple[tuple[int, float], ...]
    outside: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class _Stored:
    search: KeptSearch
    provenance: dict[str, Any] | None = None


def read_kept(path: Path) -> KeptSearch:
    """Read the stored result of a search."""
    result = parse(_Stored, read_json(path), str(path)).search
    if set(result.found) != set(TUNED):
        raise InputError(str(path), "holds other numbers than the search tunes; rerun it")
    return result


def run_changes(job: keys.Job, study: keys.Changes, plant: Series) -> list[Row]:
    """Mean probabilities of all banks for each change of the scenario or of the observers."""
    changes = list(_changes(study))
    with ThreadPoolExecutor(THREADS) as pool:
        parts = pool.map(lambda change: _rows(job, plant, change), changes)
        return [row for part in parts for row in part]


def _changes(study: keys.Changes) -> Iterator[Change]:
    """Name and level of each change, and the changed values of the scenario and the observers."""
    yield "as_stated", 1.0, {}, {}
    yield "unmixed", 1.0, {}, {"mixing": False}
    yield "prbs", 1.0, {"input": study.prbs}, {}
    yield "square", 1.0, {"input": study.square}, {}
    yield "sweep", 1.0, {"input": study.sweep}, {}
    yield "friction", 1.0, {"fault": "friction"}, {}
    yield "states", 1.0, {"switching_condition": "states"}, {}
    yield "outputs", 1.0, {"switching_condition": "outputs"}, {}
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


def check_changes(job: keys.Job, study: keys.Changes) -> None:
    """Build the plant of each change without running it."""
    for sweep, _, scenario, _ in _changes(study):
        for changed in scenario:
            try:
                plant_stage.build(_changed(job, scenario))
            except InputError as error:
                key, own = _KEYS.get(sweep, sweep), f"scenario.{changed}"
                if error.parameter.startswith(own):
                    place = key + error.parameter.removeprefix(own)
                    raise InputError(place, error.problem) from None
                raise InputError(key, f"with it, {error}") from None


def _changed(job: keys.Job, scenario: dict[str, Any]) -> keys.Job:
    """The settings of the plant stage, with other values in the scenario."""
    return replace(job, scenario=replace(job.scenario, **scenario))


def _rows(job: keys.Job, plant: Series, change: Change) -> list[Row]:
    sweep, level, scenario, observer = change
    record = plant_stage.simulate(_changed(job, scenario)) if scenario else plant
    observers = {name: _moved(body, **observer) for name, body in job.observers.items()}
    calibration = Calibration(job.plant, observers, job.metrics, record)
    trial = calibration.try_out(calibration.tuned_numbers())
    rows = list(trial_rows(sweep, level, trial))
    for name, (normal, leakage, _) in trial.means.items():
        rows.append((name, sweep, level, 0, "friction_after", 1.0 - normal - leakage, "1"))
    return rows


def _moved(body: keys.Observer, **changed: Any) -> keys.Observer:
    """The observer with other values, where a Kalman filter ignores those of layer and inverse."""
    if not isinstance(body, keys.SmoothVariableStructure):
        shared = {key: changed[key] for key in changed if key not in ("layer_factor", "inverse")}
        return replace(body, **shared)
    factor = changed.pop("layer_factor", 1.0)
    return replace(body, layer_factor=body.layer_factor * factor, **changed)
