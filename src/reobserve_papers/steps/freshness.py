"""Results that are not what the code, the parameters and the packages at hand give.

Snakemake keeps with each file the digests of the code and of the parameters that made it, and the
versions of packages. Its summary compares them with those that are there, without running a job.
"""

from __future__ import annotations

import base64
import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from reobserve.core.errors import ReobserveError

_PENDING = "update pending"

# Of a file that would be made again for its inputs alone.
FOR_INPUTS = ("updated input files", "its inputs are")
EDITED = "written since its job ended: edited, made by hand, or copied without its time"
_SAME_TIME = 1e-3  # seconds, of the same time stored in two ways
_COLUMNS = ("output_file", "date", "rule", "log-file(s)", "status", "plan")


def can_tell(project: Path, results: Path) -> bool:
    """True if these are results of builds in the project."""
    return (project / "Snakefile").is_file() and results.resolve() == (
        project / "results"
    ).resolve()


def out_of_date(project: Path, papers: Sequence[str], *, bench: bool) -> dict[Path, str]:
    """Files that a build would make again, or that were edited, with the reason."""
    chosen = ["--config", f"papers=[{','.join(papers)}]"]
    found: dict[Path, str] = {}
    for asked in (chosen, ["bench"])[: 1 + bench]:
        found |= states(project, *asked)
    return {path: why for path, why in found.items() if why}


def states(project: Path, *asked: str) -> dict[Path, str]:
    """All files of a build with the reason for which each is out of date, empty if it is not."""
    command = [sys.executable, "-m", "snakemake", "--summary", "--nolock", *asked]
    done = subprocess.run(command, cwd=project, check=False, capture_output=True, text=True)
    if done.returncode:
        said = (done.stderr.strip().splitlines() or ["no reason given"])[-1]
        raise ReobserveError(f"Snakemake cannot say what is up to date: {said}")
    lines = [line.split("\t") for line in done.stdout.splitlines()]
    if not lines or tuple(lines[0]) != _COLUMNS:
        raise ReobserveError("Snakemake's summary has other columns than are known")
    rows = [dict(zip(_COLUMNS, line, strict=True)) for line in lines[1:]]
    return {project / row["output_file"]: _state(project, row) for row in rows}


def _state(project: Path, row: Mapping[str, str]) -> str:
    """The reason for which the file of a row of the summary is out of date, or nothing."""
    if row["plan"] == _PENDING:
        return row["status"].replace("ok", "its inputs are")
    # Snakemake takes a file as it is, and notes its time when the job that made it has ended.
    name = base64.b64encode(row["output_file"].encode()).decode()
    record = project / ".snakemake/metadata" / name
    if record.is_file():
        ended = json.loads(record.read_text(encoding="utf-8"))["endtime"]
        stamp = (project / row["output_file"]).stat().st_mtime
        # Archives keep whole seconds.
        if stamp % 1 and abs(stamp - ended) > _SAME_TIME:
            return EDITED
    return ""
