"""Stage observe: run an extended state observer, with designed gains, on a record of the plant."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from reobserve.observers.extended_state import EsoState, ExtendedStateObserver
from reobserve.observers.fixed_step import run_on_halves
from reobserve.observers.run import Run
from reobserve_papers.papers.eso import keys
from reobserve_papers.papers.eso.design import stored_design
from reobserve_papers.signals.series import Channel, Series


def build(job: keys.Job, design: Mapping[str, Any]) -> ExtendedStateObserver:
    """Construct the observer with the gains of a design, its period two steps of the plant."""
    system, certified = stored_design(job.plant, design)
    return ExtendedStateObserver(
        system, gains=certified.gains, sampling_period=2.0 * job.plant.step
    )


def estimate(job: keys.Job, plant: Series, design: Mapping[str, Any]) -> Series:
    """Estimate state and faults at every second sample of the record."""
    return estimates_on(build(job, design), plant, job.observer.initial_estimate)


def estimates_on(
    observer: ExtendedStateObserver, plant: Series, start: Sequence[float] | None = None
) -> Series:
    """The estimates of an observer at every second sample of the record (see `run_on`)."""
    run = run_on(observer, plant, start)
    return Series(
        plant.time[::2],
        {
            "state": Channel(run["state"], "rad/s, A"),
            "actuator_fault": Channel(run["actuator_fault"][:, 0], "V"),
            "sensor_fault": Channel(run["sensor_fault"][:, 0], "rad/s"),
        },
        plant.events,
    )


def run_on(
    observer: ExtendedStateObserver, plant: Series, estimate: Sequence[float] | None = None
) -> Run[EsoState]:
    """Run the observer on a record that has samples at half steps and limits from the left.

    It starts from ``estimate`` (x, xz, fa, fs) or from zeros; its filter starts from the same xz.
    """
    control, control_before = plant["control"][:, None], plant["control_before"][:, None]
    filtered = None if estimate is None else estimate[2:4]
    return run_on_halves(
        observer, plant["output"], control, start=observer.init(estimate, filtered=filtered),
        y_before=plant["output_before"], u_before=control_before,
    )  # fmt: skip
