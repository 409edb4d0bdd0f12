"""Inputs of observers from the plant's record."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.observers.levant import LevantDifferentiator
from reobserve_papers.papers.delay import keys
from reobserve_papers.papers.delay.measured import Pair, measured
from reobserve_papers.papers.delay.setup import delay_bounds
from reobserve_papers.signals.grid import multiple
from reobserve_papers.signals.series import Series

Array = NDArray[np.float64]


def inputs(job: keys.Job, observer: keys.Extended, plant: Series) -> Pair:
    """The measured u with its derivatives up to the observer's order, shape (k, m + 1).

    The derivatives are exact, or come from a differentiator on the measured u.
    """
    check_derivatives(job, observer)
    order, source = observer.order, observer.derivatives
    u, before = measured(plant, "measured_input", "input")
    if source == "exact":
        rates = plant["input_derivatives"][:, :order]
        return np.column_stack([u, rates]), np.column_stack([before, rates])
    sampled = plant["read_input"] if "read_input" in plant.channels else u
    rates = _differentiated(job, observer, sampled, plant)[:, :order]
    return np.column_stack([u, rates]), np.column_stack([before, rates])


def check_derivatives(job: keys.Job, observer: keys.Extended) -> None:
    """Check the differentiator of an observer that has one, or raise `InputError`."""
    if observer.derivatives == "levant":
        differentiator(job, observer)


def _differentiated(job: keys.Job, observer: keys.Extended, u: Array, plant: Series) -> Array:
    """The estimates of u' and u'' at every sample of the plant, shape (k, 2).

    Between samples of the differentiator u' is extrapolated with u''.
    """
    levant = differentiator(job, observer)
    every = round(levant.sampling_period / job.plant.step)
    samples = u[::every]
    start = np.zeros(levant.order + 1)
    if observer.initial_derivatives == "exact":
        start = np.append(plant["input"][0], plant["input_derivatives"][0])
    estimate = levant.run(samples, start=levant.init(start))["derivatives"]
    index = np.arange(len(u))
    rates = estimate[index // every, 1:].copy()
    rates[:, 0] += rates[:, 1] * (index % every) * job.plant.step
    return rates


def differentiator(job: keys.Job, observer: keys.Extended) -> LevantDifferentiator:
    """The differentiator (37) of an observer."""
    L, period, lambdas = observer.levant()
    multiple("sampling", period, job.plant.step, "plant.step")
    return LevantDifferentiator(
        L=L, order=keys.MAX_DERIVATIVES, lambdas=lambdas, sampling_period=period
    )


def check_mean_delay(job: keys.Job, mean: float) -> None:
    """Check a fixed delay [s]: above 0, at most the maximum, a multiple of the plant's step."""
    longest = delay_bounds(job.plant)[1]
    if not 0.0 < mean <= longest:
        raise InputError("mean_delay", f"{mean:g} s must be above 0 and at most {longest:g} s")
    multiple("mean_delay", mean, job.plant.step, "plant.step")


def delayed_input(job: keys.Job, plant: Series, delay: float) -> Pair:
    """The measured u a fixed delay [s] ago, before the start the input itself, without noise."""
    check_mean_delay(job, delay)
    longest = delay_bounds(job.plant)[1]
    shift = multiple("mean_delay", delay, plant.step, "plant.step")
    first = multiple("mean_delay", longest, plant.step, "plant.step")
    past = plant["past_input"][first - shift : first]
    u, before = measured(plant, "measured_input", "input")
    right, left = (np.concatenate([past, part[: len(u) - shift]]) for part in (u, before))
    if shift < len(left):
        left[shift] = plant["past_input"][first]  # before the first measured sample
    return right, left


def past_and_present(job: keys.Job, plant: Series, every: int) -> Pair:
    """Arrays (k, 2) of u and u' over the maximum delay before the start, and from the start on."""
    longest = delay_bounds(job.plant)[1]
    first = multiple("sampling_period", longest, 2 * every * plant.step, "the step") * 2 * every
    past = np.column_stack([plant["past_input"], plant["past_derivatives"][:, 0]])
    present = np.column_stack([plant["input"], plant["input_derivatives"][:, 0]])
    return past[: first + 1 : every], present[::every]
