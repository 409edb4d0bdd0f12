"""Environment of a report: commit, machine, Python and packages that can move a result."""

from __future__ import annotations

import platform
from importlib import metadata
from pathlib import Path

from reobserve.core.code_paths import cores
from reobserve.core.errors import ReobserveError
from reobserve_papers.golden.acceptance_rules import git
from reobserve_papers.steps.provenance import versions


def environment(project: Path) -> dict[str, str]:
    """Return what the page says of its origin, by name."""
    rows = {
        "commit": _commit(project),
        "operating system": _system(),
        "processor": _processor(),
        "cores": str(cores()),
        "Python": f"{platform.python_version()} ({platform.python_implementation()})",
    }
    return {name: value for name, value in rows.items() if value}


def package_versions() -> dict[str, str]:
    """Return the versions of the packages that decide numbers, figures and this page."""
    others = {name: metadata.version(name) for name in ("jinja2", "docutils", "snakemake")}
    return {"reobserve": metadata.version("reobserve"), **versions(), **others}


def _commit(project: Path) -> str:
    """The commit checked out in exactly this folder, and whether files differ from it."""
    top = git_output(project, "rev-parse", "--show-toplevel")
    if not top or Path(top).resolve() != project.resolve():
        return ""
    commit = git_output(project, "rev-parse", "HEAD")
    changed = git_output(project, "status", "--porcelain")
    return commit and commit + (", with changes that are not committed" if changed else "")


def git_output(project: Path, *arguments: str) -> str:
    """Output of a git command without the end of its last line, empty if it fails."""
    try:
        return git(project, *arguments).strip()
    except ReobserveError:
        return ""


def _system() -> str:
    try:
        name = platform.freedesktop_os_release()["PRETTY_NAME"]
    except (OSError, KeyError):
        name = ""
    return ", ".join(filter(None, [name, f"{platform.system()} {platform.release()}"]))


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    models = [text.partition(":")[2].strip() for text in lines if text.startswith("model name")]
    return models[0] if models else platform.processor() or platform.machine()
