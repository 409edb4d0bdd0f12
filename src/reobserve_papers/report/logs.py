"""The commands of a build, from the logs of its jobs: each begins with the command that ran."""

from __future__ import annotations

import itertools
import shlex
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from reobserve.core.errors import InputError
from reobserve.core.files import read_text
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.parameters.step_kinds import KINDS
from reobserve_papers.steps.chain import EVIDENCE, inputs, outputs

_PROMPT = "+ "  # as ``set -x`` of a shell prints commands
_WRITTEN = ("--output", "--outputs", "--caption")


@dataclass(frozen=True)
class LoggedJob:
    """A job that ran: its command and the files it names, with paths relative to the project."""

    log: str
    command: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    @property
    def step(self) -> str:
        """The command of `reobserve-papers` that ran, such as ``plant``."""
        words = shlex.split(self.command)
        return words[2] if words[1] == "stage" else words[1]

    @property
    def benchmark(self) -> str:
        """The file in which Snakemake recorded time and memory."""
        return self.log.removesuffix(".log") + ".tsv"


def read_log(project: Path, log: str) -> LoggedJob:
    """The job of a log."""
    try:
        first = read_text(project / log).partition("\n")[0]
    except InputError as error:
        raise InputError(log, error.problem) from None
    if not first.startswith(f"{_PROMPT}reobserve-papers "):
        raise InputError(log, "does not begin with the command that ran")
    command = first.removeprefix(_PROMPT).strip()
    _, *words = shlex.split(command)
    if words[:1] == ["stage"] and words[1:2] and words[1] in {*KINDS, *EVIDENCE}:
        return LoggedJob(log, command, *_of_step(project, *words[1:]))
    files: dict[bool, list[str]] = {True: [], False: []}
    option = ""
    for word in words:
        if word.startswith("--"):
            option = word
        elif "/" in word:
            files[option in _WRITTEN].append(word)
    return LoggedJob(log, command, tuple(files[False]), tuple(files[True]))


def _of_step(project: Path, step: str, *words: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The files that the job of a step read, and those that it wrote."""
    arguments = [*itertools.takewhile(lambda word: word[:2] != "--", words)]
    options = (*words[len(arguments) :], "--formats")
    stated = options[options.index("--formats") + 1 :]
    formats = [*itertools.takewhile(lambda word: word[:2] != "--", stated)]
    files = arguments if step in ("claims", "verdicts") else arguments[:1]
    names = arguments[len(files) :]
    papers = [Parameters.read(project / path) for path in files]
    cached = "--no-cached" not in options
    style = options[options.index("--style") + 1] if "--style" in options else ""
    read = [
        path
        for one in papers
        for path in inputs(one, project, step, *names, cached=cached, style=style)
    ]
    made = outputs(papers[0].paper if papers else "", step, *names, formats=formats)
    return (*files, *dict.fromkeys(read)), made


def jobs_behind(project: Path, targets: Iterable[str]) -> list[LoggedJob]:
    """The jobs that made these files and all that they read, each after those it reads from."""
    makers: dict[str, LoggedJob] = {}
    for path in sorted((project / "logs").rglob("*.log")):
        try:
            job = read_log(project, path.relative_to(project).as_posix())
        except InputError:
            continue
        makers |= dict.fromkeys(job.outputs, job)
    jobs: dict[str, LoggedJob] = {}

    def visit(path: str) -> None:
        if path not in makers:
            if path.startswith("results/") and not path.endswith("/parameters.json"):
                raise InputError(path, "no log in logs/ names the command that made it")
            return
        job = makers[path]
        if job.log not in jobs:
            for needed in job.inputs:
                visit(needed)
            jobs[job.log] = job

    for target in targets:
        visit(target)
    return list(jobs.values())
