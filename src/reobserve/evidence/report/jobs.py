"""The jobs behind figures and tables, as the ledger has them, and the commands that ran."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from reobserve.errors import InputError
from reobserve.evidence.report.model import Gap, Run, StageCode
from reobserve.evidence.report.reading import Project
from reobserve.pipeline.jobs import Graph, Job
from reobserve.pipeline.provenance import code_digest, import_closure, stage_modules

# How a log shows the command as it ran, in its first line.
_PROMPT = "+ "

# The one stage that serves all papers in one job.
CLAIMS = "claims"


@dataclass(frozen=True)
class Runs:
    """The jobs of one paper that ran, and the commands that their logs have."""

    project: Project
    graph: Graph

    def behind(self, stage: str, **about: str) -> tuple[Run, ...]:
        """The run of a stage, ``figure="fig1"`` say, and all behind it, those first it needs."""
        job = self.graph.job(stage, **self._paper, **about)
        return tuple(map(self._run, self.graph.behind(job)))

    def claims(self) -> tuple[Run, ...]:
        """The runs that decide the claims: one of the paper, one of all papers."""
        drawn = self.graph.job("robustness", **self._paper)
        return self._run(drawn), self._run(self.graph.job(CLAIMS))

    @property
    def _paper(self) -> dict[str, str]:
        (paper,) = self.graph.papers
        return {"paper": paper}

    def _run(self, job: Job) -> Run:
        name = ", ".join(reversed(job.about)) if job.stage != CLAIMS else "of all papers"
        inputs = tuple(path for paths in job.files.values() for path in paths)
        outputs = tuple(job.outputs)
        return Run(job.stage, name, inputs, outputs, job.log, self._command(job.log))

    def _command(self, log: str) -> str | Gap:
        """The command as it ran."""
        place = f"{self._paper['paper']}-made"
        try:
            first = self.project.text(log).partition("\n")[0]
        except InputError as error:
            return self.project.gaps.add(place, error)
        if not first.startswith(_PROMPT):
            problem = f"{log}: does not begin with the command that ran"
            return self.project.gaps.add(place, problem)
        return first.removeprefix(_PROMPT).strip()


def outside_inputs(jobs: Sequence[Run]) -> list[str]:
    """What a chain of jobs reads and does not make itself."""
    made = {path for job in jobs for path in job.outputs}
    return list(dict.fromkeys(path for job in jobs for path in job.inputs if path not in made))


def stage_code(paper: str, stages: Sequence[str]) -> tuple[tuple[str, ...], tuple[StageCode, ...]]:
    """The modules that all of these stages of a paper import, and the rest by stage.

    Claims, which are decided for all papers at once, do not count for what all stages import.
    """
    closures = {stage: import_closure(stage_modules(stage, paper)) for stage in stages}
    own = [set(modules) for stage, modules in closures.items() if stage != CLAIMS]
    everywhere = set.intersection(*own) if own else set()
    code = tuple(
        StageCode(
            stage,
            code_digest(stage, paper),
            tuple(name for name in modules if stage == CLAIMS or name not in everywhere),
        )
        for stage, modules in closures.items()
    )
    return tuple(sorted(everywhere)), code
