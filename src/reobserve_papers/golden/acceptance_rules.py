"""Conditions for accepting figures and numbers: a reason, and a tree without other changes."""

from __future__ import annotations

import os
import subprocess
from datetime import UTC, datetime
from pathlib import Path
from shutil import which

from reobserve.core.errors import ReobserveError


def check_reason(reason: str) -> None:
    """Raise `ReobserveError` in CI, or without a reason."""
    if os.environ.get("CI", "").lower() not in ("", "0", "false"):
        raise ReobserveError("nothing is accepted in CI: the variable CI is set")
    if len(reason.split()) < 3:
        raise ReobserveError(
            f"the reason {reason!r} must say in three words or more why the numbers move"
        )


def check_may_accept(project: Path, reason: str) -> None:
    """Raise `ReobserveError` as `check_reason`, or if the tree has uncommitted changes."""
    check_reason(reason)
    changed = _changed(project)
    if changed:
        raise ReobserveError(
            f"the tree has {len(changed)} uncommitted changes, the first is {changed[0][3:]!r}; "
            "commit them first, so that the history shows which change moved the numbers"
        )


def _changed(project: Path) -> list[str]:
    """The state by git of each file that differs from the last commit, but for cached samples."""
    lines = git(project, "status", "--porcelain").splitlines()
    return [line for line in lines if not line[3:].startswith("config/samples/")]


def git(project: Path, *arguments: str) -> str:
    """The output of a git command, in a folder of any owner."""
    if which("git") is None:
        raise ReobserveError("results are accepted with git, which is not on the PATH")
    command = ["git", "-c", "safe.directory=*", "-C", str(project), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise ReobserveError(f"results are accepted in a git checkout: {done.stderr.strip()}")
    return done.stdout


def keep_reason(project: Path, reason: str, moved: str) -> None:
    """Add the reason to the log beside the golden numbers, with the commit that it belongs to.

    ``moved`` says in a few words how much did. Without a changed file nothing is added.
    """
    if not _changed(project):
        return
    commit = git(project, "rev-parse", "--short", "HEAD").strip()
    add_reason(project / "tests" / "golden" / "REASONS.md", reason, moved, f", at {commit}")


def add_reason(log: Path, reason: str, moved: str, place: str = "") -> None:
    """Add a reason of today to a list of reasons."""
    today = datetime.now(tz=UTC).date().isoformat()
    with log.open("a", encoding="utf-8") as stream:
        stream.write(f"- {today}{place}: {' '.join(reason.split())} ({moved})\n")
