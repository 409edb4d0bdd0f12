"""Scores of tuned methods on held-out records, with paired intervals.

A method is compared with the best in a condition by the ratio of geometric means over the same
held-out seeds. More seeds are drawn until the ratio's interval of 95 % excludes 1 or is within 5 %.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError, one_line
from reobserve.core.random_streams import random_stream
from reobserve.tuning.record_score import WORST, Score, score_of
from reobserve.tuning.search import FAILURES, Settings
from reobserve.tuning.task import Array, Runner, Task
from reobserve.tuning.tuned_file import TunedMethod

DECIDED = 0.05  # half the width of an interval of log ratio
# In place of a training set: a paper's own settings, and those of a search that goes on.
PAPER, EARLY = "paper", "early"
_RESAMPLES = 1000
_FEW = 16  # records


@dataclass(frozen=True)
class ScoredRow:
    """Settings that are scored: of a method, tuned on a training set, perhaps given the noise."""

    method: str
    training: str
    settings: tuple[tuple[str, float], ...]
    given: bool = False

    @classmethod
    def of(
        cls, method: str, training: str, settings: Settings, *, given: bool = False
    ) -> ScoredRow:
        """A row with these settings."""
        return cls(method, training, tuple(settings.items()), given)


@dataclass(frozen=True)
class Cell:
    """A row in a condition: geometric means over seeds, and the ratio to the best of the tuned.

    ``error`` and ``ratio`` are (value, low, high) with the ends of intervals of 95 %; ``first`` is
    the error on the first held-out seeds, which all conditions share; ``repeats`` are the smallest
    and the largest error of the repeats of a tuning, where it was tuned for this.
    """

    row: ScoredRow
    condition: str
    scores: tuple[Score, ...]
    error: tuple[float, float, float]
    first: float
    ratio: tuple[float, float, float]
    repeats: tuple[float, float] | None = None
    causal: bool = True

    @property
    def within(self) -> str:
        """Decide if it is within 5 % of the best: yes, no or undecided, late if not causal."""
        if not self.causal:
            return "late"
        _, low, high = self.ratio
        return "yes" if high <= 1 + DECIDED else "no" if low > 1 + DECIDED else "undecided"


class Scorer:
    """Scores of rows of a task on held-out records, without simulating or running one twice."""

    def __init__(self, task: Task) -> None:
        self.task = task
        self._record, self._run, self._score = (
            cache(task.record),
            cache(self._made),
            cache(self._one),
        )

    def scores(
        self, row: ScoredRow, condition: str, count: int, *, details: bool = True
    ) -> tuple[Score, ...]:
        """Scores on the first so many held-out seeds, perhaps without lag and quantile.

        Raises
        ------
        InputError
            If a run fails in a condition in which the task file does not say that it may.
        """
        seeds = self.task.held_out_seeds(count)
        return tuple(self._score(row, condition, seed, details) for seed in seeds)

    def _made(self, row: ScoredRow, condition: str) -> Runner:
        return self.task.make(row.method, dict(row.settings), condition, given=row.given)

    def _one(self, row: ScoredRow, condition: str, seed: int, details: bool) -> Score:
        run, record = self._run, self._record
        try:
            one = score_of(self.task, run(row, condition), record(condition, seed), details=details)
            why = "an estimate is not finite"
        except FAILURES as error:
            one, why = Score(np.nan, failed=True), one_line(error)
        stated = row.training in (PAPER, EARLY) or condition in self.task.methods[row.method].fails
        if one.failed and not stated:
            problem = f"fails in the condition {condition}, seed {seed}: {why}"
            raise InputError(f"{self.task.file}: {self.task.place}.{row.method}", problem)
        return replace(one, error=WORST) if one.failed else one

    def mean(self, row: ScoredRow, conditions: Iterable[str]) -> float:
        """The geometric mean of the error over conditions and the first held-out seeds."""
        step = self.task.seeds.step
        errors = [
            one.error for each in conditions for one in self.scores(row, each, step, details=False)
        ]
        return float(np.exp(np.mean(np.log(errors))))

    def compared(self, rows: Sequence[ScoredRow], condition: str) -> list[Cell]:
        """Rows on the same seeds: in the conditions of the table until all is decided."""
        seeds = self.task.seeds
        most = seeds.most if condition in self.task.table else seeds.step
        causal = {name for name, one in self.task.methods.items() if one.causal}
        main = [row.training == self.task.main for row in rows]
        tuned = [k for k, row in enumerate(rows) if main[k] and row.method in causal]
        for count in range(seeds.step, most + 1, seeds.step):
            scores = [self.scores(row, condition, count) for row in rows]
            logs = np.log([[one.error for one in each] for each in scores])
            best = logs[min(tuned, key=lambda k: logs[k].mean())]
            ratios = [interval(one - best) for one in logs]
            if all(_is_decided(ratios[k]) for k in tuned):
                break
        return [
            Cell(
                row, condition, each, interval(log), float(np.exp(log[: seeds.step].mean())), ratio,
                causal=row.method in causal,
            )
            for row, each, log, ratio in zip(rows, scores, logs, ratios, strict=True)
        ]


def _is_decided(ratio: tuple[float, float, float]) -> bool:
    _, low, high = ratio
    return not low <= 1 <= high or np.log(high / low) / 2 <= DECIDED


def interval(logs: Array) -> tuple[float, float, float]:
    """The geometric mean of exp(logs), and its interval of 95 %.

    By resampling, or from Student's distribution for fewer than 16: there resampling is too narrow
    (of four normal numbers its intervals hold 80 %).
    """
    if len(logs) < _FEW:
        from scipy.special import stdtrit

        half = stdtrit(len(logs) - 1, 0.975) * logs.std(ddof=1) / np.sqrt(len(logs))
        low, high = logs.mean() - half, logs.mean() + half
    else:
        low, high = np.quantile(logs[_resampled(len(logs))].mean(axis=1), [0.025, 0.975])
    return float(np.exp(logs.mean())), float(np.exp(low)), float(np.exp(high))


@cache
def _resampled(count: int) -> NDArray[np.int64]:
    """Indices, the same for all: shape (resamples, count)."""
    stream = random_stream(1, "bench", "resampling")
    return stream.integers(0, count, (_RESAMPLES, count))


def score_task(task: Task, tuned: Mapping[str, TunedMethod]) -> list[Cell]:
    """All cells of a task, by condition.

    Of the repeats of a tuning the one with the median held-out error stands for all.

    Raises
    ------
    InputError
        As `Scorer.scores`.
    """
    scorer, main = Scorer(task), task.main
    rows: dict[str, list[ScoredRow]] = {name: [] for name in task.conditions}
    spread: dict[tuple[ScoredRow, str], tuple[float, float]] = {}
    for method, stated in task.methods.items():
        for name, training in task.training.items():
            repeats = tuned[method].training[name].repeats
            given = stated.given_noise and name != main  # as in its training
            median = sorted(repeats, key=lambda one: one.error)[len(repeats) // 2]
            row = ScoredRow.of(method, name, median.settings, given=given)
            scored = [*training.conditions, *training.scored]
            for condition in task.conditions if name == main else scored:
                rows[condition].append(row)
                if name == main and stated.given_noise and task.conditions[condition].noise != 1:
                    rows[condition].append(replace(row, given=True))
            if repeats[1:] and len(training.conditions) == 1:
                errors = [one.error for one in repeats]
                spread[row, training.conditions[0]] = (min(errors), max(errors))
        if stated.paper is not None:
            for condition in task.table:
                rows[condition].append(ScoredRow.of(method, PAPER, stated.paper.settings))
    return [
        replace(cell, repeats=spread.get((cell.row, name)))
        for name, listed in rows.items()
        if listed
        for cell in scorer.compared(listed, name)
    ]


@dataclass(frozen=True)
class ErrorRatio:
    """The error in a condition over that with other settings: ratio and interval of 95 %."""

    method: str
    condition: str
    ratio: float
    low: float
    high: float

    @property
    def moved(self) -> bool:
        """True if it differs by more than its interval, and by more than 5 %."""
        return not self.low <= 1 <= self.high and abs(np.log(self.ratio)) > DECIDED


def moved(
    task: Task, kept: Mapping[str, TunedMethod], again: Mapping[str, TunedMethod]
) -> list[ErrorRatio]:
    """Compare settings that were kept with those tuned again, in the conditions of the table.

    Of each method all repeats of the main training set count, on the first held-out records; equal
    settings have equal errors.
    """
    scorer = Scorer(task)

    def logs(row: ScoredRow, condition: str) -> list[float]:
        scores = scorer.scores(row, condition, task.seeds.step)
        return [float(np.log(one.error)) for one in scores]

    found = []
    for method in task.methods:
        old, new = (
            [
                ScoredRow.of(method, task.main, one.settings)
                for one in each.training[task.main].repeats
            ]
            for each in (kept[method], again[method])
        )
        for condition in task.table:
            ratio = (1.0, 1.0, 1.0)
            if old != new:
                means = [np.mean([logs(row, condition) for row in rows], 0) for rows in (old, new)]
                ratio = interval(means[1] - means[0])
            found.append(ErrorRatio(method, condition, *ratio))
    return found
