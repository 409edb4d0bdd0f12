"""Import closures: the modules that a module imports, directly or not, and a digest of them.

They are read from the source, imports inside functions included, so that they can be known before
anything is imported.
"""

from __future__ import annotations

import ast
import hashlib
import os
import re
import sys
from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import cache
from importlib.util import find_spec
from pathlib import Path


def import_closure(modules: Iterable[str]) -> list[str]:
    """All modules that ``modules`` import, directly or not, themselves included.

    Of other packages than this one, only those count that one of ``modules`` belongs to, and those
    beside them unless they are installed. Names under ``if TYPE_CHECKING`` are left out: they are
    not imported when the code runs.
    """
    waiting = list(modules)
    for module in waiting:
        if source(module) is None:
            raise ModuleNotFoundError(f"there is no module {module}", name=module)
    packages = frozenset(_package(module) for module in (__name__, *waiting))
    found: set[str] = set()
    while waiting:
        module = waiting.pop()
        if module not in found:
            found.add(module)
            waiting.extend(_imports(module, packages))
    return sorted(found)


def closure_digest(modules: Iterable[str]) -> str:
    """A short hash of the source of ``modules`` and of everything that they import from here.

    Each file counts as it was when this process first asked.
    """
    whole = hashlib.sha256()
    for module in import_closure(modules):
        whole.update(module.encode())
        whole.update(_read(module)[0])
    return whole.hexdigest()[:16]


@cache
def source(module: str) -> Path | None:
    """The file of a module, found without importing it, or None if there is none."""
    top, *rest = module.split(".")
    one = sys.modules.get(top)
    file, folders = getattr(one, "__file__", None), getattr(one, "__path__", ())
    if one is None:
        with suppress(ImportError, ValueError):
            spec = find_spec(top)
            file, folders = spec and spec.origin, spec and spec.submodule_search_locations
    bases = [os.path.join(folder, *rest) for folder in folders or ()]
    paths = [path for base in bases for path in (f"{base}/__init__.py", f"{base}.py")]
    if file and not rest:
        paths.append(file)
    return next((Path(path) for path in paths if os.path.isfile(path)), None)


def _package(module: str) -> str:
    return module.partition(".")[0]


# Found in the text of a module beside the library, ten times faster than by parsing it: each
# process does this for all that it compiles. A test compares what they find with what Python's own
# parser does; modules of users, who may write imports in other ways, are parsed.
_TYPES_ONLY = re.compile(
    r"^([ \t]*)if TYPE_CHECKING:.*\n(?:(?:\1[ \t]+.*|[ \t]*)\n)*", re.MULTILINE
)
_IMPORT = re.compile(
    r"^[ \t]*(?:from[ \t]+(\.*[\w.]*)[ \t]+)?import[ \t]+(\([^)]*\)|[^#\n]+)", re.MULTILINE
)


@cache
def _imports(module: str, packages: frozenset[str]) -> tuple[str, ...]:
    """The modules of packages that a module imports, and the packages that it is in."""
    parents = {module[:k] for k, letter in enumerate(module) if letter == "."}
    names = parents.union(_read(module)[1])
    return tuple(name for name in names if _counts(_package(name), packages) and source(name))


@cache
def _counts(package: str, packages: frozenset[str]) -> bool:
    """True if a package is one of ``packages``, or beside one in a folder of source."""
    place = _place(package)
    beside = place is not None and place.name not in ("site-packages", "dist-packages")
    return package in packages or (beside and place in map(_place, packages))


def _place(package: str) -> Path | None:
    path = source(package)
    return path and path.parents[path.name == "__init__.py"]


@cache
def _read(module: str) -> tuple[bytes, tuple[str, ...]]:
    """The digest of the source of a module, and the names that it imports."""
    path = source(module)
    assert path is not None
    content = path.read_bytes()
    names = _names(content.decode(errors="replace"), module, path)
    return hashlib.sha256(content).digest(), tuple(names)


def _names(text: str, module: str, path: Path) -> Iterator[str]:
    """The modules that a module may import when it runs, in full."""
    spec = getattr(sys.modules.get(module), "__spec__", None)  # of `python -m package.module`
    whole = (spec.name if module == "__main__" and spec else module).split(".")
    parents = whole if path.name == "__init__.py" else whole[:-1]
    ours = _place(whole[0]) == _place(_package(__name__))
    for origin, names in _written(text) if ours else _parsed(text):
        if not origin:
            yield from names
            continue
        base = origin.lstrip(".")
        if level := len(origin) - len(base):
            kept = parents[: len(parents) - level + 1]
            base = ".".join((*kept, base) if base else kept)
        yield base
        yield from (f"{base}.{name}" for name in names)


def _written(text: str) -> Iterator[tuple[str, list[str]]]:
    """Imports of a module of this project when it runs: from where, and the names."""
    if "TYPE_CHECKING" in text:
        text = _TYPES_ONLY.sub("", text)
    for origin, listed in _IMPORT.findall(text):
        parts = re.sub(r"#.*", "", listed).strip("()").split(",")
        yield origin, [name for part in parts if (name := part.split(" as ")[0].strip())]


def _parsed(text: str) -> Iterator[tuple[str, list[str]]]:
    """Imports of any module, and none of one that Python cannot read."""
    with suppress(SyntaxError, ValueError):
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Import):
                yield "", [one.name for one in node.names]
            elif isinstance(node, ast.ImportFrom):
                yield "." * node.level + (node.module or ""), [one.name for one in node.names]
