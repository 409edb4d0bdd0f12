"""Stage plant: a system with a delayed input, and its measurements."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import located
from reobserve.core.matrices import as_vector
from reobserve_papers.papers.delay import keys, noise
from reobserve_papers.papers.delay.setup import (
    build_model,
    delay_bounds,
    grid,
    input_and_derivatives,
)
from reobserve_papers.papers.delay.units import UNITS
from reobserve_papers.plants.delayed_input import DelayedInputPlant, check_delay, delayed
from reobserve_papers.signals.grid import noise_hold
from reobserve_papers.signals.inputs import Signal
from reobserve_papers.signals.random_streams import random_stream
from reobserve_papers.signals.series import Channel, Series

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Setup:
    """A checked scenario: the plant, u with its derivatives, tau, and the share of noise."""

    plant: DelayedInputPlant
    inputs: list[Signal]
    delay: Signal
    noise_share: float


def build(job: keys.Job) -> Setup:
    """The contents of a scenario, checked against the grid."""
    plant, scenario = job.plant, job.scenario
    steps, step = grid(plant)
    if plant.noise_period >= 2 * step:
        noise_hold(plant.noise_period, plant.step)
    with located("plant"):
        delay = Signal.parse("delay", plant.delay, 1)
    check_delay("plant.delay", delay, delay_bounds(plant), step, steps * step)
    model = build_model(plant, scenario.model)
    with located("scenario"):
        as_vector("initial_state", scenario.initial_state, model.states)
        control = Signal.parse("input", scenario.input, 1)
        if scenario.past == "zero":
            control = _from_zero(control)
        inputs = input_and_derivatives("input", control, keys.MAX_DERIVATIVES)
    return Setup(DelayedInputPlant(model), inputs, delay, scenario.noise_share)


def _from_zero(control: Signal) -> Signal:
    """The same input, but zero before t = 0."""
    terms = (replace(term, onset=max(term.onset, 0.0)) for term in control.terms)
    return Signal(control.axes, tuple(terms))


def simulate(job: keys.Job) -> Series:
    """Simulate state, delay, input and measurements over the horizon.

    ``state`` is x, ``delay`` tau [s], ``delayed_input`` u(t - tau); ``input`` is u and
    ``input_derivatives`` u' and u''. ``past_input`` and ``past_derivatives`` are the same, earlier
    by the maximum delay, so that the record has the input before its start. ``measured`` and
    ``measured_input`` are y and u with their noise, held; ``_before`` marks limits from the left.
    ``read_input`` is u at single samples, if its noise is faster than the steps of observers. The
    event ``jumps`` lists the times at which the delay jumps.
    """
    setup = build(job)
    plant, (steps, step) = job.plant, grid(job.plant)

    def run(control: Signal) -> Array:
        start = job.scenario.initial_state
        return setup.plant.simulate(start, control, setup.delay, step, steps)

    time = np.arange(steps + 1, dtype=np.float64) * step
    past = time - delay_bounds(plant)[1]
    whole, output, torque, rates = UNITS[job.scenario.model]
    control = setup.inputs[0]
    u, rate = control(time)[:, 0], np.hstack([s(time) for s in setup.inputs[1:]])
    state = run(control)
    sizes = noise.deviations(plant, setup.noise_share, state[:, 0], u)
    noises = {}
    for name, size in zip(("measured", "measured_input"), sizes, strict=True):
        if size > 0:
            parts = noise.drawn(plant, random_stream(job.seed, "delay", name), len(time))
            noises[name] = [size * part for part in parts]
    if noises and plant.noisy_input == "applied":
        state = run(noise.on_top(control, noises["measured_input"][0], step))
    channels = {
        "state": Channel(state, whole),
        "delay": Channel(setup.delay(time)[:, 0], "s"),
        "delay_before": Channel(setup.delay(time, before=True)[:, 0], "s"),
        "delayed_input": Channel(delayed(control, setup.delay, time), torque),
        "input": Channel(u, torque),
        "input_derivatives": Channel(rate, rates),
        "past_input": Channel(control(past)[:, 0], torque),
        "past_derivatives": Channel(np.hstack([s(past) for s in setup.inputs[1:]]), rates),
    }
    for name, clean, unit in (("measured", state[:, 0], output), ("measured_input", u, torque)):
        if name in noises:
            right, left, read = noises[name]
            channels[name] = Channel(clean + right, unit)
            channels[f"{name}_before"] = Channel(clean + left, unit)
            if name == "measured_input" and plant.noise_period < 2 * step:
                channels["read_input"] = Channel(u + read, unit)
    return Series(time, channels, {"jumps": tuple(t for t in setup.delay.jumps if t < time[-1])})
