"""Results that are not what the code, the parameters and the packages at hand give.

Snakemake keeps with each file the digests of the code and of the parameters that made it, and the
versions of packages. Its summary compares them with those that are there, without running a job.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from reobserve.core.errors import ReobserveError

_PENDING = "update pending"

# Of a file that would be made again for its inputs alone.
FOR_INPUTS = ("updated input files", "its inputs are")
_COLUMNS = ("output_file", "date", "rule", "log-file(s)", "status", "plan")


def can_tell(project: Path, results: Path) -> bool:
    """True if these are results of builds in the project."""
    return (project / "Snakefile").is_file() and results.resolve() == (
        project / "results"
    ).resolve()


def out_of_date(project: Path, papers: Sequence[str], *, bench: bool) -> dict[Path, str]:
    """Files that a build would make again, with the reason.

    Raises
    ------
    ReobserveError
        If Snakemake cannot say.
    """
    chosen = ["--config", f"papers=[{','.join(papers)}]"]
    found: dict[Path, str] = {}
    for asked in (chosen, ["bench"]) if bench else (chosen,):
        command = [sys.executable, "-m", "snakemake", "--summary", "--nolock", *asked]
        done = subprocess.run(command, cwd=project, check=False, capture_output=True, text=True)
        if done.returncode:
            said = (done.stderr.strip().splitlines() or ["no reason given"])[-1]
            raise ReobserveError(f"Snakemake cannot say what is up to date: {said}")
        found |= _pending(project, done.stdout)
    return found


def _pending(project: Path, summary: str) -> dict[Path, str]:
    lines = [line.split("\t") for line in summary.splitlines()]
    if not lines or tuple(lines[0]) != _COLUMNS:
        raise ReobserveError("Snakemake's summary has other columns than are known")
    rows = [dict(zip(_COLUMNS, line, strict=True)) for line in lines[1:]]
    return {
        project / row["output_file"]: row["status"].replace("ok", "its inputs are")
        for row in rows
        if row["plan"] == _PENDING
    }
