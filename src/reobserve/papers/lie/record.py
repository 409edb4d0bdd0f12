"""What a record of the plant and estimates hold: the time axis, and units of the channels."""

from __future__ import annotations

from typing import Any

from reobserve.series import Shape

Settings = dict[str, Any]

EVENTS: tuple[str, ...] = ()


def axis(settings: Settings) -> tuple[float, float]:
    """Horizon and step of a record [s]."""
    return settings["plant"]["horizon"], settings["plant"]["step"]


def plant(settings: Settings) -> dict[str, Shape]:
    """The channels of a record: as many components as the system has states and outputs."""
    outputs = max(term["component"] for term in settings["plant"]["output"])
    return {"state": Shape("1", _states(settings)), "output": Shape("1", outputs)}


def estimates(settings: Settings) -> dict[str, Shape]:
    """The channels of an observer's estimates; coordinates of the transformed form only."""
    states = len(settings["observer"]["initial_estimate"])
    return {"state": Shape("1", states), "coordinates": Shape("1", states, optional=True)}


def _states(settings: Settings) -> int:
    return len(settings["plant"]["dynamics"][0]["powers"])
