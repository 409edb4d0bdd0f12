"""Construct the motor, its control, the augmented system and the signals from the parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError, located
from reobserve.core.matrices import as_floats
from reobserve.synthesis.extended_state.system import AugmentedSystem
from reobserve_papers.papers.eso import keys
from reobserve_papers.plants.dc_motor import ControlledMotor, DCMotor, SpeedControl
from reobserve_papers.signals.grid import multiple, plant_grid
from reobserve_papers.signals.inputs import Signal

Array = NDArray[np.float64]

MOST_STEPS = 2_000_000  # of a plant's record

CONSTANTS = (
    "inertia",
    "friction",
    "torque_constant",
    "emf_constant",
    "resistance",
    "inductance",
)


def motor(plant: keys.Plant) -> DCMotor:
    """Construct the motor, or raise `InputError` with a wrong constant."""
    with located("plant"):
        return DCMotor(*(getattr(plant, name) for name in CONSTANTS))


def controlled_motor(plant: keys.Plant) -> ControlledMotor:
    """Construct the motor with its speed control and the matrices of disturbance and noise."""
    driven = motor(plant)
    with located("plant"):
        real, imaginary, third = plant.controller_poles
        try:
            control = SpeedControl.placed(
                driven, [complex(real, imaginary), complex(real, -imaginary), third]
            )
        except InputError as error:
            raise InputError("controller_poles", error.problem) from None
        return ControlledMotor(
            driven,
            control,
            as_floats("disturbance_matrix", plant.disturbance_matrix),
            as_floats("noise_matrix", plant.noise_matrix),
            as_floats("sensor_matrix", plant.sensor_matrix),
            plant.feedback == "state",
        )


def augmented(plant: keys.Plant, filter_rate: float) -> AugmentedSystem:
    """The augmented system of the motor with both states measured.

    Indriawati, Agustinah & Jazidie, (7).
    """
    driven = controlled_motor(plant)
    B, rate = driven.motor.B, np.array(float(filter_rate))
    try:
        return AugmentedSystem(
            driven.motor.A, B, np.eye(2), driven.Dd, driven.Dw, B, driven.Fs, rate
        )
    except InputError as error:
        raise InputError(
            "plant.sensor_matrix",
            f"{driven.Fs.tolist()} hides faults: {error.parameter} {error.problem}",
        ) from None


@dataclass(frozen=True)
class MotorExperiment:
    """A checked scenario: its signals, and the distributions of disturbances and noise.

    ``low`` and ``high`` are the bounds of the uniform disturbances, shape (2,). ``deviation`` is
    the standard deviation of the normal noise. Both are held for ``hold`` steps of ``step`` [s].
    """

    plant: ControlledMotor
    reference: Signal
    actuator_fault: Signal
    sensor_fault: Signal
    low: Array
    high: Array
    deviation: float
    hold: int
    steps: int
    step: float


def experiment(plant: keys.Plant, scenario: keys.Scenario) -> MotorExperiment:
    """Construct a scenario (Indriawati, Agustinah & Jazidie, Section IV, faults)."""
    steps, step = plant_grid(plant.horizon, plant.step, MOST_STEPS)
    driven = controlled_motor(plant)
    with located("plant"):
        if steps % 2:
            raise InputError("horizon", "must be an even number of steps: observers take two")
        period = plant.hold_period
        hold = multiple("hold_period", period, step, "the step")
        if hold % 2:
            raise InputError("hold_period", f"{period:g} s must be an even number of steps")
        # Jumps lie on the grid of the observers, whose step is two of the plant's.
        reference = _signal("reference", pulses(plant), 2 * step, steps * step)
    with located("scenario"):
        actuator, sensor = (
            _signal(name, getattr(scenario, name), 2 * step, steps * step)
            for name in ("actuator_fault", "sensor_fault")
        )
        low, high = as_floats("disturbance", scenario.disturbance).T
        if (low > high).any():
            ranges = scenario.disturbance
            raise InputError("disturbance", f"{ranges} must be [minimum, maximum] of d1 and of d2")
    deviation = plant.noise_deviation(scenario.noise_power)
    return MotorExperiment(
        driven, reference, actuator, sensor, low, high, deviation, hold, steps, step
    )


def pulses(plant: keys.Plant) -> list[Any]:
    """Terms of the reference, with square waves of the width `pulse_width`."""
    return [
        {"width": plant.pulse_width, **term} if term.get("kind") == "square" else term
        for term in plant.reference
    ]


def _signal(name: str, terms: Any, step: float, horizon: float) -> Signal:
    signal = Signal.parse(name, terms, 1)
    signal.check_jumps(name, step, horizon)
    return signal
