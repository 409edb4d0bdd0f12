"""A valid call, and short ways to state one."""

from __future__ import annotations

import inspect
import pkgutil
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

MISSING = ("not a number",)  # a measurement may be missing
COMPLEX = ("complex",)  # poles may be
_INHERITED = ("sampling_period", "gate", "outliers", "noise_memory")  # last, where by position


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
        function = by_position(pkgutil.resolve_name(f"{package}.{name}"), len(arguments))
        yield Call(name, function, arguments, takes)


def by_position(function: Callable[..., Any], count: int) -> Callable[..., Any]:
    """The function of its first ``count`` arguments, where some of them go by name only."""
    every = inspect.signature(function).parameters
    first = [name for name, one in every.items() if one.kind is one.POSITIONAL_OR_KEYWORD]
    by_name = [name for name, one in every.items() if one.kind is one.KEYWORD_ONLY]
    names = [*first, *sorted(by_name, key=_INHERITED.__contains__)][:count]
    if names == first[:count]:
        return function

    def call(*arguments: Any) -> Any:
        return function(**dict(zip(names, arguments, strict=True)))

    bare: Any = {
        "kind": inspect.Parameter.POSITIONAL_OR_KEYWORD,
        "default": inspect.Parameter.empty,
    }
    signature = inspect.Signature([every[name].replace(**bare) for name in names])
    call.__signature__ = signature  # type: ignore[attr-defined]
    return call


def method(owner: object, method: str, *arguments: Any, takes: tuple[str, ...] = ()) -> Call:
    """A call of a method of an object."""
    kind = type(owner)
    name = f"{kind.__module__.partition('.')[2]}.{kind.__qualname__}.{method}"
    return Call(name, by_position(getattr(owner, method), len(arguments)), arguments, takes)
