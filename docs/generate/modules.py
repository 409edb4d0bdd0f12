"""The list of all packages and modules, each with the first sentence of its docstring."""

from __future__ import annotations

import ast
from pathlib import Path

from docs.generate.api import first_sentence, modules
from docs.generate.markdown import code, heading, ticks


def packages_and_modules(*sources: Path) -> str:
    """All modules of the packages at ``sources``, by part."""
    found = []
    for source in sources:
        for part in sorted(path.parent.name for path in source.glob("*/__init__.py")):
            listed = "".join(
                f"- {_module(name, source)}: {ticks(first_sentence(ast.get_docstring(tree)))}\n"
                for name, tree in modules(source, part)
            )
            whole = f"{source.name}.{part}"
            found.append(f"{heading(2, code(whole), whole)}\n\n{listed}")
    return "\n".join(found)


def _module(name: str, source: Path) -> str:
    """The name below its package; that of a folder ends with a slash."""
    _, *parts = name.split(".")
    folder = source.joinpath(*parts).is_dir()
    return code(f"{'.'.join(parts)}{'/' if folder else ''}")
