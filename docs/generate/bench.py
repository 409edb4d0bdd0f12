"""Results of the bench for the pages, from the golden tables."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from matplotlib.figure import Figure

from reobserve.tuning.scoring import PAPER, ScoredRow, Scorer
from reobserve.tuning.table import Results
from reobserve_papers.bench.packaged_task import PackagedTask
from reobserve_papers.plotting.apart import own_style

ROOT = Path(__file__).parents[2]


def extent(numbers: Iterable[float], digits: int = 2) -> str:
    """From the smallest to the largest."""
    found = sorted(numbers)
    return f"{found[0]:.{digits}f} to {found[-1]:.{digits}f}"


class Bench:
    """The accepted results of a task."""

    def __init__(self, task: str) -> None:
        table = ROOT / f"tests/golden/bench/{task}.csv"
        self.results = Results.read(
            PackagedTask.read(ROOT / f"config/bench/{task}.yaml"),
            table,
            ROOT / f"config/bench/tuned/{task}",
        )

    def __call__(
        self, method: str, condition: str = "nominal", training: str = "", *, given: bool = False
    ) -> float:
        """The normalised error of a method; ``given``: with the noise of the condition."""
        if training not in ("", PAPER):  # what is tuned again knows the noise, if it can be given
            given = self.results.task.methods[method].given_noise
        cell = self.results.cell(condition, method, training, given)
        assert cell is not None, (method, condition, training, given)
        return float(cell["error"])

    def errors(
        self, condition: str = "nominal", training: str = "", *, given: bool = False
    ) -> dict[str, float]:
        """The normalised errors of all methods; ``given``: of those that can be given the noise."""
        return {
            name: self(name, condition, training, given=given)
            for name, method in self.results.task.methods.items()
            if method.given_noise or not given
        }

    def noises(self) -> list[tuple[dict[str, float], dict[str, float]]]:
        """At each other noise, the errors of all methods, and of those that are given it."""
        conditions = self.results.task.conditions
        changed = (one for one in conditions if one.startswith("noise"))
        return [(self.errors(one), self.errors(one, given=True)) for one in changed]

    def tunings(self, condition: str, *methods: str) -> list[list[float]]:
        """The normalised errors with the settings of each repeat of the tuning."""
        scorer = Scorer(self.results.task)
        return [
            [
                scorer.mean(ScoredRow.of(method, "nominal", one.settings), [condition])
                for one in self.results.tuned[method].training["nominal"].repeats
            ]
            for method in methods
        ]

    def false_alarms(self, condition: str, *, given: bool = False) -> dict[str, float]:
        """For each detector the share of healthy records that alarm, in per cent."""
        cells = (row for row in self.results.cells if row["condition"] == condition)
        said = "yes" if given else "no"
        return {row["method"]: 100 * row["quantile"] for row in cells if row["given_noise"] == said}

    def ratio(self, method: str, condition: str = "nominal", *, given: bool = False) -> str:
        """Its ratio to the best in the condition, with the interval of 95 %."""
        cell = self.results.cell(condition, method, given=given)
        assert cell is not None, (method, condition, given)
        return f"{cell['ratio']:.2f} [{cell['ratio_low']:.2f}, {cell['ratio_high']:.2f}]"

    def spread(self, condition: str, *methods: str) -> float:
        """The largest error of methods, or of all, over the smallest, minus one, in per cent."""
        found = self.errors(condition)
        errors = [found[one] for one in methods or found]
        return 100 * (max(errors) / min(errors) - 1)

    def heat_map(self) -> Figure:
        """Methods by conditions."""
        with own_style():
            from reobserve_papers.bench.plot import heat_map

            return heat_map(self.results)
