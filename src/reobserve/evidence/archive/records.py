"""When the jobs of a build ran, from the files that they left."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import cached_property
from pathlib import Path

from reobserve.errors import InputError
from reobserve.plain_data.files import read_text
from reobserve.replication.logs import LoggedJob, jobs_behind

_AGAIN = "build again with `make archive`"


@dataclass(frozen=True)
class Record:
    """A job that ran; paths are relative to the project."""

    project: Path
    job: LoggedJob

    @property
    def name(self) -> str:
        """The path of its log, without what all logs have in common."""
        return self.job.log.removeprefix("logs/").removesuffix(".log")

    @cached_property
    def inputs(self) -> list[str]:
        """The files that its command names and that are there."""
        return [path for path in self.job.inputs if (self.project / path).is_file()]

    @cached_property
    def ended(self) -> datetime:
        """When the last of its files was written."""
        written = max((self.project / path).stat().st_mtime for path in self.job.outputs)
        return datetime.fromtimestamp(int(written), UTC)

    @cached_property
    def began(self) -> datetime | None:
        """Its end less its duration; None if that was not measured."""
        measured = self.project / self.job.benchmark
        if not measured.is_file():
            return None
        seconds = read_text(measured).splitlines()[1].partition("\t")[0]
        return self.ended - timedelta(seconds=float(seconds))


def records(project: Path, products: Iterable[str]) -> list[Record]:
    """The jobs behind the products of a build, each after those it reads from.

    Raises
    ------
    InputError
        If a file of the build or the log of a job is missing.
    """
    jobs = jobs_behind(project, products)
    for path in (*products, *(path for job in jobs for path in job.outputs)):
        if not (project / path).is_file():
            raise InputError(path, f"is missing, so the build is not whole; {_AGAIN}")
    return [Record(project, job) for job in jobs]
