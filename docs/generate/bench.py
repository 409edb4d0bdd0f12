"""Results of the bench for the pages, from the golden tables.

A sentence about a condition is about all its rows, given the noise or not, tuned or with a paper's
settings: `Bench.column`, `Bench.within`, `Bench.best` and `Bench.check_all` take them all.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from reobserve.tuning.results import Results
from reobserve.tuning.scoring import PAPER
from reobserve_papers.bench.packaged_task import PackagedTask
from reobserve_papers.plotting.style_context import own_style

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

    def column(self, condition: str, *, given: bool | None = None) -> dict[str, Mapping[str, Any]]:
        """All rows of the heat map in a condition by label, or those that are given the noise."""
        cells = {
            label: self.results.cell(condition, name, training, knows)
            for label, name, training, knows in self.results.rows()
            if given is None or given == knows
        }
        return {label: cell for label, cell in cells.items() if cell is not None}

    def within(self, condition: str) -> dict[str, list[str]]:
        """The labels of all rows by whether they are within 5 % of the best: yes, no, undecided."""
        found: dict[str, list[str]] = {"yes": [], "no": [], "undecided": []}
        for label, cell in self.column(condition).items():
            found[cell["within"]].append(label)
        return found

    def best(self, condition: str, key: str = "error") -> str:
        """The label of the row with the smallest error, lag, share of misses or other number."""
        column = self.column(condition)
        return min(column, key=lambda label: float(column[label][key]))

    def near(self, condition: str, *, given: bool | None = None) -> set[str]:
        """The labels of all rows that are not known to be more than 5 % worse than the best."""
        column = self.column(condition, given=given)
        return {label for label, cell in column.items() if cell["within"] in ("yes", "undecided")}

    def rest(
        self, condition: str, *methods: str, given: bool | None = None
    ) -> list[Mapping[str, Any]]:
        """All rows but those of methods and those that read what comes later, by error."""
        cells = self.column(condition, given=given).values()
        found = [one for one in cells if one["method"] not in methods and one["within"] != "late"]
        return sorted(found, key=lambda one: float(one["error"]))

    def against(self, condition: str, method: str, *beside: str, given: bool | None = None) -> str:
        """The error of a method and the smallest of the rest, all of them more than 5 % worse.

        The methods in ``beside`` are not compared with: the sentence must say so.
        """
        own, rest = self(method, condition), self.rest(condition, method, *beside, given=given)
        better = [one for one in rest if one["within"] != "no" or one["error"] <= own]
        assert not better, (condition, method, better)
        return f"{own:#.3g} against {rest[0]['error']:#.3g} or more"

    def nees(self, condition: str = "nominal") -> dict[str, float]:
        """The mean normalised squared errors of all rows that state a variance, by label."""
        column = self.column(condition)
        return {label: one["nees"] for label, one in column.items() if one["nees"] == one["nees"]}

    def cost_of_r(self, condition: str = "nominal", *, given: bool = False) -> list[float]:
        """How much greater errors are if R is estimated, in per cent; ``given``: than given R."""
        methods = self.results.task.methods
        return [
            100 * (self(f"{one}_R", condition) / self(one, condition, given=given) - 1)
            for one in methods
            if f"{one}_R" in methods
        ]

    def check_all(
        self,
        holds: Callable[[Mapping[str, Any]], bool],
        *conditions: str,
        given: bool | None = None,
        but: Iterable[str] = (),
    ) -> None:
        """Assert that something holds for all rows of conditions, and for no row in ``but``.

        Without conditions, in all of the table. The labels in ``but`` are the exceptions that the
        sentence names: they must be ones.
        """
        for condition in conditions or self.results.task.table:
            found = {k for k, one in self.column(condition, given=given).items() if not holds(one)}
            assert found == set(but), (condition, sorted(found ^ set(but)))

    def shares(self, key: str, condition: str, *, given: bool | None = None) -> dict[str, float]:
        """For all rows the share of records that is ``missed`` or in ``quantile``, in per cent."""
        column = self.column(condition, given=given)
        return {label: 100 * float(cell[key]) for label, cell in column.items()}

    def tuned_again(self, key: str, condition: str, training: str) -> dict[str, float]:
        """A number of all methods that another training set tuned, by label; shares in per cent."""
        found = {}
        for name, method in self.results.task.methods.items():
            cell = self.results.cell(condition, name, training, method.given_noise)
            if cell is not None:
                found[method.label] = float(cell[key]) * (1 if key == "error" else 100)
        return found

    def noises(self) -> list[tuple[dict[str, float], dict[str, float]]]:
        """At each other noise, the errors of all methods, and of those that are given it."""
        conditions = self.results.task.conditions
        changed = (one for one in conditions if one.startswith("noise"))
        return [(self.errors(one), self.errors(one, given=True)) for one in changed]

    def ratio(self, method: str, condition: str = "nominal", *, given: bool = False) -> str:
        """Its ratio to the best in the condition, with the interval of 95 %."""
        cell = self.results.cell(condition, method, given=given)
        assert cell is not None, (method, condition, given)
        low, high = math.floor(100 * cell["ratio_low"]), math.ceil(100 * cell["ratio_high"])
        return f"{cell['ratio']:.2f} [{low / 100:.2f}, {high / 100:.2f}]"

    def late(self, *methods: str) -> str:
        """By how many milliseconds estimates of tuned methods are late, as tuned."""
        cells = [self.results.cell("nominal", one) for one in methods]
        found = {round(1000 * float(cell["lag"])) for cell in cells if cell is not None}
        return " to ".join(str(one) for one in sorted({min(found), max(found)}))

    def spread(self, condition: str, *methods: str) -> float:
        """The largest error of methods, or of all, over the smallest, minus one, in per cent."""
        found = self.errors(condition)
        errors = [found[one] for one in methods or found]
        return 100 * (max(errors) / min(errors) - 1)

    def heat_map(self) -> Figure:
        """Methods by conditions."""
        with own_style():
            from reobserve_papers.bench.bench_figures import heat_map

            return heat_map(self.results)
