"""Stage observe: an extended state observer on a plant's record, with the gains of its design."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from reobserve.ledger.types import Settings, read_job
from reobserve.observers.extended_state import ExtendedStateObserver, Run
from reobserve.papers.eso import keys
from reobserve.papers.eso.stored_design import stored_design
from reobserve.timeseries.series import Channel, Series


def build(settings: Settings, design: Mapping[str, Any]) -> ExtendedStateObserver:
    """The observer with a design's gains; its period is two steps of the plant.

    Raises
    ------
    InputError
        If a setting or the design cannot be used.
    """
    job = read_job(keys.Ledger, settings)
    system, found = stored_design(job.plant, design)
    # Parabolas through the record's value in the middle of each step.
    return ExtendedStateObserver(system, found.gains, 2.0 * job.plant.step, "second")


def estimate(settings: Settings, plant: Series, design: Mapping[str, Any]) -> Series:
    """Estimates of state and faults at every second sample of the record.

    Raises
    ------
    InputError
        If a setting cannot be used.
    DivergenceError
        If the observer leaves the range of floating-point numbers.
    """
    job = read_job(keys.Ledger, settings)
    observer = build(job, design)
    run = run_on(observer, plant)
    return Series(
        plant.time[::2],
        {
            "state": Channel(run.estimate, "rad/s, A"),
            "actuator_fault": Channel(run.actuator_fault[:, 0], "V"),
            "sensor_fault": Channel(run.sensor_fault[:, 0], "rad/s"),
        },
        plant.events,
    )


def run_on(observer: ExtendedStateObserver, plant: Series) -> Run:
    """The observer on a record: samples, their limits from the left, and the middles."""
    output, control = plant["output"], plant["control"][:, None]
    before = plant["output_before"][::2], plant["control_before"][::2, None]
    # There is nothing before the first sample.
    middle = tuple(
        np.concatenate([np.zeros((1, part.shape[1])), part[1::2]]) for part in (output, control)
    )
    return observer.run(output[::2], control[::2], observer.init(), before, (middle[0], middle[1]))
