"""Results of the bench for the pages, from the golden tables."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from reobserve.tuning.scoring import PAPER
from reobserve.tuning.table import Results
from reobserve_papers.bench.packaged_task import PackagedTask
from reobserve_papers.plotting.apart import own_style

ROOT = Path(__file__).parents[2]


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

    def ratio(self, method: str, condition: str = "nominal") -> str:
        """Its ratio to the best in the condition, with the interval of 95 %."""
        cell = self.results.cell(condition, method)
        assert cell is not None, (method, condition)
        return f"{cell['ratio']:.2f} [{cell['ratio_low']:.2f}, {cell['ratio_high']:.2f}]"

    def spread(self, condition: str, *methods: str) -> float:
        """The largest error of methods over the smallest, minus one, in per cent."""
        errors = [self(one, condition) for one in methods]
        return 100 * (max(errors) / min(errors) - 1)

    def heat_map(self) -> Figure:
        """Methods by conditions."""
        with own_style():
            from reobserve_papers.bench.plot import heat_map

            return heat_map(self.results)
