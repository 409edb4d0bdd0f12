"""The chain in one process: each step asks for the results it reads, and runs once.

Golden tests, Monte Carlo samples and `reobserve_papers.replicate` call it. It calls the same
functions of a paper, with the same settings, as the rules of the workflow.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from reobserve.core.errors import located
from reobserve.core.seals import digest
from reobserve_papers.metrics.metrics import Metric, lookup
from reobserve_papers.metrics.theory_parts import only
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.signals.series import Series
from reobserve_papers.steps.chain import Step, reads
from reobserve_papers.steps.compute import paper_module, read_study, run_step
from reobserve_papers.steps.figures import behind_figure, figure_data, measure, rows_from

if TYPE_CHECKING:
    import pandas as pd

    from reobserve_papers.plotting.figures import PaperFigure


@dataclass(frozen=True, repr=False)
class Replication:
    """A figure of a paper, recomputed.

    Attributes
    ----------
    parameters
        The parameters of the paper, overrides included.
    figure
        The name of the figure.
    plant
        The record of the simulated plant: `Series` with one row per sample.
    estimates
        The estimates of each observer, by its name.
    rows
        The rows of the figure's study; None if it has none.
    numbers
        The metrics, in the order of the figure.
    """

    parameters: Parameters
    figure: str
    plant: Series
    estimates: Mapping[str, Series]
    rows: list[dict[str, Any]] | None
    numbers: list[Metric]

    def __repr__(self) -> str:
        observers = ", ".join(self.estimates)
        count = len(self.numbers)
        return f"<{self.figure} of {self.parameters.paper}: observers {observers}; {count} metrics>"

    @cached_property
    def metrics(self) -> pd.DataFrame:
        """The metrics as a table: observer, metric, value, unit."""
        return _frame([vars(number) for number in self.numbers])

    @cached_property
    def study(self) -> pd.DataFrame | None:
        """The study of the figure as a table, or None if it has none."""
        return None if self.rows is None else _frame(self.rows)

    def plot(self, *, notes: bool = True) -> PaperFigure:
        """The figure as the workflow draws it, a `matplotlib.figure.Figure` in the default style.

        ``notes`` says whether the remarks below the panels are drawn.
        """
        from reobserve_papers.plotting.style_context import own_style

        with own_style():
            return draw(self, notes=notes)


def draw(figure: Replication, *, notes: bool) -> PaperFigure:
    """Draw a figure in the style that is in use, and fix its layout."""
    from reobserve_papers.plotting.fitting import fix_layout

    paper = figure.parameters.paper
    settings = figure.parameters.settings("plot", figure.figure)
    data = figure_data(figure.parameters, settings, figure.plant, figure.estimates, figure.rows)
    layouts = paper_module(figure.parameters.package, "plot").LAYOUTS
    with located(f"{paper}.figures.{figure.figure}"):
        drawn: PaperFigure = layouts[data.job.figure.layout](
            replace(data, metrics=lookup(figure.numbers))
        )
    fix_layout(drawn, notes=notes)
    return drawn


def _frame(rows: Iterable[Mapping[str, Any]]) -> pd.DataFrame:
    from reobserve.core.extras import package

    pandas = package("pandas", "show metrics as a table")
    table: pd.DataFrame = pandas.DataFrame(list(rows))
    return table


@dataclass
class Evaluator:
    """Evaluates the figures, tables and the theory of one paper.

    A result is stored under a digest of the settings of its step and of all steps it reads, so
    siblings with other parameters share what they have in common. ``made`` holds the results by
    step and name, such as ``plant constant`` or ``observe constant sampled``.
    """

    parameters: Parameters
    _done: dict[str, Any] = field(default_factory=dict)
    _files: dict[str, Path] = field(default_factory=dict, repr=False)  # of results read from files
    made: dict[str, Any] = field(default_factory=dict, init=False)
    _keys: dict[Step, str] = field(default_factory=dict, init=False, repr=False)

    def figure(self, figure: str) -> Replication:
        """The results behind one figure."""
        settings = self.parameters.settings("metrics", figure)
        needs = reads(self.parameters, "metrics", figure)
        results = {need: self.result(*need) for need in needs}
        plant, estimates, rows = behind_figure(results)
        study = next((need for need in needs if need[0] == "study"), None)
        data = figure_data(self.parameters, settings, plant, estimates, rows)
        with rows_from(self._files.get(self.key(*study)) if study else None):
            numbers = measure(self.parameters, data)
        self.made[f"metrics {figure}"] = numbers
        return Replication(self.parameters, figure, plant, estimates, rows, numbers)

    def theory(self, asked: frozenset[str] | None = None) -> list[Metric]:
        """The metrics of the paper's theory, or none if it has no such section.

        Metrics whose names are not in ``asked`` may be left out.
        """
        if "theory" not in self.parameters.tree:
            return []
        metrics: list[Metric]
        if asked is None or self.key("theory") in self._done:
            metrics = self.result("theory")
            return metrics
        key = f"{self.key('theory')} {' '.join(sorted(asked))}"
        if key not in self._done:
            with only(asked):
                self._done[key] = self.run("theory")
        metrics = self._done[key]
        return metrics

    def table(self, table: str) -> list[dict[str, Any]]:
        """The rows of one table (raises as `figure`)."""
        rows: list[dict[str, Any]] = self.result("table", table)
        return rows

    def result(self, *step: str) -> Any:
        """The result of a step, as ``"observe", "constant", "sampled"`` (raises as `figure`)."""
        key = self.key(*step)
        if key not in self._done:
            self._done[key] = self.run(*step)
        self.made[" ".join(step)] = self._done[key]
        return self._done[key]

    def key(self, *step: str) -> str:
        """A digest of the parameters that a step depends on, itself and through what it reads."""
        if step not in self._keys:
            name, *names = step
            settings = self.parameters.settings(name, names[-1] if names else "")
            needs = [self.key(*need) for need in reads(self.parameters, *step)]
            self._keys[step] = digest([name, settings, *needs])
        return self._keys[step]

    def digest(self, figure: str | None) -> str:
        """A digest of the parameters that a figure's metrics depend on. None is the theory."""
        return self.key("theory") if figure is None else self.key("metrics", figure)

    def refined(self) -> Evaluator:
        """An evaluator of the same parameters with every numerical step halved."""
        return self.sibling(self.parameters.refined())

    def sibling(self, parameters: Parameters) -> Evaluator:
        """An evaluator of other parameters of the paper, which shares all results."""
        return Evaluator(parameters, self._done, self._files)

    def isolated(self) -> Evaluator:
        """A copy that starts from the results so far and keeps new ones to itself."""
        return Evaluator(self.parameters, dict(self._done), self._files)

    def take_study(self, study: str, path: Path) -> None:
        """Read one study from a file, or `InputError` if that is missing or damaged."""
        key = self.key("study", study)
        self._done[key], self._files[key] = read_study(self.parameters.package, path), path

    def run(self, step: str, *names: str) -> Any:
        """Compute the result of a step from those that it reads. `result` computes each once."""
        inputs = [self.result(*need) for need in reads(self.parameters, step, *names)]
        return run_step(self.parameters, step, ("", *names)[-1], inputs)


def evaluate(parameters: Parameters, figure: str) -> Replication:
    """The results behind one figure (see `Evaluator.figure`)."""
    return Evaluator(parameters).figure(figure)
