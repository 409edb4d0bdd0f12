"""A figure's series and numbers in one call, in this process: no Snakemake and no files.

The golden tests, and every study over other parameters, take this way in; it calls the same
functions of the paper with the same settings as the pipeline's stages.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from reobserve.ledger.ledger import Ledger, digest
from reobserve.pipeline.common import compute, compute_design, rows_from
from reobserve.pipeline.figures import figure_data, measure
from reobserve.pipeline.jobs import Graph, Job
from reobserve.scoring.metrics import Metric
from reobserve.scoring.parts import only
from reobserve.timeseries.series import Series


@dataclass(frozen=True)
class Evaluation:
    """What stands behind a figure: the plant's record, the estimates, the study, the metrics."""

    plant: Series
    estimates: Mapping[str, Series]
    study: list[dict[str, Any]] | None
    metrics: list[Metric]


def _needs(job: Job, role: str) -> list[Job]:
    """The jobs whose outputs a job reads in a role."""
    return [need for need in job.reads[role] if isinstance(need, Job)]


@dataclass
class Evaluator:
    """Evaluates figures and tables of one ledger; what they share is computed once.

    ``made`` is what each stage gave so far, in the order of need: ``plant constant``,
    ``observe constant sampled``, ``metrics fig1``.
    """

    ledger: Ledger
    _done: dict[str, Any] = field(default_factory=dict)
    _files: dict[str, Path] = field(default_factory=dict, repr=False)  # of what was taken
    made: dict[str, Any] = field(default_factory=dict, init=False)
    _keys: dict[Job, str] = field(default_factory=dict, init=False, repr=False)

    def figure(self, figure: str) -> Evaluation:
        """Everything behind one figure.

        Raises
        ------
        InputError
            If the ledger has no such figure or a value in it cannot be used, or a file that its
            study was taken from has not the rows that it needs.
        DivergenceError
            If the plant or an observer diverges.
        """
        settings = self.ledger.settings("metrics", figure)
        job = self._job("metrics", figure=figure)
        (plant,) = self._read(job, "plant")
        estimates = dict(
            zip(settings["figure"]["observers"], self._read(job, "estimates"), strict=True)
        )
        study, file = None, None
        for need in _needs(job, "study"):
            study, file = self._once(need), self._files.get(self._key(need))
        data = figure_data(self.ledger.paper, settings, plant, estimates, study)
        with rows_from(file):
            metrics = measure(self.ledger.paper, data)
        self.made[job.name] = metrics
        return Evaluation(plant, estimates, study, metrics)

    def theory(self, asked: frozenset[str] | None = None) -> list[Metric]:
        """The numbers of the paper's theory; none if the ledger has no section for it.

        If only metrics of some names are ``asked`` for, others may be left out.

        Raises
        ------
        InputError
            If a value of the ledger cannot be used.
        """
        if "theory" not in self.ledger.tree:
            return []
        job = self._job("theory")
        found: list[Metric]
        if asked is None or self._key(job) in self._done:
            found = self._once(job)
            return found
        key = f"{self._key(job)} {' '.join(sorted(asked))}"
        if key not in self._done:
            with only(asked):
                self._done[key] = self._theory(job)
        found = self._done[key]
        return found

    def table(self, table: str) -> list[dict[str, Any]]:
        """The rows of one table.

        Raises
        ------
        InputError
            If the ledger has no such table or a value in it cannot be used.
        """
        settings = self.ledger.settings("table", table)
        job = self._job("table", table=table)
        design = self._read(job, "design")
        rows: list[dict[str, Any]] = compute(self.ledger.paper, "table", table, settings, *design)
        self.made[job.name] = rows
        return rows

    def digest(self, figure: str | None) -> str:
        """Of all that the numbers of a figure depend on but code; None asks for the theory."""
        if figure is None:
            return self._key(self._job("theory"))
        return self._key(self._job("metrics", figure=figure))

    def refined(self) -> Evaluator:
        """The same with every numerical step halved; what no step enters is not computed again."""
        return self.sibling(self.ledger.refined())

    def sibling(self, ledger: Ledger) -> Evaluator:
        """For another ledger of the paper; what either computes, both have."""
        return Evaluator(ledger, self._done, self._files)

    def take(self, stage: str, made: Any, file: Path | None = None, **names: str) -> None:
        """Take what a job has made elsewhere, such as the rows of a study, and from which file."""
        key = self._key(self._job(stage, **names))
        self._done[key] = made
        if file is not None:
            self._files[key] = file

    def apart(self) -> Evaluator:
        """The same, which starts from what is computed here and keeps for itself what it adds."""
        return Evaluator(self.ledger, dict(self._done), self._files)

    @cached_property
    def _graph(self) -> Graph:
        return Graph({self.ledger.paper: self.ledger})

    def _job(self, stage: str, **names: str) -> Job:
        return self._graph.job(stage, paper=self.ledger.paper, **names)

    def _read(self, job: Job, role: str) -> list[Any]:
        """What the jobs give that a job reads in a role."""
        return [self._once(need) for need in _needs(job, role)]

    def _once(self, job: Job) -> Any:
        """What a job gives, computed if nothing that it depends on gave it before."""
        key = self._key(job)
        if key not in self._done:
            self._done[key] = getattr(self, f"_{job.stage}")(job)
        self.made[job.name] = self._done[key]
        return self._done[key]

    def _key(self, job: Job) -> str:
        """A digest of all that a job sees, and of all that those see that it reads from."""
        if job not in self._keys:
            self._keys[job] = digest([job.stage, job.settings, *map(self._key, job.needs)])
        return self._keys[job]

    def _design(self, job: Job) -> dict[str, Any]:
        return compute_design(self.ledger, *job.about)

    def _plant(self, job: Job) -> Any:
        return self._computed(job)

    def _observe(self, job: Job) -> Any:
        return self._computed(job, *self._read(job, "plant"), *self._read(job, "design"))

    def _study(self, job: Job) -> Any:
        return self._computed(job, *self._read(job, "plant"), *self._read(job, "design"))

    def _theory(self, job: Job) -> Any:
        designs = zip(job.settings["designs"], self._read(job, "designs"), strict=True)
        return self._computed(job, dict(designs))

    def _computed(self, job: Job, *inputs: Any) -> Any:
        name = job.about[-1] if job.about else ""
        return compute(self.ledger.paper, job.stage, name, job.settings, *inputs)


def evaluate(ledger: Ledger, figure: str) -> Evaluation:
    """Everything behind one figure of a ledger; see `Evaluator.figure`."""
    return Evaluator(ledger).figure(figure)
