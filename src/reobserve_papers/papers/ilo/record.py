"""Channels of a record of the plant and of estimates, with their units."""

from __future__ import annotations

from reobserve_papers.parameters.job import Job
from reobserve_papers.signals.series import Shape

EVENTS = ("onsets",)


def plant(_: Job) -> dict[str, Shape]:
    """Channels of a record; channels with jumps also have their limits from the left."""
    return {
        "rate": Shape("rad/s", 3),
        **dict.fromkeys(("measured", "measured_before"), Shape("rad/s", 3, optional=True)),
        **dict.fromkeys(("control", "fault"), Shape("N m", 3)),
        **dict.fromkeys(("control_before", "fault_before"), Shape("N m", 3, optional=True)),
    }


def estimates(_: Job) -> dict[str, Shape]:
    """Channels of an observer's estimates."""
    return {"rate": Shape("rad/s", 3), **dict.fromkeys(("fault", "fault_before"), Shape("N m", 3))}
