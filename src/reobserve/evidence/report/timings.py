"""What the jobs took, from the files that Snakemake writes beside their logs."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from pathlib import Path

from reobserve.evidence.report.model import Run, Timing
from reobserve.evidence.report.reading import Project

_SAMPLED = 0.5  # [s] until Snakemake looks at the memory of a job for the second time


def timings(project: Project, paper: str, jobs: Iterable[Run]) -> list[Timing]:
    """Seconds and memory of a paper's jobs by stage, in the order in which stages first come.

    Jobs whose record is missing are not counted: it says what was measured, and nothing else does.
    """
    stages = {
        Path(job.log).with_suffix(".tsv").as_posix(): job.stage
        for job in jobs
        if job.log.startswith(f"logs/{paper}/")  # others serve all papers
    }
    measured: dict[str, list[tuple[float, float]]] = {}
    for path, stage in stages.items():
        row = _read(project.folder / path)
        if row is not None:
            measured.setdefault(stage, []).append(row)
    return [
        Timing(
            paper,
            stage,
            len(rows),
            sum(seconds for seconds, _ in rows),
            max(seconds for seconds, _ in rows),
            max(memory for _, memory in rows),
        )
        for stage, rows in measured.items()
    ]


def _read(path: Path) -> tuple[float, float] | None:
    """Seconds and peak memory [MB] of a job; 0 MB where Snakemake has sampled its shell alone."""
    try:
        with path.open(newline="", encoding="utf-8") as stream:
            row = next(csv.DictReader(stream, delimiter="\t"))
        seconds, memory = float(row["s"]), row["max_rss"]
        unknown = memory in ("NA", "-") or seconds < _SAMPLED
        return seconds, 0.0 if unknown else float(memory)
    except (OSError, StopIteration, KeyError, TypeError, ValueError):
        return None
