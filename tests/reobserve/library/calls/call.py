"""A valid call, and short ways to state one."""

from __future__ import annotations

import pkgutil
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

MISSING = ("not a number",)  # a measurement may be missing
COMPLEX = ("complex",)  # poles may be


@dataclass(frozen=True)
class Call:
    """``function(*arguments)``, a valid call; ``name`` begins with module and function.

    ``takes`` are the kinds of odd numbers that are allowed, named as in
    `tests.reobserve.bad_input.odd`.
    """

    name: str
    function: Callable[..., object]
    arguments: tuple[Any, ...]
    takes: tuple[str, ...] = ()


def called(
    table: Mapping[str, tuple[Any, ...]], takes: tuple[str, ...] = (), package: str = "reobserve"
) -> Iterator[Call]:
    """Calls of functions by their names in a package."""
    for name, arguments in table.items():
        yield Call(name, pkgutil.resolve_name(f"{package}.{name}"), arguments, takes)


def method(owner: object, method: str, *arguments: Any, takes: tuple[str, ...] = ()) -> Call:
    """A call of a method of an object."""
    kind = type(owner)
    name = f"{kind.__module__.partition('.')[2]}.{kind.__qualname__}.{method}"
    return Call(name, getattr(owner, method), arguments, takes)
