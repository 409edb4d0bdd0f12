"""Differences beside the numbers: commit, machine, packages, parameters since the acceptance."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from reobserve_papers.golden.number_files import read_parameters, values_by_key
from reobserve_papers.parameters.config import known_papers
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.report.environment import environment, package_versions

_PACKAGES = ("numpy", "scipy", "numba", "matplotlib", "cvxpy", "clarabel")
_MOST = 5  # parameters of a paper


def differences(project: Path, papers: Iterable[str]) -> list[str]:
    """Sentences: where this was computed, and parameters that were others at the acceptance."""
    here, installed = environment(project), package_versions()
    versions = ", ".join(f"{name} {installed[name]}" for name in _PACKAGES if name in installed)
    commit, comma, changes = here.get("commit", "no commit").partition(",")
    said = [f"computed at {commit[:12]}{comma}{changes} on {here.get('processor', '')}"]
    said.append(f"with {versions}")
    for paper in sorted({*papers} & {*known_papers(project)}):
        changed = list(_changed(project, paper))
        more = [f"and {len(changed) - _MOST} more"] if len(changed) > _MOST else []
        if changed:
            said.append(f"{paper}, since the acceptance: {'; '.join([*changed[:_MOST], *more])}")
    return said


def _changed(project: Path, paper: str) -> Iterator[str]:
    """Values of the parameter file that were others when the golden numbers were written."""
    before = read_parameters(project, paper)
    now = values_by_key(Parameters.load(project, paper))
    for key in dict.fromkeys([*before, *now]):
        if before.get(key) != now.get(key) and before:
            yield f"{key} {before.get(key, 'none')} -> {now.get(key, 'none')}"
