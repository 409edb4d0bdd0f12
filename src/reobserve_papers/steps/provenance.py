"""Provenance of a result: a digest of the code that made it, and versions of packages."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

from reobserve.core.import_closure import closure_digest, source
from reobserve_papers.parameters.names import paper_part
from reobserve_papers.parameters.step_kinds import KINDS

# Packages whose version can move a number or a figure.
_PACKAGES = ("numpy", "scipy", "numba", "pyarrow", "matplotlib", "cvxpy", "clarabel", "sympy")


JOB = "reobserve_papers.steps.build_job"

# What a job runs that evaluates figures in its own process.
_EVALUATED = ("plant", "design", "observe", "study", "study_rows", "theory", "metrics")

# What writes or reads the table of a study.
_STUDIED = ("study", *(step for step, kind in KINDS.items() if "study" in kind.results))


def stage_modules(stage: str, package: str) -> list[str]:
    """The modules a job of a stage starts from: the command line, the stage, the paper's parts.

    ``package`` is that of the paper; parts that only some papers have may be missing in it.
    """
    needed, optional = [stage, "keys"], []
    if stage == "robustness":
        needed, optional = ["keys"], [*_EVALUATED]
    if stage in _STUDIED:
        optional += ["study_rows"]
    modules = [paper_part(package, part) for part in optional]
    return [
        "reobserve_papers.__main__",
        "reobserve_papers.cli.stage_commands",
        JOB if stage in KINDS and stage != "plot" else f"reobserve_papers.cli.stages.{stage}",
        *(paper_part(package, part) for part in needed),
        *(module for module in modules if source(module) is not None),
    ]


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


def files_digest(*places: str) -> str:
    """A short hash of files and of all files in folders, but for hidden ones."""
    paths = {path for place in map(Path, places) for path in (place, *place.rglob("*.*"))}
    whole = hashlib.sha256()
    for path in sorted(paths):
        if path.is_file() and not path.name.startswith("."):
            whole.update(str(path).encode())
            whole.update(hashlib.sha256(path.read_bytes()).digest())
    return whole.hexdigest()[:16]


@cache
def versions() -> dict[str, str]:
    """The versions of the packages that decide numbers and figures."""
    from importlib import metadata

    return {name: metadata.version(name) for name in _PACKAGES}
