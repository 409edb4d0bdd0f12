"""Stage observe: one observer on the record of one scenario."""

from __future__ import annotations

import numpy as np

from reobserve.core.errors import InputError
from reobserve.core.matrices import as_vector
from reobserve.observers.extended_high_gain import ExtendedHighGainObserver
from reobserve.observers.fixed_step import run_on_halves
from reobserve.observers.high_gain import HighGainObserver
from reobserve_papers.papers.delay import keys, observer_inputs
from reobserve_papers.papers.delay.estimator import DelayEstimator
from reobserve_papers.papers.delay.estimator_adaptive import AdaptiveDelayEstimator
from reobserve_papers.papers.delay.estimator_least_squares import LeastSquaresDelayEstimator
from reobserve_papers.papers.delay.estimator_variable_structure import (
    VariableStructureDelayEstimator,
)
from reobserve_papers.papers.delay.measured import output
from reobserve_papers.papers.delay.setup import build_model, delay_bounds
from reobserve_papers.papers.delay.units import UNITS
from reobserve_papers.signals.grid import stride
from reobserve_papers.signals.series import Channel, Series


def estimate(job: keys.Job, plant: Series) -> Series:
    """Estimates of state and delay [s] at the ends of the observer's steps, if it has them.

    ``off`` is the share of each step for which the gain is switched off, up to the row's time.
    """
    every = stride(job.plant.step, job.observer.sampling_period)
    match job.observer:
        case keys.Extended() as observer:
            channels = _extended(job, observer, plant, every)
        case keys.Standard() as observer:
            channels = _standard(job, observer, plant, every)
        case observer:
            channels = _estimator(job, observer, plant, every)
    return Series(plant.time[:: 2 * every], channels, plant.events)


def build_extended(job: keys.Job, observer: keys.Extended) -> ExtendedHighGainObserver:
    """The extended observer that an ``observers`` branch states, or `InputError` if wrong."""
    model = build_model(job.plant, observer.model)
    as_vector("initial_estimate", observer.initial_estimate, model.states)
    _check_delay(job, observer.initial_delay)
    start = observer.initial_matrix
    return ExtendedHighGainObserver(
        model,
        rho=observer.rho,
        order=observer.order,
        delay_bounds=delay_bounds(job.plant),
        threshold=observer.threshold,
        switched=observer.switched,
        initial_matrix=None if isinstance(start, str) else start,
        sampling_period=observer.sampling_period,
    )


def build_standard(job: keys.Job, observer: keys.Standard) -> HighGainObserver:
    """The standard observer that an ``observers`` branch states, or `InputError` if wrong."""
    model = build_model(job.plant, observer.model)
    as_vector("initial_estimate", observer.initial_estimate, model.states)
    return HighGainObserver(model, rho=observer.rho, sampling_period=observer.sampling_period)


def build_estimator(job: keys.Job, observer: keys.Estimator) -> DelayEstimator:
    """The estimator of the delay alone of an ``observers`` branch, for the scalar plant."""
    rate, gain = map(float, build_model(job.plant, "lag").parameters)
    common = (rate, gain, delay_bounds(job.plant), observer.sampling_period)
    match observer:
        case keys.LeastSquares():
            return LeastSquaresDelayEstimator(
                *common, observer.initial_covariance, observer.forgetting
            )
        case keys.AdaptiveIdentification():
            return AdaptiveDelayEstimator(
                *common, observer.filter_time, observer.forgetting, observer.adaptation_gain
            )
        case keys.Relay():
            return VariableStructureDelayEstimator(*common, observer.relay_gain, observer.relay_on)


def build(job: keys.Job) -> ExtendedHighGainObserver | HighGainObserver | DelayEstimator:
    """The observer of any branch, initial values checked, or `InputError` if they are wrong."""
    match job.observer:
        case keys.Extended() as observer:
            built = build_extended(job, observer)
            observer_inputs.check_derivatives(job, observer)
            return built
        case keys.Standard() as observer:
            observer_inputs.check_mean_delay(job, observer.mean_delay)
            return build_standard(job, observer)
        case observer:
            _check_delay(job, observer.initial_delay)
            return build_estimator(job, observer)


def _check_delay(job: keys.Job, delay: float) -> None:
    low, high = delay_bounds(job.plant)
    if not low <= delay <= high:
        raise InputError("initial_delay", f"{delay:g} s must be from {low:g} to {high:g} s")


Found = dict[str, Channel]


def _extended(job: keys.Job, observer: keys.Extended, plant: Series, every: int) -> Found:
    built = build_extended(job, observer)
    y, y_before = output(plant)
    u, u_before = observer_inputs.inputs(job, observer, plant)
    run = run_on_halves(
        built, y[::every], u[::every],
        start=built.init(observer.initial_estimate, delay=observer.initial_delay),
        y_before=y_before[::every], u_before=u_before[::every],
    )  # fmt: skip
    unit = UNITS[observer.model][0]
    return {
        "state": Channel(run["state"], unit),
        "delay": Channel(run["delay"], "s"),
        "off": Channel(run["switched_off"], "1"),
    }


def _standard(job: keys.Job, observer: keys.Standard, plant: Series, every: int) -> Found:
    built = build_standard(job, observer)
    y, y_before = output(plant)
    u, u_before = observer_inputs.delayed_input(job, plant, observer.mean_delay)
    run = run_on_halves(
        built, y[::every], u[::every], start=built.init(observer.initial_estimate),
        y_before=y_before[::every], u_before=u_before[::every],
    )  # fmt: skip
    return {"state": Channel(run["state"], UNITS[observer.model][0])}


def _estimator(job: keys.Job, observer: keys.Estimator, plant: Series, every: int) -> Found:
    built = build_estimator(job, observer)
    x = plant["state"]
    if built.measurements == 2:
        rate, gain = build_model(job.plant, "lag").parameters
        x = np.column_stack([x, gain * plant["delayed_input"] - rate * x[:, 0]])
    past, control = observer_inputs.past_and_present(job, plant, every)
    start = built.start(float(x[0, 0]), observer.initial_delay)
    run = built.run(x[::every], past, control, start)
    return {"delay": Channel(run[:, 0].copy(), "s")}
