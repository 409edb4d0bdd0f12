"""A copy of the project in another folder, for tests and benchmarks that build or change it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from . import ROOT


def copy_project(project: Path, target: Path) -> None:
    """Copy what git tracks or would track, without build results."""
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"],
        cwd=project, capture_output=True, text=True, check=True,
    )  # fmt: skip
    for name in filter(None, listed.stdout.split("\0")):
        if (project / name).is_file():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(project / name, target / name)


def copy_environment(folder: Path) -> dict[str, str]:
    """The environment variables with which commands run the package in the ``src`` of a folder.

    It shares the compiled kernels of this checkout, as far as the code behind them is the same.
    """
    return {
        **os.environ,
        "NUMBA_CACHE_DIR": str(ROOT / "src/reobserve/__pycache__"),
        # otherwise each of many processes would compile the package again
        "PYTHONDONTWRITEBYTECODE": "",
        "PYTHONPATH": str(folder / "src"),
        "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")]),
    }
