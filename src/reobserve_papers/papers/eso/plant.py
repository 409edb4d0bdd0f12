"""Stage plant: the controlled motor with faults, and its measurements."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from reobserve_papers.papers.eso import keys
from reobserve_papers.papers.eso.setup import MotorExperiment, experiment
from reobserve_papers.signals.random_streams import random_stream
from reobserve_papers.signals.series import Channel, Series

Array = NDArray[np.float64]


def build(job: keys.Job) -> MotorExperiment:
    """Check a scenario and construct its parts (see `experiment`)."""
    return experiment(job.plant, job.scenario)


def simulate(job: keys.Job) -> Series:
    """Simulate state, faults and measurements over the horizon.

    ``state`` is speed and current, ``output`` y, ``control`` u and ``reference`` r;
    ``actuator_fault`` and ``sensor_fault`` are the true faults. ``_before`` marks limits from the
    left. The event ``faults`` lists the times at which a fault jumps.
    """
    setup = build(job)
    disturbance, noise = _drawn(setup, job.seed)
    run = setup.plant.simulate(
        setup.reference, setup.actuator_fault, setup.sensor_fault, disturbance, noise, setup.step,
        job.plant.initial_state,
    )  # fmt: skip
    time = np.arange(setup.steps + 1, dtype=np.float64) * setup.step
    channels = {"state": Channel(run.state, "rad/s, A")}
    for suffix, side in (("", run.after), ("_before", run.before)):
        channels[f"output{suffix}"] = Channel(side.output, "rad/s, A")
        channels[f"control{suffix}"] = Channel(side.control[:, 0], "V")
        channels[f"actuator_fault{suffix}"] = Channel(side.actuator_fault[:, 0], "V")
        channels[f"sensor_fault{suffix}"] = Channel(side.sensor_fault[:, 0], "rad/s")
    channels["reference"] = Channel(setup.reference(time)[:, 0], "rad/s")
    jumps = {*setup.actuator_fault.jumps, *setup.sensor_fault.jumps}
    return Series(time, channels, {"faults": tuple(sorted(t for t in jumps if t < time[-1]))})


def _drawn(setup: MotorExperiment, seed: int) -> tuple[Array, Array]:
    """Random disturbances and noise, one row per step, each held for ``setup.hold`` steps."""
    periods = -(-setup.steps // setup.hold)
    rows = np.arange(setup.steps) // setup.hold
    uniform = random_stream(seed, "eso", "disturbance").random((periods, len(setup.low)))
    normal = random_stream(seed, "eso", "noise").standard_normal((periods, 1))
    disturbance = setup.low + (setup.high - setup.low) * uniform
    return disturbance[rows], setup.deviation * normal[rows]
