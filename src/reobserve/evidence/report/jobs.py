"""The jobs behind figures and tables, as the ledger has them, and the commands that ran."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from reobserve.errors import InputError
from reobserve.evidence.report.model import Job, StageCode
from reobserve.evidence.report.reading import Project
from reobserve.ledger.ledger import Ledger
from reobserve.pipeline.provenance import code_digest, import_closure, stage_modules
from reobserve.timeseries.signals import sample_files

# How a log shows the command as it ran, in its first line.
_PROMPT = "+ "

# The one stage that serves all papers in one job.
CLAIMS = "claims"


@dataclass(frozen=True)
class Jobs:
    """The jobs of one paper; paths are those of the workflow's rules."""

    project: Project
    ledger: Ledger

    def figure(self, figure: str) -> tuple[Job, ...]:
        """All jobs behind a figure, those first that others need."""
        body = self._tree("figures")[figure]
        study = self._tree("studies")[body["study"]] if "study" in body else {}
        bodies = [self._tree("observers")[name] for name in body["observers"]] + [study]
        designs = dict.fromkeys(b["design"] for b in bodies if "design" in b)
        scenarios = dict.fromkeys([body["scenario"], *([study["scenario"]] if study else [])])
        jobs = [self._design(name) for name in designs]
        jobs += [self._plant(name) for name in scenarios]
        jobs += [self._observe(body["scenario"], name) for name in body["observers"]]
        jobs += [self._study(body["study"])] if study else []
        return tuple(self._with_command(job) for job in (*jobs, *self._judged(figure, body)))

    def table(self, table: str) -> tuple[Job, ...]:
        """All jobs behind a table."""
        design = self._design(self._tree("tables")[table]["design"])
        filled = self._job("table", table, [design.output], f"{table}.csv", f"{table}.table")
        return self._with_command(design), self._with_command(filled)

    def theory(self) -> tuple[Job, ...]:
        """All jobs behind the numbers of the theory."""
        designs = [self._design(name) for name in self._tree("designs")]
        inputs = [job.output for job in designs]
        measured = self._job("theory", "", inputs, "theory.metrics.csv", "theory")
        return tuple(self._with_command(job) for job in (*designs, measured))

    def claims(self) -> tuple[Job, ...]:
        """The jobs that decide the claims: one of the paper, one of all papers."""
        paper = self.ledger.paper
        registry = f"config/claims/{paper}.yaml"
        drawn = self._job("robustness", "", [registry], "robustness.json", "robustness")
        numbers = [f"results/{paper}/{name}.metrics.csv" for name in self._tree("figures")]
        numbers += [f"results/{paper}/theory.metrics.csv"] if "theory" in self.ledger.tree else []
        decided = Job(
            CLAIMS, "of all papers", (registry, *numbers, drawn.output), "results/claims.csv",
            "logs/claims.log",
        )  # fmt: skip
        return self._with_command(drawn), self._with_command(decided)

    def _tree(self, section: str) -> Mapping[str, Any]:
        branch: Mapping[str, Any] = self.ledger.tree.get(section, {})
        return branch

    def _job(self, stage: str, name: str, inputs: list[str], output: str, log: str) -> Job:
        paper = self.ledger.paper
        ledger = f"results/{paper}/ledger.json"
        return Job(
            stage, name, (ledger, *inputs), f"results/{paper}/{output}", f"logs/{paper}/{log}.log"
        )

    def _design(self, name: str) -> Job:
        return self._job("design", name, [], f"{name}.design.json", f"{name}.design")

    def _plant(self, scenario: str) -> Job:
        values = {**self.ledger.section("plant"), **self.ledger.section("scenarios", scenario)}
        files = [file for value in values.values() for file in sample_files(value)]
        return self._job("plant", scenario, files, f"{scenario}/plant.parquet", f"{scenario}/plant")

    def _observe(self, scenario: str, observer: str) -> Job:
        inputs = [self._plant(scenario).output]
        inputs += self._named_design(self._tree("observers")[observer])
        path = f"{scenario}/{observer}"
        return self._job("observe", f"{observer}, {scenario}", inputs, f"{path}.parquet", path)

    def _study(self, study: str) -> Job:
        body = self._tree("studies")[study]
        entries = [entry for entry in body.values() if isinstance(entry, Mapping)]
        files = [entry["value"] for entry in entries if entry["unit"] == "file"]
        inputs = [self._plant(body["scenario"]).output, *files, *self._named_design(body)]
        return self._job("study", study, inputs, f"{study}.study.csv", f"{study}.study")

    def _judged(self, figure: str, body: Mapping[str, Any]) -> list[Job]:
        inputs = [self._plant(body["scenario"]).output]
        inputs += [self._observe(body["scenario"], name).output for name in body["observers"]]
        inputs += [self._study(body["study"]).output] if "study" in body else []
        metrics = f"{figure}.metrics"
        judged = self._job("metrics", figure, inputs, f"{metrics}.csv", metrics)
        own = f"workflow/report/{self.ledger.paper}/{figure}.rst"
        template = own if self.project.exists(own) else "workflow/report/figure.rst"
        drawn = self._job(
            "plot", figure, [*inputs, judged.output, template], f"{figure}.*", f"{figure}.plot"
        )
        return [judged, drawn]

    def _named_design(self, body: Mapping[str, Any]) -> list[str]:
        return [self._design(body["design"]).output] if "design" in body else []

    def _with_command(self, job: Job) -> Job:
        place = f"{self.ledger.paper}-made"
        try:
            first = self.project.text(job.log).partition("\n")[0]
        except InputError as error:
            return replace(job, command=self.project.gaps.add(place, error))
        if not first.startswith(_PROMPT):
            problem = f"{job.log}: does not begin with the command that ran"
            return replace(job, command=self.project.gaps.add(place, problem))
        return replace(job, command=first.removeprefix(_PROMPT).strip())


def outside_inputs(jobs: Sequence[Job]) -> list[str]:
    """What a chain of jobs reads and does not make itself."""
    made = {job.output for job in jobs}
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
