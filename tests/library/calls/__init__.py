"""Calls of the library's public classes and functions with valid arguments."""

from __future__ import annotations

from functools import cache

from . import observers, parts
from .call import Call

__all__ = ["Call", "calls"]


@cache
def calls() -> dict[str, Call]:
    """All calls by name."""
    every = [*parts.calls(), *observers.calls()]
    found = {call.name: call for call in every}
    assert len(found) == len(every)
    return found
