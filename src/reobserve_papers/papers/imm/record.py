"""The time axis of records, and the units of the channels of plant and estimates."""

from __future__ import annotations

from reobserve_papers.papers.imm import keys
from reobserve_papers.papers.imm.keys import MODES
from reobserve_papers.signals.series import ChannelShape

EVENTS = ("fault",)

# The components of the motion; y is the unit of the velocity, which the paper does not state.
UNITS = {"position": "y s", "velocity": "y", "acceleration": "y/s", "jerk": "y/s^2"}


def axis(job: keys.Job) -> tuple[float, float]:
    """Horizon and sampling period of a record [s]."""
    return job.plant.horizon, job.scenario.period


def plant(job: keys.Job) -> dict[str, ChannelShape]:
    """The channels of a record."""
    motion = ChannelShape(", ".join(UNITS.values()), len(UNITS))
    return {
        "motion": motion,
        "measured": motion,
        "input": ChannelShape(job.scenario.input_unit),
        "mode": ChannelShape("1"),
    }


def estimates(_: keys.Job) -> dict[str, ChannelShape]:
    """The channels of a bank's estimates."""
    return {
        "probability": ChannelShape("1", len(MODES)),
        "velocity": ChannelShape(UNITS["velocity"]),
        "saturated": ChannelShape("1", optional=True),
        "chattering": ChannelShape("1", optional=True),
        "chattering_correction": ChannelShape(UNITS["velocity"], optional=True),
    }
