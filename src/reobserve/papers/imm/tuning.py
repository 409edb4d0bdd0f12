"""The numbers that a calibration moves, and how far three filters are from the paper's values.

Nine numbers of the banks are moved: the variances of the process noise of five states, of the
measurement noise of three outputs, and the probability to leave a mode; all banks share them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError, located
from reobserve.core.matrices import as_vector
from reobserve.observers.imm import State
from reobserve.observers.run import Run
from reobserve.papers.imm import keys
from reobserve.papers.imm.scoring import quoted_distance
from reobserve.papers.imm.setup import bank, boundary_layer, measured_columns, modes, run
from reobserve.papers.imm.study_rows import OUTPUTS, STATES
from reobserve.plants.hydraulic_actuator import ActuatorModel
from reobserve.replication.metrics.responses import window
from reobserve.signals.series import Series

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Trial:
    """What came of one choice: mean probabilities after the fault, and before it.

    ``means`` holds for each observer the normal and the leakage mode's after the fault and the
    normal mode's before; ``distance`` is from all quoted values, nan if a filter diverged.
    ``outside`` is for each SVSF the share of the innovations after the fault that lie outside the
    boundary layer.
    """

    means: Mapping[str, tuple[float, float, float]]
    distance: float
    outside: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Calibration:
    """Banks of several observers on one record, to be run with any of the tuned numbers."""

    plant: keys.Plant
    observers: Mapping[str, keys.Observer]
    rules: keys.Metrics
    record: Series

    def stated(self) -> Array:
        """The tuned numbers that the ledger has, in the order of `TUNED`.

        Raises
        ------
        InputError
            If the observers do not share them, or have other realisations than ``motion``.
        """
        found = []
        for name, body in self.observers.items():
            if body.realisation != "motion":
                raise InputError(f"observers.{name}.realisation", "must be motion to be tuned")
            with located(f"observers.{name}"):
                process = as_vector("process_noise", body.process_noise, STATES)
                measurement = as_vector("measurement_noise", body.measurement_noise, OUTPUTS)
            found.append(np.concatenate([process, measurement, [1.0 - body.stay]]))
            if not np.array_equal(found[0], found[-1]):
                raise InputError(f"observers.{name}", "must have the noise of the others tuned")
        return found[0]

    def try_out(self, numbers: Array) -> Trial:
        """Run all banks with these numbers, in the order of `TUNED`."""
        means, squares, weights = {}, [], []
        outside: dict[str, float] = {}
        for name, body in self.observers.items():
            changed: keys.Observer = replace(
                body,
                process_noise=numbers[:STATES].tolist(),
                measurement_noise=numbers[STATES:-1].tolist(),
                stay=1.0 - float(numbers[-1]),
            )
            found = self._run(changed)
            if found.diverged_at is not None:
                return Trial({}, float("nan"))
            probability = found["probability"]
            time, rules = self.record.time[1:], self.rules
            if isinstance(changed, keys.SmoothVariableStructure):
                later = found["innovation"][time > self.record.events["fault"][0]]
                layer = boundary_layer(changed, later.shape[-1])
                outside[name] = float(np.mean(np.abs(later) > layer))
            late = np.mean(probability[window(time, *rules.after, closed="right")], axis=0)
            early = np.mean(probability[window(time, *rules.before, closed="right")], axis=0)
            means[name] = (float(late[0]), float(late[2]), float(early[0]))
            high = bool(body.quoted_high)
            squares.append(quoted_distance(rules, time, probability, body.quoted, high) ** 2)
            weights.append(3 if high else 2)
        return Trial(means, float(np.sqrt(np.average(squares, weights=weights))), outside)

    @cached_property
    def _models(self) -> list[ActuatorModel]:
        return modes(self.plant)

    def _run(self, observer: keys.Observer) -> Run[State]:
        chosen = bank(self.plant, observer, self.record.step, self._models)
        measured = self.record["measured"][1:, measured_columns(observer)]
        return run(chosen, observer, measured, self.record["input"][:-1])


def within(trial: Trial, observers: Mapping[str, keys.Observer], band: float) -> bool:
    """Whether all means are within ``band`` of the values that the paper quotes."""
    for name, body in observers.items():
        if name not in trial.means:
            return False
        normal, leakage, before = trial.means[name]
        off = [abs(normal - body.quoted[0]), abs(leakage - body.quoted[1])]
        if body.quoted_high:
            off.append(1.0 - before)
        if max(off) > band:
            return False
    return True


def switches(trial: Trial, observers: Mapping[str, keys.Observer], least: float) -> bool:
    """Whether the thin layers, and these alone, are left by this share of the innovations."""
    for name, share in trial.outside.items():
        body = observers[name]
        thin = isinstance(body, keys.SmoothVariableStructure) and body.layer_factor < 1
        if (share >= least) != thin:
            return False
    return bool(trial.outside)
