"""What ran: the jobs behind the verdicts, with their commands as the logs have them."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import cached_property
from pathlib import Path

from reobserve.errors import InputError
from reobserve.ledger.ledger import Ledger, digest
from reobserve.ledger.stages import AGELESS
from reobserve.pipeline.common import Provenance
from reobserve.pipeline.jobs import Graph, Job
from reobserve.pipeline.provenance import code_digest, versions
from reobserve.plain_data.files import read_text
from reobserve.plain_data.json_data import read_json
from reobserve.plain_data.typed_tree import parse
from reobserve.timeseries.series import Series

# How a log shows the command as it ran, in its first line.
_PROMPT = "+ "

_AGAIN = "build again with `make archive`"


@dataclass(frozen=True)
class Record:
    """A job that ran; paths are relative to the project."""

    project: Path
    job: Job
    command: str
    inputs: tuple[str, ...]

    @property
    def name(self) -> str:
        """What tells it apart: the paper, the stage, and what it is about."""
        return f"{self.job.names.get('paper', '')} {self.job.name}".strip()

    @cached_property
    def ended(self) -> datetime:
        """When the last of its files was written."""
        written = max((self.project / path).stat().st_mtime for path in self.job.outputs)
        return datetime.fromtimestamp(int(written), UTC)

    @cached_property
    def began(self) -> datetime | None:
        """That less what it took; None where nobody measured it."""
        measured = self.project / timing(self.job)
        if not measured.is_file():
            return None
        seconds = read_text(measured).splitlines()[1].partition("\t")[0]
        return self.ended - timedelta(seconds=float(seconds))


def timing(job: Job) -> str:
    """The file with what a job took."""
    return job.log.removesuffix(".log") + ".tsv"


def built_graph(project: Path, papers: Sequence[str], formats: Sequence[str]) -> Graph:
    """The jobs of a build, by the ledgers that it left.

    Raises
    ------
    InputError
        If a ledger is missing or damaged.
    """
    ledgers = {}
    for paper in papers:
        path = AGELESS["ledger"].format(paper=paper)
        _check_there(project, path)
        ledgers[paper] = Ledger.read(project / path)
    return Graph(ledgers, papers, formats, project=project)


def records(project: Path, graph: Graph) -> list[Record]:
    """The jobs behind the verdicts, in the order in which they need each other.

    Raises
    ------
    InputError
        If a file of the build or the log of a job is missing, a job made other files, or series or
        designs are of other settings, code or packages than there are now.
    """
    return [
        record
        for job in graph.behind(graph.job("verdicts"))
        for record in _with_chunks(project, graph, _record(project, job))
    ]


def _record(project: Path, job: Job) -> Record:
    for path in (*job.outputs, job.log):
        _check_there(project, path)
    first = read_text(project / job.log).partition("\n")[0]
    words = shlex.split(first.removeprefix(_PROMPT)) if first.startswith(_PROMPT) else []
    for path in job.outputs:
        if path not in words:
            raise InputError(job.log, f"does not tell of a command that made {path}; {_AGAIN}")
        _check_current(project, job, path)
    named = [word for word in words if (project / word).is_file()]
    read = [path for paths in job.files.values() for path in paths if (project / path).is_file()]
    inputs = dict.fromkeys(path for path in (*read, *named) if path not in job.outputs)
    return Record(project, job, first.removeprefix(_PROMPT), tuple(inputs))


def _with_chunks(project: Path, graph: Graph, record: Record) -> Iterator[Record]:
    """A job and, before it, those that made its draws, if they were made in chunks."""
    paper = record.job.names.get("paper", "")
    chunk = re.compile(rf"results/{re.escape(paper)}/draws/(\d+-\d+)\.json")
    if record.job.stage == "robustness":
        for found in filter(None, map(chunk.fullmatch, record.inputs)):
            yield _record(project, graph.job("draw", paper=paper, chunk=found[1]))
    yield record


def _check_there(project: Path, path: str) -> None:
    if not (project / path).is_file():
        raise InputError(path, f"is missing, so the build is not whole; {_AGAIN}")


def _check_current(project: Path, job: Job, path: str) -> None:
    """Compare what a series or a design says of its making with what there is now."""
    if path.endswith(".parquet"):
        told = dict(Series.read(project / path).provenance)
    elif job.stage == "design":
        told = read_json(project / path)["provenance"]
    else:
        return
    made = parse(Provenance, told, path)
    now = {
        "settings": (made.settings_digest, digest(job.settings)),
        "code": (made.code_digest, code_digest(job.stage, made.paper)),
        "packages": (made.packages, versions()),
    }
    for what, (then, today) in now.items():
        if then != today:
            raise InputError(path, f"was made by other {what} than the project has now; {_AGAIN}")
