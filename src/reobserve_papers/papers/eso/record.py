"""Channels of a record of the plant and of estimates, with their units."""

from __future__ import annotations

from reobserve_papers.parameters.job import Job
from reobserve_papers.signals.series import Shape

EVENTS = ("faults",)

_FAULTS = {"actuator_fault": Shape("V"), "sensor_fault": Shape("rad/s")}


def plant(_: Job) -> dict[str, Shape]:
    """Channels of a record; channels with jumps also have their limits from the left."""
    jumping = {"output": Shape("rad/s, A", 2), "control": Shape("V"), **_FAULTS}
    before = {f"{name}_before": shape for name, shape in jumping.items()}
    return {"state": Shape("rad/s, A", 2), **jumping, **before, "reference": Shape("rad/s")}


def estimates(_: Job) -> dict[str, Shape]:
    """Channels of an observer's estimates."""
    return {"state": Shape("rad/s, A", 2), **_FAULTS}
