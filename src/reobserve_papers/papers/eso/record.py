"""Channels of a record of the plant and of estimates, with their units."""

from __future__ import annotations

from reobserve_papers.parameters.job import Job
from reobserve_papers.signals.series import ChannelShape

EVENTS = ("faults",)

_FAULTS = {"actuator_fault": ChannelShape("V"), "sensor_fault": ChannelShape("rad/s")}


def plant(_: Job) -> dict[str, ChannelShape]:
    """Channels of a record, those with jumps also with their limits from the left."""
    jumping = {"output": ChannelShape("rad/s, A", 2), "control": ChannelShape("V"), **_FAULTS}
    before = {f"{name}_before": shape for name, shape in jumping.items()}
    return {
        "state": ChannelShape("rad/s, A", 2),
        **jumping,
        **before,
        "reference": ChannelShape("rad/s"),
    }


def estimates(_: Job) -> dict[str, ChannelShape]:
    """Channels of an observer's estimates."""
    return {"state": ChannelShape("rad/s, A", 2), **_FAULTS}
