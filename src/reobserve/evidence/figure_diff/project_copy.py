"""A copy of the project in a folder of its own, and a build of everything in it from nothing."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from reobserve.errors import ReobserveError


def copy_project(project: Path, target: Path) -> None:
    """Copy what git tracks or would track; what was built stays behind.

    Raises
    ------
    ReobserveError
        If ``project`` is no git checkout.
    """
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"],
        cwd=project, capture_output=True, text=True, check=False,
    )  # fmt: skip
    if listed.returncode:
        raise ReobserveError(f"only a git checkout can be copied: {listed.stderr.strip()}")
    for name in filter(None, listed.stdout.split("\0")):
        if (project / name).is_file():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(project / name, target / name)


def copy_environment(folder: Path) -> dict[str, str]:
    """The variables under which commands run the package in the ``src`` of a folder."""
    return {
        **os.environ,
        "PYTHONDONTWRITEBYTECODE": "",  # each of many processes would compile the package again
        "PYTHONPATH": str(folder / "src"),
        "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")]),
    }


def build(folder: Path, project: Path, cores: int, log: Path, papers: Sequence[str] = ()) -> bool:
    """Build everything that can be in the copy ``folder``, or of these papers; whether all was.

    The package is that of ``project``, of which ``folder`` is a copy, so that its compiled kernels
    are used. What Snakemake prints goes to ``log``.
    """
    command = [sys.executable, "-m", "snakemake", "--cores", str(cores), "--keep-going"]
    command += ["--show-failed-logs"]
    command += ["--config", f"papers=[{','.join(papers)}]"] if papers else []
    log.parent.mkdir(parents=True, exist_ok=True)
    with log.open("w", encoding="utf-8") as stream:
        done = subprocess.run(
            command, cwd=folder, env=copy_environment(project.resolve()),
            stdout=stream, stderr=subprocess.STDOUT, check=False,
        )  # fmt: skip
    return done.returncode == 0
