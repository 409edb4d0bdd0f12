"""Provenance of a result: a digest of the code that made it, and versions of packages.

The import closure of a stage is read from the source text, imports inside functions included,
so that it can be known before anything runs and hashed into the decision what is stale.
"""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterable, Iterator
from functools import cache
from importlib import metadata
from pathlib import Path

from reobserve.replication.parameters.names import paper_part

_PACKAGE = "reobserve"

# Packages whose version can move a number or a picture.
_PACKAGES = ("numpy", "scipy", "numba", "pyarrow", "matplotlib", "cvxpy", "clarabel", "sympy")


# What a job runs that evaluates figures in its own process.
_EVALUATED = ("plant", "design", "observe", "study", "study_rows", "theory", "metrics")

# What checks a plant's record by what the paper says of it and of its keys.
_CHECKED = ("observe", "study", "search", "metrics", "plot")

# What writes or reads the table of a study.
_STUDIED = ("study", "metrics", "plot")


def stage_modules(stage: str, paper: str) -> list[str]:
    """The modules a job of a stage starts from: the command line, the stage, the paper's part."""
    parts = _EVALUATED if stage in ("draw", "robustness") else (stage,)
    if stage in _CHECKED:
        parts = (*parts, "keys", "record")
    if stage in _STUDIED:
        parts = (*parts, "study_rows")
    return [
        f"{_PACKAGE}.__main__",
        f"{_PACKAGE}.cli.stages.{stage}",
        *(paper_part(paper, part) for part in parts),
    ]


def import_closure(modules: Iterable[str]) -> list[str]:
    """All modules of this package that ``modules`` import, directly or not, themselves included.

    Names under ``if TYPE_CHECKING`` are left out: they are not imported when the code runs.
    """
    found: set[str] = set()
    waiting = list(modules)
    while waiting:
        module = waiting.pop()
        if module in found or _source(module) is None:
            continue
        found.add(module)
        if "." in module:
            waiting.append(module.rpartition(".")[0])
        waiting.extend(_imports(module))
    return sorted(found)


@cache
def code_digest(stage: str, paper: str) -> str:
    """A short hash of the source of everything that a stage of a paper imports from here.

    As it was when this process first asked, so that all jobs of a build get the same.
    """
    return closure_digest(stage_modules(stage, paper))


def closure_digest(modules: Iterable[str]) -> str:
    """A short hash of the source of ``modules`` and of everything that they import from here."""
    whole = hashlib.sha256()
    for module in import_closure(modules):
        path = _source(module)
        assert path is not None
        whole.update(module.encode())
        whole.update(hashlib.sha256(path.read_bytes()).digest())
    return whole.hexdigest()[:16]


def files_digest(*places: str) -> str:
    """A short hash of files and of all files in folders, but for hidden ones."""
    found = {path for place in map(Path, places) for path in (place, *place.rglob("*.*"))}
    whole = hashlib.sha256()
    for path in sorted(found):
        if path.is_file() and not path.name.startswith("."):
            whole.update(str(path).encode())
            whole.update(hashlib.sha256(path.read_bytes()).digest())
    return whole.hexdigest()[:16]


@cache
def versions() -> dict[str, str]:
    """The versions of the packages that decide numbers and pictures."""
    return {name: metadata.version(name) for name in _PACKAGES}


@cache
def _source(module: str) -> Path | None:
    """The file of a module of this package; None for anything else."""
    head, *rest = module.split(".")
    if head != _PACKAGE:
        return None
    base = Path(__file__).parents[1].joinpath(*rest)
    for path in (base / "__init__.py", base.with_suffix(".py")):
        if path.is_file():
            return path
    return None


@cache
def _imports(module: str) -> tuple[str, ...]:
    path = _source(module)
    assert path is not None
    tree = ast.parse(path.read_bytes())
    return tuple(name for node in _running(tree) for name in _names(node, module, path))


def _running(node: ast.AST) -> Iterator[ast.stmt]:
    """The statements below ``node`` that can run; imports are statements, so no expressions."""
    for block in ("body", "orelse", "finalbody", "handlers", "cases"):
        for child in getattr(node, block, ()):
            if isinstance(child, ast.If) and getattr(child.test, "id", "") == "TYPE_CHECKING":
                yield from _running(ast.Module(child.orelse, []))
                continue
            if isinstance(child, ast.stmt):
                yield child
            yield from _running(child)


def _names(node: ast.stmt, module: str, path: Path) -> Iterator[str]:
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
    elif isinstance(node, ast.ImportFrom):
        base = node.module or ""
        if node.level:
            parents = module.split(".") if path.name == "__init__.py" else module.split(".")[:-1]
            kept = parents[: len(parents) - node.level + 1]
            base = ".".join((*kept, base) if base else kept)
        yield base
        yield from (f"{base}.{alias.name}" for alias in node.names)
