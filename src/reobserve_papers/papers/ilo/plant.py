"""Stage plant: the satellite under a fault."""

from __future__ import annotations

import numpy as np

from reobserve.core.errors import located
from reobserve_papers.papers.ilo import keys
from reobserve_papers.plants.satellite import Satellite
from reobserve_papers.signals.grid import noise_hold, plant_grid
from reobserve_papers.signals.inputs import Signal
from reobserve_papers.signals.random_streams import held_normal, random_stream
from reobserve_papers.signals.series import Channel, Series

MOST_STEPS = 20_000_000  # of a plant record: about a gigabyte


def build(job: keys.Job) -> tuple[Satellite, Signal, Signal]:
    """Construct satellite, control and fault of a scenario, and check them against the grid."""
    plant = job.plant
    steps, step = plant_grid(plant.horizon, plant.step, MOST_STEPS)
    with located("plant"):
        satellite = Satellite(plant.inertia, plant.input_matrix, plant.fault_matrix)
        control = Signal.parse("control", plant.control, 3)
        control.check_grid("control", 2 * step, steps * step)
    with located("scenario"):
        fault = Signal.parse("fault", job.scenario.fault, 3)
        fault.check_grid("fault", 2 * step, steps * step)
    return satellite, control, fault


def simulate(job: keys.Job) -> Series:
    """Simulate rate, control and fault torque of a scenario over the horizon.

    Channels ``rate`` [rad/s], ``control`` and ``fault`` [N m]; limits from the left of a
    channel with jumps are in ``<name>_before``. ``measured`` [rad/s] is the rate with noise.
    """
    plant = job.plant
    satellite, control, fault = build(job)
    steps, step = plant_grid(plant.horizon, plant.step, MOST_STEPS)
    rate = satellite.simulate(plant.initial_rate, control, fault, step, steps)
    time = np.arange(steps + 1, dtype=np.float64) * step
    channels = {"rate": Channel(rate, "rad/s")}
    if plant.noise > 0:
        stream = random_stream(job.seed, "ilo", "rate noise")
        noise, noise_before = held_normal(
            stream, steps + 1, noise_hold(plant.noise_period, plant.step), 3
        )
        channels["measured"] = Channel(rate + plant.noise * noise, "rad/s")
        channels["measured_before"] = Channel(rate + plant.noise * noise_before, "rad/s")
    for name, signal in (("control", control), ("fault", fault)):
        channels[name] = Channel(signal(time), "N m")
        if signal.jumps:
            channels[f"{name}_before"] = Channel(signal(time, before=True), "N m")
    return Series(time, channels, {"onsets": fault.onsets})
