"""Stage observe: one observer on the record of one scenario."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from reobserve.observers.contract import OnDivergence
from reobserve.observers.fixed_step import run_on_halves
from reobserve.observers.normal_form import NormalFormObserver, NormalFormState
from reobserve.observers.run import Run
from reobserve_papers.papers.lie import keys
from reobserve_papers.papers.lie.setup import build_observer, stored_form
from reobserve_papers.signals.grid import stride
from reobserve_papers.signals.series import Channel, Series


def estimate(job: keys.Job, plant: Series, design: Mapping[str, Any]) -> Series:
    """Estimated state x^ at the ends of the observer's steps, and z of the transformed form."""
    mine = job.observer
    form = stored_form(job.plant, job.design, design)
    observer = build_observer(mine, form)
    run, every = observe(observer, mine.initial_estimate, job.plant, plant)
    channels = {name: Channel(rows, "1") for name, rows in run.estimates.items()}
    return Series(plant.time[:: 2 * every], channels)


def observe(
    observer: NormalFormObserver,
    initial: Any,
    plant_settings: keys.Plant,
    plant: Series,
    on_divergence: OnDivergence = "raise",
) -> tuple[Run[NormalFormState], int]:
    """Run an observer on a record, and return the plant samples in half of its steps, too."""
    every = stride(plant_settings.step, observer.sampling_period)
    output = plant["output"][::every]
    start = observer.init(initial)
    return run_on_halves(observer, output, start=start, on_divergence=on_divergence), every
