"""Source lines of public classes and functions, found without importing them."""

from __future__ import annotations

import ast
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import reobserve
from reobserve.core.errors import InputError, shown
from reobserve.core.files import read_text

_PACKAGE = Path(reobserve.__file__).parent

Definition = ast.ClassDef | ast.FunctionDef


@dataclass(frozen=True)
class Source:
    """A file and the line in it where a class or function begins; ``docstring`` may be empty."""

    file: Path
    line: int
    docstring: str


def find_source(name: str) -> Source:
    """Where `reobserve.package.module.Class.method` is defined.

    Raises
    ------
    InputError
        If nothing public of that name is defined there; what is imported there does not count.
    """
    _, *parts = name.split(".")
    path = _PACKAGE
    while parts and (path / parts[0]).is_dir():
        path /= parts.pop(0)
    if parts and path.joinpath(f"{parts[0]}.py").is_file():
        path /= f"{parts.pop(0)}.py"
    if not parts or path.is_dir() or any(part.startswith("_") for part in parts):
        raise InputError(shown(name), "is no public class or function")
    found: ast.Module | Definition = _module(path)
    for part in parts:
        inside = [one for one in found.body if isinstance(one, Definition) and one.name == part]
        if not inside:
            raise InputError(shown(name), f"there is no {shown(part)} in {path.name}")
        found = inside[0]
    assert isinstance(found, Definition)  # as there are parts
    return Source(path, found.lineno, ast.get_docstring(found) or "")


@cache
def _module(path: Path) -> ast.Module:
    return ast.parse(read_text(path))
