"""Scores of tuned methods on held-out records, with paired intervals.

A row is compared with the best of the others in a condition by the ratio of geometric means over
the same held-out seeds. More seeds are drawn until the ratio's interval of 95 % says of each row
whether it is within 5 % of the best (`reobserve.tuning.intervals`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from reobserve.core.errors import InputError, one_line
from reobserve.tuning.intervals import Array, against_others, common_variance, interval
from reobserve.tuning.record_score import WORST, Score, score_of
from reobserve.tuning.search import FAILURES, SMALLEST, Settings
from reobserve.tuning.task import Runner, Task
from reobserve.tuning.tuned_file import Repeat, TunedMethod

DECIDED = 0.05  # of the best: what is nearer to it is as good
# In place of a training set: a paper's own settings, and those of a search that goes on.
PAPER, EARLY = "paper", "early"


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
    """A row in a condition: geometric means over seeds, and the ratio to the best other row.

    ``error`` and ``ratio`` are (value, low, high) with the ends of intervals of 95 %; ``first`` is
    the error on the first held-out seeds, which all conditions share; ``repeats`` are the smallest
    and the largest error of the repeats of a tuning on the same seeds, where it was tuned for this.
    """

    row: ScoredRow
    condition: str
    scores: tuple[Score, ...]
    error: tuple[float, ...]
    first: float
    ratio: tuple[float, ...]
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
        fails = row.training in (PAPER, EARLY) or condition in self.task.methods[row.method].fails
        if one.failed and not fails:
            problem = f"fails in the condition {condition}, seed {seed}: {why}"
            raise InputError(f"{self.task.file}: {self.task.place}.{row.method}", problem)
        return replace(one, error=WORST) if one.failed else one

    def mean(self, row: ScoredRow, conditions: Iterable[str], count: int = 0) -> float:
        """The geometric mean of the error over conditions and the first so many held-out seeds."""
        count = count or self.task.seeds.step
        errors = [
            one.error for each in conditions for one in self.scores(row, each, count, details=False)
        ]
        return float(np.exp(np.mean(np.log(errors))))

    def best_repeat(self, method: str, training: str, repeats: Sequence[Repeat]) -> Repeat:
        """The repeat with the smallest error on the training records of all repeats."""

        def error(repeat: Repeat) -> float:
            row = ScoredRow.of(method, EARLY, repeat.settings, given=True)  # as in its training
            seeds = [s for k in range(len(repeats)) for s in self.task.training_seeds(k)]
            scores = [
                self._score(row, condition, seed, False)
                for condition in self.task.training[training].conditions
                for seed in seeds
            ]
            return float(np.mean([np.log(max(score.error, SMALLEST)) for score in scores]))

        return min(repeats, key=error) if repeats[1:] else repeats[0]

    def compared(self, rows: Sequence[ScoredRow], condition: str) -> list[Cell]:
        """Rows on the same seeds: in the conditions of the table until all is decided.

        The best is one of the rows of the table: of the main training set, or the paper's own.
        """
        seeds = self.task.seeds
        most = seeds.most if condition in self.task.table else seeds.step
        causal = [self.task.methods[row.method].causal for row in rows]
        shown = [row.training in (self.task.main, PAPER) for row in rows]
        listed = [k for k in range(len(rows)) if shown[k] and causal[k]]
        anytime = most >= 2 * seeds.step
        for count in range(seeds.step, most + 1, seeds.step):
            scores = [self.scores(row, condition, count) for row in rows]
            logs = np.log([[max(score.error, SMALLEST) for score in each] for each in scores])
            redrawn = _redrawn(scores)
            cells = [
                Cell(
                    row, condition, scores[k],
                    interval(logs[k], anytime=anytime, more=common_variance(redrawn, k)),
                    float(np.exp(logs[k, : seeds.step].mean())),
                    against_others(logs, k, listed, anytime=anytime, redrawn=redrawn),
                    causal=causal[k],
                )
                for k, row in enumerate(rows)
            ]  # fmt: skip
            if all(cells[k].within != "undecided" for k in listed):
                break
        return cells


def _redrawn(scores: Sequence[Sequence[Score]]) -> Array | None:
    """Logarithms of errors, shape (draws, rows, records), if all scores have some."""
    draws = [[score.redrawn for score in each] for each in scores]
    if len({len(draw) for each in draws for draw in each}) != 1 or not draws[0][0]:
        return None
    return np.asarray(np.log(np.maximum(np.moveaxis(np.array(draws), 2, 0), SMALLEST)))


def score_task(task: Task, tuned: Mapping[str, TunedMethod]) -> list[Cell]:
    """All cells of a task, by condition.

    Of the repeats of a tuning the one with the smallest error on the training records of all of
    them stands for all. Training sets that a method was not tuned on have no rows.

    Raises
    ------
    InputError
        As `Scorer.scores`.
    """
    scorer, main = Scorer(task), task.main
    rows: dict[str, list[ScoredRow]] = {name: [] for name in task.conditions}
    repeated: dict[tuple[ScoredRow, str], list[ScoredRow]] = {}
    for method, entry in task.methods.items():
        for name, training in task.training.items():
            if name not in tuned[method].training:
                continue
            repeats = tuned[method].training[name].repeats
            given = entry.given_noise and name != main  # as in its training
            best = scorer.best_repeat(method, name, repeats)
            row = ScoredRow.of(method, name, best.settings, given=given)
            scored = [*training.conditions, *training.scored]
            for condition in task.conditions if name == main else scored:
                rows[condition].append(row)
                if name == main and entry.given_noise and task.conditions[condition].noise != 1:
                    rows[condition].append(replace(row, given=True))
            if repeats[1:] and len(training.conditions) == 1:
                repeated[row, training.conditions[0]] = [
                    ScoredRow.of(method, name, repeat.settings, given=given) for repeat in repeats
                ]
        if entry.paper is not None:
            for condition in task.table:
                rows[condition].append(ScoredRow.of(method, PAPER, entry.paper.settings))

    def with_repeats(cell: Cell) -> Cell:
        several = repeated.get((cell.row, cell.condition), [])
        count = len(cell.scores)
        errors = [
            cell.error[0] if each == cell.row else scorer.mean(each, [cell.condition], count)
            for each in several
        ]
        return replace(cell, repeats=(min(errors), max(errors)) if errors else None)

    return [
        with_repeats(cell)
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
        return [float(np.log(score.error)) for score in scores]

    ratios = []
    for method in task.methods:
        old, new = (
            [
                ScoredRow.of(method, task.main, repeat.settings)
                for repeat in each.training[task.main].repeats
            ]
            for each in (kept[method], again[method])
        )
        for condition in task.table:
            ratio: tuple[float, ...] = (1.0, 1.0, 1.0)
            if old != new:
                means = [np.mean([logs(row, condition) for row in rows], 0) for rows in (old, new)]
                ratio = interval(np.asarray(means[1] - means[0]))
            ratios.append(ErrorRatio(method, condition, *ratio))
    return ratios
