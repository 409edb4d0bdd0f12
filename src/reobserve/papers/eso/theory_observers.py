"""What the error system (10) of an observer says of its estimates, without a simulation.

Only the last, that u is not in it, is told by two simulations with different controllers.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.errors import InputError
from reobserve.ledger.types import Job
from reobserve.numerics.matrices import as_floats
from reobserve.observers.extended_state import ExtendedStateObserver
from reobserve.papers.eso import keys
from reobserve.papers.eso import plant as plant_stage
from reobserve.papers.eso.observe import run_on
from reobserve.papers.eso.setup import controlled_motor
from reobserve.papers.eso.stored_design import stored_design
from reobserve.papers.eso.theory_inequality import margin_above_norm
from reobserve.scoring.metrics import Metric
from reobserve.synthesis.extended_state.certificate import error_system
from reobserve.synthesis.extended_state.deviation import held_deviation
from reobserve.synthesis.extended_state.system import AugmentedSystem, Gains
from reobserve.timeseries.series import Series

Array = NDArray[np.float64]

_FAULTS = (("actuator", "V"), ("sensor", "rad/s"))
_DURATION = 4.0  # of the runs with different controllers [s]


def measures(
    name: str,
    design: Mapping[str, Any],
    plant: keys.Plant,
    theory: keys.Theory,
    noise: float,
    records: list[Series],
) -> Iterator[Metric]:
    """The numbers of one observer, by its design as the ledger's design stage computed it.

    ``noise`` is the deviation of the noise [rad/s], ``records`` those of two controllers.

    Raises
    ------
    InputError
        If a setting of the theory cannot be used.
    """
    system, found = stored_design(plant, design)
    gains, certificate = found.gains, found.certificate
    Ao, Eo = error_system(system, gains)
    margin = margin_above_norm(system, gains, certificate.norm_upper, theory.excess)
    for metric, value, unit in (
        ("norm", certificate.norm_upper, "1"),
        ("gamma", float("nan") if found.gamma is None else found.gamma, "1"),
        ("slowest_pole", -certificate.poles[0][0], "1/s"),
        ("infinite_poles", float(system.size - np.linalg.matrix_rank(Eo)), "1"),
        ("margin_above_norm", margin, "1"),
        *_missed(Ao, Eo, system, theory),
        *_held(Ao, system, gains, plant.hold_period, noise),
        *_biases(Ao, system, theory.readings),
    ):
        yield Metric(name, metric, value, unit)
    change = _controller_effect(system, gains, records)
    for (fault, unit), value in zip(_FAULTS, change, strict=True):
        yield Metric(name, f"controller_effect_on_{fault}_fault", value, unit)


def _missed(
    Ao: Array, Eo: Array, system: AugmentedSystem, theory: keys.Theory
) -> Iterator[tuple[str, float, str]]:
    """What is missing of a steady sinusoidal fault, as a share: at the paper's and a faster rate.

    By (10) with f' for the input it is j w times a diagonal entry of (j w Eo - Ao)^-1 Bo.
    """
    frequencies = np.array(theory.fault_frequencies, dtype=np.float64)
    for suffix, factor in (("", 1.0), ("_when_fast", theory.fast_fault)):
        for row, (fault, _) in enumerate(_FAULTS, start=-2):
            s = 1j * factor * frequencies[row]
            error = s * np.linalg.solve(s * Eo - Ao, system.Bo)[row, row]
            yield f"missed_{fault}_fault{suffix}", float(abs(error)), "1"


def _held(
    Ao: Array, system: AugmentedSystem, gains: Gains, period: float, noise: float
) -> Iterator[tuple[str, float, str]]:
    """Deviations of the estimates by held noise, and what is left of held disturbances.

    Each disturbance moves one fault for good if it is constant, that of the speed the sensor fault,
    that of the current the actuator fault. Left is the deviation by a random one over that.
    """
    by_noise = held_deviation(system, gains, [0.0, 0.0, noise], period)[-2:]
    for (fault, unit), value in zip(_FAULTS, by_noise, strict=True):
        yield f"noise_in_{fault}_fault", float(value), unit
    at_rest = np.linalg.solve(Ao, system.Bo)
    for column, (source, row) in enumerate((("speed", -1), ("current", -2))):
        sizes = np.eye(3)[column]
        left = held_deviation(system, gains, sizes, period)[row] / abs(at_rest[row, column])
        yield f"{source}_disturbance_left", float(left), "1"


def _biases(Ao: Array, system: AugmentedSystem, readings: Any) -> Iterator[tuple[str, float, str]]:
    """Mean errors of the estimates, for each reading of the ranges of both disturbances."""
    ranges = as_floats("readings", readings)
    at_rest = np.linalg.solve(Ao, system.Bo[:, :2])[-2:]  # e = -Ao^-1 Bo d, and the estimate f - e
    for number, means in enumerate(ranges.mean(axis=2), start=1):
        for (fault, unit), value in zip(_FAULTS, at_rest @ means, strict=True):
            yield f"bias_of_{fault}_fault_reading_{number}", float(value), unit


def records_of_two_controllers(plant: keys.Plant, other_poles: Any) -> list[Series]:
    """The motor with a step in both faults, by the ledger's controller and by another one.

    Raises
    ------
    InputError
        If the other poles cannot be placed.
    """
    other = replace(plant, controller_poles=other_poles)
    try:
        controlled_motor(other)
    except InputError as error:
        raise InputError("other_poles", error.problem) from None
    step = [{"kind": "constant", "axis": 1, "from": 1.0, "size": 0.1}]
    still = [0.0, 0.0]
    scenario = keys.Scenario(step, step, still, still, noise_power=0.0)
    return [
        plant_stage.simulate(
            Job(replace(driven, horizon=_DURATION, hold_period=_DURATION), scenario=scenario)
        )
        for driven in (plant, other)
    ]


def _controller_effect(system: AugmentedSystem, gains: Gains, records: list[Series]) -> list[float]:
    """The largest difference between the estimates of both faults from two records."""
    observer = ExtendedStateObserver(system, gains, 2.0 * records[0].step)
    runs = [run_on(observer, record) for record in records]
    one, two = (np.hstack([run["actuator_fault"], run["sensor_fault"]]) for run in runs)
    return [float(value) for value in np.abs(one - two).max(axis=0)]
