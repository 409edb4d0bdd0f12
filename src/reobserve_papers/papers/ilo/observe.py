"""Stage observe: one observer on the record of one scenario."""

from __future__ import annotations

from typing import Any

from reobserve.observers.fixed_step import run_on_halves
from reobserve.observers.rigid_body_observer import RigidBodyObserver
from reobserve_papers.papers.ilo import keys
from reobserve_papers.papers.ilo.setup import build_observer, stride
from reobserve_papers.signals.series import Channel, Series


def estimate(job: keys.Job, plant: Series) -> Series:
    """Estimated rate [rad/s] and fault torque [N m] at the observer's samples.

    ``fault_before`` holds the limits from the left, which differ where the estimate jumps.
    """
    return observe(build_observer(job.plant, job.observer), job, plant)


def observe(observer: RigidBodyObserver, job: keys.Job, plant: Series) -> Series:
    """`estimate` with a constructed observer."""
    every = stride(job.plant, observer)
    measured = "measured" if "measured" in plant.channels else "rate"
    mine = job.observer

    def samples(name: str) -> Any:
        return plant[name][::every] if name in plant.channels else None

    run = run_on_halves(
        observer, samples(measured), samples("control"),
        start=observer.init(mine.initial_rate, fault=mine.initial_fault),
        y_before=samples(f"{measured}_before"), u_before=samples("control_before"),
    )  # fmt: skip
    channels = {
        "rate": Channel(run["rate"], run.units["rate"]),
        "fault": Channel(run["fault"], run.units["fault"]),
        "fault_before": Channel(run.before["fault"], run.units["fault"]),
    }
    return Series(plant.time[:: 2 * every], channels, plant.events)
