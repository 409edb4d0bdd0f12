"""Channels of a record of the plant and of estimates, with their units."""

from __future__ import annotations

from reobserve_papers.parameters.job import Job
from reobserve_papers.signals.series import ChannelShape

EVENTS = ("onsets",)


def plant(_: Job) -> dict[str, ChannelShape]:
    """Channels of a record, those with jumps also with their limits from the left."""
    return {
        "rate": ChannelShape("rad/s", 3),
        **dict.fromkeys(("measured", "measured_before"), ChannelShape("rad/s", 3, optional=True)),
        **dict.fromkeys(("control", "fault"), ChannelShape("N m", 3)),
        **dict.fromkeys(("control_before", "fault_before"), ChannelShape("N m", 3, optional=True)),
    }


def estimates(_: Job) -> dict[str, ChannelShape]:
    """Channels of an observer's estimates."""
    return {
        "rate": ChannelShape("rad/s", 3),
        **dict.fromkeys(("fault", "fault_before"), ChannelShape("N m", 3)),
    }
