"""A figure's series and numbers in one call, in this process: no Snakemake and no files.

The golden tests, and every study over other parameters, take this way in; it calls the same
functions of the paper with the same settings as the pipeline's stages.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from reobserve.errors import located
from reobserve.ledger.ledger import Ledger, digest
from reobserve.pipeline.common import compute_design, paper_module
from reobserve.pipeline.figures import figure_data, measure
from reobserve.scoring.metrics import Metric
from reobserve.timeseries.series import Series


@dataclass(frozen=True)
class Evaluation:
    """What stands behind a figure: the plant's record, the estimates, the study, the metrics."""

    plant: Series
    estimates: Mapping[str, Series]
    study: list[dict[str, Any]] | None
    metrics: list[Metric]


@dataclass
class Evaluator:
    """Evaluates figures and tables of one ledger; what they share is computed once.

    ``made`` is what each stage gave so far, in the order of need: ``plant constant``,
    ``observe constant sampled``, ``metrics fig1``.
    """

    ledger: Ledger
    _done: dict[str, Any] = field(default_factory=dict)
    made: dict[str, Any] = field(default_factory=dict, init=False)

    def figure(self, figure: str) -> Evaluation:
        """Everything behind one figure.

        Raises
        ------
        InputError
            If the ledger has no such figure or a value in it cannot be used.
        DivergenceError
            If the plant or an observer diverges.
        """
        settings = self.ledger.settings("metrics", figure)
        scenario = settings["figure"]["scenario"]
        plant = self._plant(scenario)
        estimates = {
            name: self._estimate(scenario, name) for name in settings["figure"]["observers"]
        }
        study = self._study(settings["figure"]["study"]) if "study" in settings else None
        data = figure_data(self.ledger.paper, settings, plant, estimates, study)
        metrics = measure(self.ledger.paper, data)
        self.made[f"metrics {figure}"] = metrics
        return Evaluation(plant, estimates, study, metrics)

    def theory(self) -> list[Metric]:
        """The numbers of the paper's theory; none if the ledger has no section for it.

        Raises
        ------
        InputError
            If a value of the ledger cannot be used.
        """
        if "theory" not in self.ledger.tree:
            return []
        settings = self.ledger.settings("theory")

        def compute() -> Any:
            designs = {name: self._design({"design": name})[0] for name in settings["designs"]}
            with located(f"{self.ledger.paper}.theory"):
                return paper_module(self.ledger.paper, "theory").measure(settings, designs)

        found: list[Metric] = self._once("theory", settings, compute)
        return found

    def table(self, table: str) -> list[dict[str, Any]]:
        """The rows of one table.

        Raises
        ------
        InputError
            If the ledger has no such table or a value in it cannot be used.
        """
        settings = self.ledger.settings("table", table)
        design = self._design(settings["table"])
        with located(f"{self.ledger.paper}.tables.{table}"):
            rows: list[dict[str, Any]] = paper_module(self.ledger.paper, "table").rows(
                settings, *design
            )
        self.made[f"table {table}"] = rows
        return rows

    def refined(self) -> Evaluator:
        """The same with every numerical step halved; what no step enters is not computed again."""
        return Evaluator(self.ledger.refined(), self._done)

    def sibling(self, ledger: Ledger) -> Evaluator:
        """For another ledger of the paper: it starts from what is computed here, and keeps its own.

        What differs from this one's ledger is computed anew and forgotten with the sibling.
        """
        return Evaluator(ledger, dict(self._done))

    def _once(self, name: str, settings: Any, compute: Callable[[], Any]) -> Any:
        """What a stage gives: its name, all that it sees, and how it is computed if it is not."""
        key = digest([name.split(maxsplit=1)[0], settings])
        if key not in self._done:
            self._done[key] = compute()
        self.made[name] = self._done[key]
        return self._done[key]

    def _design(self, body: dict[str, Any]) -> list[dict[str, Any]]:
        """The design that an observer, a study or a table names; empty without one."""
        if "design" not in body:
            return []
        name = body["design"]
        settings = [name, self.ledger.settings("design", name)]
        return [self._once(f"design {name}", settings, lambda: compute_design(self.ledger, name))]

    def _plant(self, scenario: str) -> Series:
        settings = self.ledger.settings("plant", scenario)

        def simulate() -> Any:
            with located(self.ledger.paper):
                return paper_module(self.ledger.paper, "plant").simulate(settings)

        series: Series = self._once(f"plant {scenario}", settings, simulate)
        return series

    def _estimate(self, scenario: str, observer: str) -> Series:
        settings = self.ledger.settings("observe", scenario, observer)

        def estimate() -> Any:
            design = self._design(settings["observer"])
            plant = self._plant(scenario)
            with located(f"{self.ledger.paper}.observers.{observer}"):
                return paper_module(self.ledger.paper, "observe").estimate(settings, plant, *design)

        inputs = [settings, self.ledger.settings("plant", scenario)]
        series: Series = self._once(f"observe {scenario} {observer}", inputs, estimate)
        return series

    def _study(self, study: str) -> list[dict[str, Any]]:
        settings = self.ledger.settings("study", study)

        def run() -> Any:
            design = self._design(settings["study"])
            plant = self._plant(settings["study"]["scenario"])
            with located(self.ledger.paper):
                return paper_module(self.ledger.paper, "study").run(settings, plant, *design)

        rows: list[dict[str, Any]] = self._once(f"study {study}", settings, run)
        return rows


def evaluate(ledger: Ledger, figure: str) -> Evaluation:
    """Everything behind one figure of a ledger; see `Evaluator.figure`."""
    return Evaluator(ledger).figure(figure)
