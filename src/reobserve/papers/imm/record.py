"""What a record of the plant and estimates hold: the time axis, and units of the channels."""

from __future__ import annotations

from typing import Any

from reobserve.papers.imm.setup import MODES, UNITS
from reobserve.plants.hydraulic_actuator import MOTION
from reobserve.series import Shape

Settings = dict[str, Any]

EVENTS = ("fault",)


def axis(settings: Settings) -> tuple[float, float]:
    """Horizon and sampling period of a record [s]."""
    return settings["plant"]["horizon"], settings["scenario"]["period"]


def plant(_: Settings) -> dict[str, Shape]:
    """The channels of a record."""
    motion = Shape(", ".join(UNITS[name] for name in MOTION), len(MOTION))
    return {"motion": motion, "measured": motion, "input": Shape("V"), "mode": Shape("1")}


def estimates(_: Settings) -> dict[str, Shape]:
    """The channels of a bank's estimates: position and velocity where they are measured."""
    return {
        "probability": Shape("1", len(MODES)),
        **{name: Shape(UNITS[name], optional=True) for name in ("position", "velocity")},
        "outside": Shape("1", optional=True),
    }
