"""A call with valid arguments."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Subject:
    """``call(*arguments)`` must be accepted; ``name`` begins with module and function.

    ``takes`` are odd numbers that mean something here, in the words of `classes.arguments`.
    """

    name: str
    call: Callable[..., object]
    arguments: tuple[Any, ...]
    takes: tuple[str, ...] = ()


def subject(
    function: Callable[..., object],
    *arguments: Any,
    of: object = None,
    takes: tuple[str, ...] = (),
) -> Subject:
    """A call of a function or class, or of a method of the object ``of``."""
    if of is not None:
        return Subject(f"{_name(type(of))}.{function.__name__}", function, arguments, takes)
    return Subject(_name(function), function, arguments, takes)


def _name(thing: Any) -> str:
    module = thing.__module__.removeprefix("reobserve.")
    return f"{module}.{thing.__qualname__}"
