"""Docstrings for the site: names of both packages in backticks become links to their pages."""

from __future__ import annotations

import re
from typing import Any

from griffe import Class, Extension, Function, Module

_NAME = re.compile(r"(?<!`)`(reobserve(?:_papers)?(?:\.\w+)+)`(?!`)")
_SECTION = re.compile(r"^-{3,}$", re.MULTILINE)  # what is indented before the first one is code


class Links(Extension):
    """Links where the site has a page of a name; where it has none the name stays as it is."""

    def on_module(self, *, mod: Module, **_: Any) -> None:
        """Of a module."""
        _link(mod)

    def on_class(self, *, cls: Class, **_: Any) -> None:
        """Of a class."""
        _link(cls)

    def on_function(self, *, func: Function, **_: Any) -> None:
        """Of a function."""
        _link(func)


def _link(found: Module | Class | Function) -> None:
    if found.docstring:
        found.docstring.value = with_links(found.docstring.value)


def with_links(docstring: str) -> str:
    """The same with links for the names that it has in backticks, but for those within code."""
    section = _SECTION.search(docstring)
    end = section.start() if section else len(docstring)
    head = "".join(
        line if line.startswith("    ") else _linked(line)
        for line in docstring[:end].splitlines(keepends=True)
    )
    return head + _linked(docstring[end:])


def _linked(text: str) -> str:
    return _NAME.sub(r'<autoref optional identifier="\1">`\1`</autoref>', text)
