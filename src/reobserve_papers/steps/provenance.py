"""Provenance of a result: a digest of the code that made it, and versions of packages.

The import closure of a stage is read from the source text, imports inside functions included,
so that it can be known before anything runs and hashed into the decision what is stale.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Iterator
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from reobserve_papers.parameters.names import paper_part
from reobserve_papers.parameters.step_kinds import KINDS

# The library and the papers: the top-level packages of this project.
_OURS = ("reobserve", "reobserve_papers")

# Packages whose version can move a number or a figure.
_PACKAGES = ("numpy", "scipy", "numba", "pyarrow", "matplotlib", "cvxpy", "clarabel", "sympy")


# What a job runs that evaluates figures in its own process.
_EVALUATED = ("plant", "design", "observe", "study", "study_rows", "theory", "metrics")

# What writes or reads the table of a study.
_STUDIED = ("study", *(step for step, kind in KINDS.items() if "study" in kind.results))


def stage_modules(stage: str, package: str) -> list[str]:
    """The modules a job of a stage starts from: the command line, the stage, the paper's parts.

    ``package`` is that of the paper; parts that only some papers have may be missing in it.
    """
    needed, optional = [stage, "keys"], []
    if stage in ("sample", "robustness"):
        needed, optional = ["keys"], [*_EVALUATED]
    if stage in _STUDIED:
        optional += ["study_rows"]
    found = [paper_part(package, part) for part in optional]
    return [
        "reobserve_papers.__main__",
        "reobserve_papers.cli.stage_commands",
        f"reobserve_papers.cli.stages.{stage}",
        *(paper_part(package, part) for part in needed),
        *(module for module in found if _source(module) is not None),
    ]


def import_closure(modules: Iterable[str]) -> list[str]:
    """All modules of this project that ``modules`` import, directly or not, themselves included.

    Of other packages, only those count that one of ``modules`` belongs to: a paper's own. Names
    under ``if TYPE_CHECKING`` are left out: they are not imported when the code runs.

    Raises
    ------
    ModuleNotFoundError
        If one of ``modules`` does not exist: a digest without it would never change.
    """
    waiting = list(modules)
    ours = {*_OURS, *(module.partition(".")[0] for module in waiting)}
    for module in waiting:
        if _source(module) is None:
            raise ModuleNotFoundError(f"there is no module {module}", name=module)
    found: set[str] = set()
    while waiting:
        module = waiting.pop()
        if module in found or module.partition(".")[0] not in ours or _source(module) is None:
            continue
        found.add(module)
        if "." in module:
            waiting.append(module.rpartition(".")[0])
        waiting.extend(_imports(module))
    return sorted(found)


@cache
def code_digest(stage: str, package: str) -> str:
    """A short hash of the source of everything that a stage of the paper in a package imports.

    As it was when this process first asked, so that all jobs of a build get the same.
    """
    return closure_digest(stage_modules(stage, package))


@cache
def shared_digest(module: str) -> str:
    """The same of a module that serves all papers."""
    return closure_digest(["reobserve_papers.__main__", module])


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
    """The versions of the packages that decide numbers and figures."""
    from importlib import metadata

    return {name: metadata.version(name) for name in _PACKAGES}


@cache
def _source(module: str) -> Path | None:
    """The file of a module, found without importing it, or None if there is none."""
    top, *rest = module.split(".")
    spec = find_spec(top)
    if spec is None:
        return None
    if not spec.submodule_search_locations:
        return Path(spec.origin) if spec.origin and not rest else None
    for folder in spec.submodule_search_locations:
        base = Path(folder, *rest)
        for path in (base / "__init__.py", base.with_name(f"{base.name}.py")):
            if path.is_file():
                return path
    return None


# Found in the text of a module, ten times faster than by parsing it: each job does this for all
# that it imports. A test compares what they find with what Python's own parser does.
_TYPES_ONLY = re.compile(
    r"^([ \t]*)if TYPE_CHECKING:.*\n(?:(?:\1[ \t]+.*|[ \t]*)\n)*", re.MULTILINE
)
_IMPORT = re.compile(
    r"^[ \t]*(?:from[ \t]+(\.*[\w.]*)[ \t]+)?import[ \t]+(\([^)]*\)|[^#\n]+)", re.MULTILINE
)


@cache
def _imports(module: str) -> tuple[str, ...]:
    path = _source(module)
    assert path is not None
    return tuple(_names(path.read_text(encoding="utf-8"), module, path))


def _names(text: str, module: str, path: Path) -> Iterator[str]:
    """The names that a module imports when it runs, without those under ``if TYPE_CHECKING``."""
    for origin, listed in _IMPORT.findall(_TYPES_ONLY.sub("", text)):
        parts = re.sub(r"#.*", "", listed).strip("()").split(",")
        names = [name for part in parts if (name := part.split(" as ")[0].strip())]
        if not origin:
            yield from names
            continue
        base = origin.lstrip(".")
        if level := len(origin) - len(base):
            parents = module.split(".") if path.name == "__init__.py" else module.split(".")[:-1]
            kept = parents[: len(parents) - level + 1]
            base = ".".join((*kept, base) if base else kept)
        yield base
        yield from (f"{base}.{name}" for name in names)
