"""Differences beside the numbers: commit, machine, packages, parameters since the acceptance."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from reobserve_papers.parameters.config import known_papers
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.report.environment import environment, git_output, package_versions

_PACKAGES = ("numpy", "scipy", "numba", "matplotlib", "cvxpy", "clarabel")
_MOST = 5  # parameters of a paper


def differences(project: Path, papers: Iterable[str]) -> list[str]:
    """Sentences: where this was computed, and parameters that were others at the acceptance."""
    here, installed = environment(project), package_versions()
    versions = ", ".join(f"{name} {installed[name]}" for name in _PACKAGES if name in installed)
    said = [f"computed at {here.get('commit', 'no commit')[:12]} on {here.get('processor', '')}"]
    said.append(f"with {versions}")
    for paper in sorted({*papers} & {*known_papers(project)}):
        changed = list(_changed(project, paper))
        more = [f"and {len(changed) - _MOST} more"] if len(changed) > _MOST else []
        if changed:
            said.append(f"{paper}, since the acceptance: {'; '.join([*changed[:_MOST], *more])}")
    return said


def _changed(project: Path, paper: str) -> Iterator[str]:
    """Values of the parameter file that were others when the golden numbers were written."""
    import yaml

    path = f"config/papers/{paper}.yaml"
    commit = git_output(project, "log", "-1", "--format=%H", "--", f"tests/golden/{paper}")
    before = _values(paper, yaml.safe_load(git_output(project, "show", f"{commit}:{path}")))
    now = _values(paper, yaml.safe_load((project / path).read_text(encoding="utf-8")))
    for key in dict.fromkeys([*before, *now]):
        if before.get(key) != now.get(key) and before:
            yield f"{key} {before.get(key, 'none')} -> {now.get(key, 'none')}"


def _values(paper: str, tree: Any) -> dict[str, Any]:
    """Values by key, or the keys of those that they are the same as."""
    entries = Parameters(paper, tree or {}, 0).entries()
    return {key: entry.get("value", entry.get("same_as")) for key, entry in entries}
