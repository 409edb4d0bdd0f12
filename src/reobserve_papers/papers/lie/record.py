"""Channels and units of the record of the plant and of estimates."""

from __future__ import annotations

from reobserve_papers.parameters.job import Job
from reobserve_papers.signals.series import ChannelShape


def plant(job: Job) -> dict[str, ChannelShape]:
    """The channels of a record: as many components as the system has states and outputs."""
    return {
        "state": ChannelShape("1", job.plant.states),
        "output": ChannelShape("1", job.plant.outputs),
    }


def estimates(job: Job) -> dict[str, ChannelShape]:
    """The channels of an observer's estimates, coordinates of the transformed form only."""
    states = len(job.observer.initial_estimate)
    return {
        "state": ChannelShape("1", states),
        "coordinates": ChannelShape("1", states, optional=True),
    }
