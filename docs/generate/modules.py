"""The list of all packages and modules, each with the first sentence of its docstring."""

from __future__ import annotations

import ast
from pathlib import Path

from docs.generate.api import first_sentence, modules
from docs.generate.markdown import code, heading, table, ticks


def packages_and_modules(source: Path) -> str:
    """All modules of the package at ``source``, by subpackage."""
    names = {path.relative_to(source).parts[0].removesuffix(".py") for path in source.rglob("*.py")}
    parts = []
    for package in sorted(name for name in names if not name.startswith("_")):
        listed = [
            (_module(name, source), ticks(first_sentence(ast.get_docstring(tree))))
            for name, tree in modules(source, package)
        ]
        over = heading(2, code(package), package)
        parts.append(f"{over}\n\n{table(('module', 'description'), listed)}")
    return "\n".join(parts)


def _module(name: str, source: Path) -> str:
    """The name below `reobserve`; that of a package ends with a slash."""
    _, *parts = name.split(".")
    folder = source.joinpath(*parts).is_dir()
    return code(f"{'.'.join(parts)}{'/' if folder else ''}")
