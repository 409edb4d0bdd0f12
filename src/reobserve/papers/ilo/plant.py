"""Stage plant: the satellite under a fault."""

from __future__ import annotations

from typing import Any

import numpy as np

from reobserve.errors import located
from reobserve.matrices import as_vector
from reobserve.papers.ilo.setup import grid, held_noise, noise_deviation
from reobserve.plants.satellite import Satellite
from reobserve.random_streams import random_stream
from reobserve.series import Channel, Series
from reobserve.signals import Signal


def build(settings: dict[str, Any]) -> tuple[Satellite, Signal, Signal]:
    """Satellite, control and fault of a scenario, checked against the grid.

    Raises
    ------
    InputError
        If a parameter or a signal cannot be used.
    """
    plant = settings["plant"]
    steps, step = grid(plant)
    with located("plant"):
        satellite = Satellite(plant["inertia"], plant["input_matrix"], plant["fault_matrix"])
        as_vector("initial_rate", plant["initial_rate"], 3)
        control = Signal.parse("control", plant["control"], 3)
        control.check_grid("control", 2 * step, steps * step)
    with located("scenario"):
        fault = Signal.parse("fault", settings["scenario"]["fault"], 3)
        fault.check_grid("fault", 2 * step, steps * step)
    return satellite, control, fault


def simulate(settings: dict[str, Any]) -> Series:
    """Rate, control and fault torque of a scenario over the horizon.

    Channels ``rate`` [rad/s], ``control`` and ``fault`` [N m]; where a channel jumps, its limits
    from the left are in ``<name>_before``. ``measured`` [rad/s] is the rate with its noise.

    Raises
    ------
    InputError
        If a parameter or a signal cannot be used.
    DivergenceError
        If the rate leaves the range of floating-point numbers.
    """
    plant = settings["plant"]
    satellite, control, fault = build(settings)
    steps, step = grid(plant)
    rate = satellite.simulate(plant["initial_rate"], control, fault, step, steps)
    time = np.arange(steps + 1, dtype=np.float64) * step
    channels = {"rate": Channel(rate, "rad/s")}
    deviation = noise_deviation(plant)
    if deviation > 0:
        stream = random_stream(settings["seed"], "ilo", "rate noise")
        noise, noise_before = held_noise(stream, plant, steps + 1)
        channels["measured"] = Channel(rate + deviation * noise, "rad/s")
        channels["measured_before"] = Channel(rate + deviation * noise_before, "rad/s")
    for name, signal in (("control", control), ("fault", fault)):
        channels[name] = Channel(signal(time), "N m")
        if signal.jumps:
            channels[f"{name}_before"] = Channel(signal(time, before=True), "N m")
    return Series(time, channels, {"onsets": fault.onsets})
