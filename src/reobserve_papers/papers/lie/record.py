"""Channels and units of the record of the plant and of estimates."""

from __future__ import annotations

from reobserve_papers.parameters.job import Job
from reobserve_papers.signals.series import Shape


def plant(job: Job) -> dict[str, Shape]:
    """The channels of a record: as many components as the system has states and outputs."""
    return {"state": Shape("1", job.plant.states), "output": Shape("1", job.plant.outputs)}


def estimates(job: Job) -> dict[str, Shape]:
    """The channels of an observer's estimates; coordinates of the transformed form only."""
    states = len(job.observer.initial_estimate)
    return {"state": Shape("1", states), "coordinates": Shape("1", states, optional=True)}
