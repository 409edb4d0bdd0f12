"""What a record of the plant and estimates hold: the time axis, and units of the channels."""

from __future__ import annotations

from typing import Any

from reobserve.series import Shape

Settings = dict[str, Any]

EVENTS = ("faults",)

_FAULTS = {"actuator_fault": Shape("V"), "sensor_fault": Shape("rad/s")}


def axis(settings: Settings) -> tuple[float, float]:
    """Horizon and step of a record [s]."""
    return settings["plant"]["horizon"], settings["plant"]["step"]


def plant(_: Settings) -> dict[str, Shape]:
    """The channels of a record; all that jumps with its limits from the left."""
    jumping = {"output": Shape("rad/s, A", 2), "control": Shape("V"), **_FAULTS}
    before = {f"{name}_before": shape for name, shape in jumping.items()}
    return {"state": Shape("rad/s, A", 2), **jumping, **before, "reference": Shape("rad/s")}


def estimates(_: Settings) -> dict[str, Shape]:
    """The channels of an observer's estimates."""
    return {"state": Shape("rad/s, A", 2), **_FAULTS}
