"""State and fault observers, and their designs.

Each name in ``__init__.pyi`` is imported when it is first asked for: what one observer needs,
another may lack.
"""

from __future__ import annotations

from importlib import import_module
from itertools import pairwise
from typing import Any


def _homes() -> dict[str, str]:
    """The module of each public name, from ``from MODULE import NAME as NAME``."""
    with open(f"{__path__[0]}/__init__.pyi", encoding="utf-8") as stream:
        words = stream.read().split()
    homes, module = {}, ""
    for before, word in pairwise(words):
        if before == "from":
            module = word.removeprefix("reobserve.")
        elif word == "as":
            homes[before] = module
    return homes


_HOME = _homes()
__all__ = sorted(_HOME)  # noqa: PLE0605


def __getattr__(name: str) -> Any:
    if name in _HOME:
        value = globals()[name] = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
        return value
    if name == "__version__":
        return import_module("importlib.metadata").version("reobserve")
    from reobserve.core.errors import nearest

    raise AttributeError(f"module {__name__!r} has no attribute {name!r}{nearest(name, __all__)}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
