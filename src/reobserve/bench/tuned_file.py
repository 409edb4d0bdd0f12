"""Tuned settings of a method: how they are found, and the file that keeps them.

`config/bench/tuned/TASK/METHOD.json` has for each training set the digest of what decides the
search, and for each repeat the best settings, their objective on the training records, settings at
an edge of their range, and the best settings after fewer evaluations.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from reobserve.bench.record_score import WORST, score_of
from reobserve.bench.task import Task
from reobserve.bench.tuning import Objective, Settings, Tuned, tune
from reobserve.core.documents import read_json
from reobserve.core.errors import InputError
from reobserve.core.files import write_text
from reobserve.core.validation import parse

CHECKPOINTS = (10, 25, 50, 100, 200, 400)  # evaluations


@dataclass(frozen=True)
class Repeat:
    """One tuning; ``after`` has the best settings after so many evaluations."""

    settings: Settings
    objective: float
    edges: dict[str, str]
    after: dict[str, Settings]


@dataclass(frozen=True)
class TunedOn:
    """The tunings on a training set."""

    digest: str
    repeats: list[Repeat]


@dataclass(frozen=True)
class Cost:
    """Of the tuned method on the machine that tuned it: construction [ms], a sample [us]."""

    construction: float
    sample: float


@dataclass(frozen=True)
class TunedMethod:
    """A file of tuned settings."""

    training: dict[str, TunedOn]
    cost: Cost

    def write(self, path: Path) -> None:
        """Write the file."""
        write_text(path, json.dumps(asdict(self), indent=1, ensure_ascii=False) + "\n")


def read_tuned(task: Task, folder: Path) -> dict[str, TunedMethod]:
    """The tuned settings of all methods of a task.

    Raises
    ------
    InputError
        If a file is missing or damaged, or was tuned for something else than the task file states.
    """
    found = {}
    for method in task.methods:
        path = folder / f"{method}.json"
        found[method] = parse(TunedMethod, read_json(path), str(path))
        for name in task.training:
            kept = found[method].training.get(name)
            if kept is None or kept.digest != task.digest(method, name):
                problem = (
                    f"training.{name} is not of what {task.file} states now: tune again "
                    f"(reobserve bench tune {task.file} {method} --output {path})"
                )
                raise InputError(str(path), problem)
    return found


def tune_method(task: Task, method: str, tell: Callable[[str], None]) -> TunedMethod:
    """Tune a method on all training sets of a task, each as often as it says.

    Raises
    ------
    InputError
        If no settings work.
    """
    found = {}
    for name, training in task.training.items():
        repeats = []
        for k in range(training.repeats):
            one = tune_once(task, method, name, k)
            repeats.append(_kept(one, task.budget))
            flagged = "".join(f", {setting} at its edge" for setting in one.edges)
            tell(f"{task.name}, {method}, {training.title} {k + 1}: {one.score:.4g}{flagged}")
        found[name] = TunedOn(task.digest(method, name), repeats)
    return TunedMethod(found, _cost(task, method, found[task.main].repeats[0].settings))


def tune_once(
    task: Task, method: str, training: str, repeat: int, *, log: Path | None = None, **options: Any
) -> Tuned:
    """Tune a method once, on the records of one repeat; ``options`` are those of `tune`."""
    about = f"{task.name} {task.digest(method, training)} {repeat}"
    return tune(
        *_search(task, method, training, repeat),
        **{"budget": task.budget, "seed": task.seed + repeat, "failed": WORST, **options},
        log=log, about=about,
    )  # fmt: skip


def objective(task: Task, method: str, training: str, repeat: int, settings: Settings) -> float:
    """The objective of settings on the records of a repeat, as the search computes it."""
    make, _, records, score = _search(task, method, training, repeat)
    return Objective(make, records, score, WORST)(settings)[0]


def _search(task: Task, method: str, training: str, repeat: int) -> tuple[Any, Any, Any, Any]:
    """What `tune` takes: make, ranges, records and score.

    Methods are given the noise of the records that they are tuned on.
    """
    conditions = task.training[training].conditions
    ranges = task.methods[method].ranges.items()
    return (
        lambda settings: {one: task.make(method, settings, one, given=True) for one in conditions},
        {name: (*one.range, one.scale) for name, one in ranges},
        [(one, task.record(one, k)) for one in conditions for k in task.training_seeds(repeat)],
        lambda runs, pair: score_of(task, runs[pair[0]], pair[1], with_lag=False).error,
    )


def _kept(one: Tuned, budget: int) -> Repeat:
    after = {str(count): one.after(count) for count in CHECKPOINTS if count < budget}
    return Repeat(one.settings, one.objective, one.edges, after | {str(budget): one.settings})


def _cost(task: Task, method: str, settings: Settings) -> Cost:
    """The least of several, as others use the machine."""
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
    sample = 1e6 * min(ran) / getattr(record, "rows", len(record.time))
    return Cost(float(f"{1e3 * min(made):.2g}"), float(f"{sample:.2g}"))
