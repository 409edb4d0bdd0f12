"""Stage theory: the conditions and the guarantees of the paper, as numbers.

The column ``observer`` names an observer of the parameter file or another subject, such as the
motor.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from reobserve.synthesis.extended_state.system import AugmentedSystem
from reobserve_papers.metrics.metrics import Metric
from reobserve_papers.metrics.responses import settling_time
from reobserve_papers.metrics.theory_parts import part
from reobserve_papers.papers.eso import keys
from reobserve_papers.papers.eso.design import stored_design
from reobserve_papers.papers.eso.random_gains import Drawn, medians, random_gains
from reobserve_papers.papers.eso.setup import augmented, controlled_motor, motor
from reobserve_papers.papers.eso.theory_observers import (
    Observers,
    certified,
    held,
    left_of_jumps,
    missed,
    norms,
)
from reobserve_papers.signals.inputs import Signal

_STEP, _DURATION = 1e-3, 10.0  # of the step response [s]
_BAND = 0.02  # of the step, within which the speed counts as settled


def measure(job: keys.Job, designs: dict[str, Any]) -> list[Metric]:
    """Compute the numbers of the theory (see `MEANINGS` of `metrics`)."""
    plant, theory = job.plant, job.theory
    system = augmented(plant, 1.0)
    noise = plant.noise_deviation(theory.noise_power)
    observers = {
        name: stored_design(plant, designs[body.design]) for name, body in job.observers.items()
    }
    by_chance = {f"{k}": (system, Drawn(gains)) for k, gains in enumerate(random_gains(system))}

    def estimates(of: Observers) -> list[Metric]:
        return [
            *missed(of, theory.fast_frequency),
            *left_of_jumps(of, theory.settled_after),
            *held(of, theory, plant.hold_period, noise),
            *norms(of),
        ]

    return [
        *_motors(plant),
        *_conditions(system),
        *_step_response(plant),
        Metric("noise", "deviation", noise, "rad/s"),
        *certified(observers),
        *estimates(observers),
        *medians(estimates(by_chance)),
    ]


@part
def _motors(plant: keys.Plant) -> Iterator[Metric]:
    """Stability and observability of (A, C), with both signs of the back electromotive force."""
    driven = motor(plant)
    for name, printed in (("motor", False), ("motor_as_printed", True)):
        A = replace(driven, printed=printed).A
        yield Metric(name, "slowest_pole", -float(np.linalg.eigvals(A).real.max()), "1/s")
        yield Metric(name, "unobservable_states", _unobservable(A, np.eye(2)), "1")


def _unobservable(A: Any, C: Any) -> float:
    """n minus the rank of the observability matrix of (A, C)."""
    size = len(A)
    rows = [C @ np.linalg.matrix_power(A, power) for power in range(size)]
    return float(size - np.linalg.matrix_rank(np.vstack(rows)))


@part
def _conditions(system: AugmentedSystem) -> Iterator[Metric]:
    """Rank deficiency of the Rosenbrock matrix at zero, with both outputs and with the speed only.

    It is the number of combinations of constant states and faults that no output shows.
    """
    A, C, Fa, Fs = system.A, system.C, system.Fa, system.Fs
    for name, outputs, sensor in (("two_outputs", C, Fs), ("one_output", C[:1], Fs[:1])):
        corner = np.zeros((len(A), sensor.shape[1])), np.zeros((len(outputs), Fa.shape[1]))
        rosenbrock = np.block([[A, Fa, corner[0]], [outputs, corner[1], sensor]])
        missing = rosenbrock.shape[1] - np.linalg.matrix_rank(rosenbrock)
        yield Metric(name, "rosenbrock_rank_deficiency", float(missing), "1")


@part
def _step_response(plant: keys.Plant) -> Iterator[Metric]:
    """Overshoot and settling time of the speed after a unit step of the reference."""
    driven, steps = controlled_motor(plant), round(_DURATION / _STEP)
    step = Signal.parse("reference", [{"kind": "constant", "axis": 1, "size": 1.0}], 1)
    none, still = Signal(1, ()), (np.zeros((steps, 2)), np.zeros((steps, 1)))
    speed = driven.simulate(step, none, none, *still, _STEP).state[:, 0]
    time = np.arange(steps + 1, dtype=np.float64) * _STEP
    error = speed - 1.0
    settled = settling_time(time, error[:-1], error[1:], _BAND)
    yield Metric("controller", "overshoot", max(0.0, float(error.max())), "1")
    yield Metric("controller", "settling_time", settled, "s")
