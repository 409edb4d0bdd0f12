"""Calls of the library's public classes and functions with valid arguments."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache

from . import examples, observers, parts
from .call import Call

__all__ = ["Call", "by_name", "calls"]


@cache
def calls() -> dict[str, Call]:
    """All calls by name."""
    return by_name([*examples.calls(), *parts.calls(), *observers.calls()])


def by_name(every: Iterable[Call]) -> dict[str, Call]:
    found: dict[str, Call] = {}
    for call in every:
        assert call.name not in found, call.name
        found[call.name] = call
    return found
