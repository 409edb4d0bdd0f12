"""From the ledger's values to plant, signals and observers."""

from __future__ import annotations

from typing import Any

import numpy as np

from reobserve.errors import InputError, located
from reobserve.grid import noise_hold
from reobserve.matrices import as_positive, as_scalar
from reobserve.observers.adaptive import AdaptiveObserver
from reobserve.observers.ilo import IterativeLearningObserver
from reobserve.observers.ilo_sampled import SampledIterativeLearningObserver
from reobserve.observers.rigid_body_observer import RigidBodyObserver, whole_steps
from reobserve.random_streams import held_normal
from reobserve.rigid_body import RigidBody

Settings = dict[str, Any]

ALGORITHMS: dict[str, tuple[type[RigidBodyObserver], tuple[str, ...]]] = {
    "sampled_ilo": (SampledIterativeLearningObserver, ("K1", "K2", "damping", "interval")),
    "continuous_ilo": (IterativeLearningObserver, ("K1", "K2", "damping", "interval")),
    "adaptive": (AdaptiveObserver, ("damping", "integral_gain", "proportional_gain")),
}

MOST_STEPS = 20_000_000  # of a plant record: some ten gigabytes

_COMMON = ("step_size", "inertia_factor", "initial_rate", "initial_fault")


def known_body(plant: Settings, factor: float = 1.0) -> RigidBody:
    """The rigid body as an observer knows it, its inertia off by ``factor``."""
    with located("plant"):
        body = RigidBody(plant["inertia"], plant["input_matrix"], plant["fault_matrix"])
    return RigidBody(factor * body.inertia, body.input_matrix, body.fault_matrix)


def build_observer(plant: Settings, settings: Settings) -> RigidBodyObserver:
    """The observer that an ``observers`` branch of the ledger states.

    Raises
    ------
    InputError
        If the algorithm is unknown, a parameter is missing, unknown or out of bounds.
    """
    algorithm = settings["algorithm"]
    if algorithm not in ALGORITHMS:
        raise InputError("algorithm", f"{algorithm!r} must be one of {', '.join(ALGORITHMS)}")
    kind, names = ALGORITHMS[algorithm]
    allowed = {"algorithm", "label", *names, *_COMMON}
    for name in (*names, *_COMMON):
        if name not in settings:
            raise InputError(name, f"is missing; the algorithm {algorithm} needs it")
    for name in settings:
        if name not in allowed:
            raise InputError(name, f"unknown key; {algorithm} takes {', '.join(sorted(allowed))}")
    body = known_body(plant, as_positive("inertia_factor", settings["inertia_factor"]))
    gains = {name: settings[name] for name in names}
    observer = kind(body, settings["step_size"], **gains)
    stride(plant, observer)
    observer.init(settings["initial_rate"], settings["initial_fault"])
    return observer


def stride(plant: Settings, observer: RigidBodyObserver) -> int:
    """Plant samples in half a step of the observer."""
    half = 0.5 * observer.step_size
    step = as_positive("plant.step", plant["step"])
    samples = round(half / step)
    if samples < 1 or abs(samples * step - half) > 1e-9 * half:
        raise InputError(
            "step_size",
            f"{observer.step_size:g} s must be an even multiple of plant.step, {step:g} s",
        )
    return samples


def grid(plant: Settings) -> tuple[int, float]:
    """The number of plant steps and the step [s].

    Raises
    ------
    InputError
        If horizon or step are not positive or do not fit.
    """
    with located("plant"):
        step = as_positive("step", plant["step"])
        horizon = as_positive("horizon", plant["horizon"])
        if horizon > MOST_STEPS * step:
            raise InputError(
                "horizon",
                f"{horizon:g} s is {horizon / step:.3g} steps, must be {MOST_STEPS:g} at most",
            )
        try:
            steps = whole_steps(horizon, step)
        except InputError:
            raise InputError(
                "horizon", f"{horizon:g} s must be a whole multiple of the step of {step:g} s"
            ) from None
    return steps, step


def noise_deviation(plant: Settings) -> float:
    """The standard deviation of the measurement noise [rad/s], not negative."""
    deviation = as_scalar("plant.noise", plant["noise"])
    if deviation < 0:
        raise InputError("plant.noise", f"{deviation:g} rad/s must not be negative")
    return deviation


def held_noise(
    stream: np.random.Generator, plant: Settings, samples: int
) -> tuple[np.ndarray[Any, np.dtype[np.float64]], np.ndarray[Any, np.dtype[np.float64]]]:
    """Unit normal noise held over ``plant.noise_period``: values and their limits from the left.

    Both have shape (samples, 3).

    Raises
    ------
    InputError
        If the period is no multiple of two plant steps.
    """
    return held_normal(stream, samples, noise_hold(plant), 3)
