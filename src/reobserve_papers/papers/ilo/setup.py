"""Construct observers from the parameter file."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from reobserve.core.errors import InputError
from reobserve.core.validation import MatrixValue
from reobserve.observers.adaptive import AdaptiveObserver
from reobserve.observers.ilo import ILO, SampledILO
from reobserve.observers.rigid_body_observer import RigidBodyObserver
from reobserve_papers.papers.ilo import keys
from reobserve_papers.papers.ilo.body import known_body, on_axis
from reobserve_papers.parameters.job import named


def build_observer(plant: keys.Plant, observer: keys.Observer) -> RigidBodyObserver:
    """Construct the observer that an entry of ``observers`` in the parameter file specifies."""
    body, period = known_body(plant, observer.inertia_factor), observer.sampling_period
    built: RigidBodyObserver
    if isinstance(observer, keys.Adaptive):
        built = AdaptiveObserver(
            body, observer_gain=observer.observer_gain, integral_gain=observer.integral_gain,
            proportional_gain=observer.proportional_gain, sampling_period=period,
        )  # fmt: skip
    else:
        interval = observer.update_interval
        if interval > plant.horizon:
            raise InputError(
                "update_interval",
                f"{interval:g} s must be {plant.horizon:g} s at most, the horizon",
            )
        kind = SampledILO if isinstance(observer, keys.Sampled) else ILO
        built = kind(
            body, K1=observer.K1, K2=observer.K2, observer_gain=observer.observer_gain,
            update_interval=interval, sampling_period=period,
        )  # fmt: skip
    stride(plant, built)
    built.init(observer.initial_rate, fault=observer.initial_fault)
    return built


def pure_integrator(job: keys.Job, gain: MatrixValue, damping_ratio: float) -> keys.Adaptive:
    """Parameters of an adaptive observer with this integral gain and no proportional part.

    Lambda is set so that the error on the faulty axis has the damping ratio.
    """
    body, axis = known_body(job.plant), job.metrics.axis - 1
    size = on_axis(gain, axis) * float(body.fault_matrix[axis, axis])
    # J s^2 + Lambda s + Gamma B_f = 0
    observer_gain = 2.0 * damping_ratio * float(np.sqrt(size * body.inertia[axis, axis]))
    adaptive = named(job.observers, "adaptive", keys.Adaptive)
    return replace(adaptive, integral_gain=gain, proportional_gain=0.0, observer_gain=observer_gain)


def stride(plant: keys.Plant, observer: RigidBodyObserver) -> int:
    """Number of plant steps in half a sampling period of the observer."""
    half = 0.5 * observer.sampling_period
    step = plant.step
    samples = round(half / step)
    if samples < 1 or abs(samples * step - half) > 1e-9 * half:
        raise InputError(
            "sampling_period",
            f"{observer.sampling_period:g} s must be an even multiple of plant.step, {step:g} s",
        )
    return samples
