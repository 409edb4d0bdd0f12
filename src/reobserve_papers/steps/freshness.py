"""Results that are not what the code, the parameters and the packages at hand give.

Snakemake keeps with each file the digests of the code and of the parameters that made it, and the
versions of packages. Its summary compares them with those that are there, without running a job.
"""

from __future__ import annotations

import base64
import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from reobserve.core.errors import ReobserveError
from reobserve.core.files import check_folder, write_text

_PENDING = "update pending"

# Of a file that would be made again for its inputs alone.
FOR_INPUTS = ("updated input files", "its inputs are")
EDITED = "written since its job ended: edited, made by hand, or copied without its time"
UNRECORDED = "no record says which code and parameters made it"
_SAME_TIME = 1e-3  # seconds, of the same time stored in two ways
_LONGEST = 254  # letters of the name of a record, which goes on in a folder
_COLUMNS = ("output_file", "date", "rule", "log-file(s)", "status", "plan")


def check_code(project: Path) -> None:
    """Refuse packages imported from elsewhere if the project has them in its ``src``."""
    for own in sorted((project / "src").glob("*/__init__.py")):
        imported = getattr(sys.modules.get(own.parent.name), "__file__", None)
        if imported and Path(imported).resolve() != own.resolve():
            raise ReobserveError(
                f"the code of {Path(imported).parent} would run in place of {own.parent}: type "
                "`make` here, or activate an environment of this folder, with PYTHONPATH unset"
            )


def mark_unrecorded(project: Path) -> None:
    """Give results of which Snakemake has no record one that fits no job: they are made again.

    It would take them as they are. Damaged records, at which it would fail, are removed. While
    another build writes them, all stay.
    """
    if any((project / ".snakemake/locks").glob("*")):
        return
    for record in (project / ".snakemake/metadata").rglob("*"):
        if record.is_file() and not _read(record):
            check_folder(record)
            record.unlink(missing_ok=True)
    seen: set[str] = set()
    for folder, inside, names in os.walk(project / "results", followlinks=True):
        if (real := os.path.realpath(folder)) in seen:
            inside.clear()
            continue
        seen.add(real)
        for name in filter(_is_text, names):
            record = record_of(project, str((Path(folder) / name).relative_to(project)))
            if name not in ("README.md", "parameters.json") and not record.exists():
                write_text(record, json.dumps({"record_format_version": 6, "params": [UNRECORDED]}))
                (project / ".snakemake/incomplete").mkdir(exist_ok=True)


def _is_text(name: str) -> bool:
    """True if a file can be a result: its name is no bytes of another encoding."""
    return name == name.encode(errors="ignore").decode()


def record_of(project: Path, output: str) -> Path:
    """The file that Snakemake keeps on an output."""
    name = base64.urlsafe_b64encode(output.encode()).decode()
    *folders, last = (name[k : k + _LONGEST] for k in range(0, len(name), _LONGEST))
    return project.joinpath(".snakemake/metadata", *(f"@{part}" for part in folders), last)


def _read(record: Path) -> dict[str, Any]:
    """The content of a record, empty if it is damaged or missing."""
    with suppress(OSError, TypeError, ValueError):
        return dict(json.loads(record.read_bytes()))
    return {}


def can_tell(project: Path, results: Path) -> bool:
    """True if these are results of builds in the project."""
    return (project / "Snakefile").is_file() and results.resolve() == (
        project / "results"
    ).resolve()


def out_of_date(project: Path, papers: Sequence[str], *, bench: bool) -> dict[Path, str]:
    """Files that a build would make again, or that were edited, with the reason."""
    chosen = ["--config", f"papers=[{','.join(papers)}]"]
    outdated: dict[Path, str] = {}
    for asked in (chosen, ["bench"])[: 1 + bench]:
        outdated |= states(project, *asked)
    return {path: why for path, why in outdated.items() if why}


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
    made = _read(record_of(project, row["output_file"]))
    if made.get("params") == [UNRECORDED]:
        return UNRECORDED
    if row["plan"] == _PENDING:
        return row["status"].replace("ok", "its inputs are")
    # Snakemake takes a file as it is, and notes its time when the job that made it has ended.
    if (ended := made.get("endtime")) is not None:
        stamp = (project / row["output_file"]).stat().st_mtime
        # Archives keep whole seconds.
        if stamp % 1 and abs(stamp - ended) > _SAME_TIME:
            return EDITED
    return ""
