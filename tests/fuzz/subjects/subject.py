"""A call with valid arguments."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Subject:
    """``call(*arguments)`` must be accepted; ``name`` begins with module and function."""

    name: str
    call: Callable[..., object]
    arguments: tuple[Any, ...]


def subject(function: Callable[..., object], *arguments: Any, of: object = None) -> Subject:
    """A call of a function or class, or of a method of the object ``of``."""
    if of is not None:
        return Subject(f"{_name(type(of))}.{function.__name__}", function, arguments)
    return Subject(_name(function), function, arguments)


def _name(thing: Any) -> str:
    module = thing.__module__.removeprefix("reobserve.")
    return f"{module}.{thing.__qualname__}"
