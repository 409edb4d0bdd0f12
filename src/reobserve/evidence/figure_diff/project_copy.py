"""A copy of the project in a folder of its own, and a build of everything in it from nothing."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import reobserve
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
    """The variables under which commands in the copy ``folder`` run its own package.

    Compiled loops are shared with this package, as far as their sources are the same.
    """
    return {
        "NUMBA_CACHE_DIR": str(Path(reobserve.__file__).parent / "__pycache__"),
        **os.environ,
        "PYTHONDONTWRITEBYTECODE": "",  # each of many processes would compile the package again
        "PYTHONPATH": str(folder / "src"),
        "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")]),
    }


def build(folder: Path, cores: int, log: Path, papers: Sequence[str] = ()) -> bool:
    """Build everything that can be in the copy ``folder``, or of these papers; whether all was.

    What Snakemake prints goes to ``log``.
    """
    command = [sys.executable, "-m", "snakemake", "--cores", str(cores), "--keep-going"]
    command += ["--config", f"papers=[{','.join(papers)}]"] if papers else []
    log.parent.mkdir(parents=True, exist_ok=True)
    with log.open("w", encoding="utf-8") as stream:
        done = subprocess.run(
            command, cwd=folder, env=copy_environment(folder),
            stdout=stream, stderr=subprocess.STDOUT, check=False,
        )  # fmt: skip
    return done.returncode == 0
