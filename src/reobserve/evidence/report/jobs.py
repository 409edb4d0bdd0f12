"""The commands behind figures and tables, as they ran."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from reobserve.errors import InputError
from reobserve.evidence.report.model import Gap, Run, StageCode
from reobserve.evidence.report.reading import Project
from reobserve.ledger.ledger import Ledger
from reobserve.replication.chain import behind, log
from reobserve.replication.logs import read_log
from reobserve.replication.provenance import code_digest, import_closure, stage_modules

# The one step that serves all papers in one job.
CLAIMS = "claims"


@dataclass(frozen=True)
class Runs:
    """The jobs of one paper that ran, and the commands that their logs have."""

    project: Project
    ledger: Ledger

    def behind(self, *step: str) -> tuple[Run, ...]:
        """The run of a step, ``("plot", "fig1")`` say, after the runs of all that it needs."""
        steps = behind(self.ledger, *step)
        return tuple(self._run(name, names) for name, *names in steps)

    def claims(self) -> tuple[Run, ...]:
        """The runs that decide the claims: one of the paper, one of all papers."""
        return self._run("robustness", []), self._run(CLAIMS, ["of all papers"])

    def _run(self, step: str, names: Sequence[str]) -> Run:
        paper = self.ledger.paper
        path = f"logs/{CLAIMS}.log" if step == CLAIMS else log(paper, step, *names)
        name = ", ".join(reversed(names))
        try:
            job = read_log(self.project.folder, path)
        except InputError as error:
            gap: Gap = self.project.gaps.add(f"{paper}-made", error)
            return Run(step, name, (), (), path, gap)
        return Run(step, name, job.inputs, job.outputs, path, job.command)


def outside_inputs(jobs: Sequence[Run]) -> list[str]:
    """The files that a chain of jobs reads and does not write."""
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
