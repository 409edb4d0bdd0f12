"""Tuning of the methods of a task, on its training sets."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from reobserve.core.errors import located
from reobserve.tuning.record_score import WORST, score_of
from reobserve.tuning.scoring import EARLY, ScoredRow, Scorer
from reobserve.tuning.search import Objective, Settings, Tuned, tune
from reobserve.tuning.task import Task
from reobserve.tuning.tuned_file import Cost, Repeat, TunedMethod, TunedOn

CHECKPOINTS = (10, 25, 50, 100, 200, 400)  # evaluations


def tune_method(
    task: Task, method: str, tell: Callable[[str], None], stored: TunedMethod | None = None,
    *, main_only: bool = False,
) -> TunedMethod:  # fmt: skip
    """Tune a method on all training sets of a task, each as often as it says.

    What is ``stored`` for training sets other than the main one is taken over, unless what decides
    the search has changed in the task file. With ``main_only`` the others are left out then.
    """
    tuned, scorer = {}, Scorer(task)
    for name, training in task.training.items():
        known = stored.training.get(name) if stored and name != task.main else None
        if known and known.digest == task.digest(method, name):
            tuned[name] = known
            continue
        if main_only and name != task.main:
            continue
        repeats = []
        for k in range(training.repeats):
            with located(f"{task.file}: {task.place}.{method}"):
                result = tune(
                    *_search(task, method, name, k), task.budget, task.seed + k, failed=WORST
                )
            repeats.append(_as_repeat(scorer, method, name, result))
            flagged = "".join(f", {setting} at its edge" for setting in result.edges)
            about = f"{task.name}, {method}, {training.title} {k + 1}"
            tell(f"{about}: error {result.score:.4g} on training records{flagged}")
        tuned[name] = TunedOn(task.digest(method, name), repeats)
    return TunedMethod(tuned, _cost(task, method, tuned[task.main].repeats[0].settings))


def objective(task: Task, method: str, training: str, repeat: int, settings: Settings) -> float:
    """The objective of settings on the records of a repeat, as the search computes it."""
    make, _, records, score = _search(task, method, training, repeat)
    return Objective(make, records, score, WORST)(settings)[0]


def _search(task: Task, method: str, training: str, repeat: int) -> tuple[Any, Any, Any, Any]:
    """Arguments of `tune`: make, ranges, records and score.

    Methods are given the noise of the records that they are tuned on.
    """
    conditions = task.training[training].conditions
    ranges = task.methods[method].ranges.items()
    return (
        lambda settings: {key: task.make(method, settings, key, given=True) for key in conditions},
        {name: (*value.range, value.scale) for name, value in ranges},
        [(name, task.record(name, k)) for name in conditions for k in task.training_seeds(repeat)],
        lambda runs, pair: score_of(task, runs[pair[0]], pair[1], details=False).error,
    )


def _as_repeat(scorer: Scorer, method: str, training: str, result: Tuned) -> Repeat:
    task, held_out = scorer.task, {}
    given = task.methods[method].given_noise
    for count in (*(n for n in CHECKPOINTS if n < task.budget), task.budget):
        settings, last = result.after(count), count == task.budget
        row = ScoredRow.of(method, training if last else EARLY, settings, given=given)
        error = scorer.mean(row, task.training[training].conditions)
        held_out[str(count)] = float(f"{error:.6g}")
    return Repeat(result.settings, result.objective, result.edges, held_out)


def _cost(task: Task, method: str, settings: Settings) -> Cost:
    """The minimum of several, as others use the machine."""
    condition = task.training[task.main].conditions[0]
    record = task.record(condition, task.held_out_seeds(1)[0])
    forget: Callable[[], None] = getattr(task.module, "forget", lambda: None)
    made, ran = [], []
    for _ in range(7):
        forget()
        began = time.perf_counter()
        run = task.make(method, settings, condition, given=False)
        made.append(time.perf_counter() - began)
        began = time.perf_counter()
        run(record)
        ran.append(time.perf_counter() - began)
    sample = 1e6 * min(ran) / len(record.time)
    return Cost(float(f"{1e3 * min(made):.2g}"), float(f"{sample:.2g}"))
