"""Differences beside the numbers: commit, machine, packages, parameters since the acceptance."""

from __future__ import annotations

import subprocess
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from reobserve_papers.parameters.config import known_papers
from reobserve_papers.parameters.overrides import is_entry
from reobserve_papers.report.environment import environment, package_versions

_PACKAGES = ("numpy", "scipy", "numba", "matplotlib", "cvxpy", "clarabel")
_MOST = 5  # parameters of a paper


def differences(project: Path, papers: Iterable[str]) -> list[str]:
    """Sentences: where this was computed, and parameters that were others at the acceptance."""
    here, found = environment(project), package_versions()
    versions = ", ".join(f"{name} {found[name]}" for name in _PACKAGES if name in found)
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
    commit = _git(project, "log", "-1", "--format=%H", "--", f"tests/golden/{paper}")
    before = _values(yaml.safe_load(_git(project, "show", f"{commit}:{path}") or "{}"))
    now = _values(yaml.safe_load((project / path).read_text(encoding="utf-8")) or {})
    for key in dict.fromkeys([*before, *now]):
        if before.get(key) != now.get(key) and before:
            yield f"{key} {before.get(key, 'none')} -> {now.get(key, 'none')}"


def _values(branch: Any, place: str = "") -> dict[str, Any]:
    if is_entry(branch):
        return {place: branch.get("value", branch.get("same_as"))}
    if not isinstance(branch, dict):
        return {}
    return {
        key: value
        for name, inner in branch.items()
        for key, value in _values(inner, f"{place}.{name}" if place else str(name)).items()
    }


def _git(project: Path, *arguments: str) -> str:
    command = ["git", "-C", str(project), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.stdout.strip() if done.returncode == 0 else ""
