"""How far each tuned number may move, alone, before a quoted value leaves its band."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from reobserve.core.documents import read_json
from reobserve.core.errors import InputError
from reobserve.core.validation import parse
from reobserve.papers.imm.study_rows import TUNED
from reobserve.papers.imm.tuning import Calibration, Trial
from reobserve.replication.parameters.job import Job
from reobserve.signals.series import Series

Row = tuple[str, str, float, int, str, float, str]

QUANTITIES = ("normal_after", "leakage_after", "normal_before")
THREADS = 2


def run(job: Job, plant: Series) -> list[Row]:
    """For each tuned number and factor the mean probabilities of all banks; and the search's count.

    Raises
    ------
    InputError
        If the search's kept result cannot be read.
    """
    study = job.study
    kept = read_kept(Path(study.kept))
    calibration = Calibration(job.plant, job.observers, job.metrics, plant)
    stated = calibration.stated()
    rows: list[Row] = [
        ("search", "kept", 1.0, 0, name, float(getattr(kept, name)), "1")
        for name in ("trials", "tuned", "targets", "distance")
    ]
    same = all(
        np.isclose(kept.found[name], value, rtol=1e-9, atol=0.0)
        for name, value in zip(TUNED, stated, strict=True)
    )
    rows.append(("search", "kept", 1.0, 0, "as_found", float(same), "1"))
    tasks = [(None, 1.0)] + [
        (index, level)
        for index in range(len(TUNED))
        for factor in study.factors
        for level in (1.0 / factor, factor)
    ]

    def trial(task: tuple[int | None, float]) -> Trial:
        numbers = stated.copy()
        if task[0] is not None:
            numbers[task[0]] *= task[1]
        return calibration.try_out(numbers)

    with ThreadPoolExecutor(THREADS) as pool:
        for (index, level), found in zip(tasks, pool.map(trial, tasks), strict=True):
            rows += trial_rows("stated" if index is None else TUNED[index], level, found)
    return rows


def trial_rows(sweep: str, level: float, trial: Trial) -> Iterator[Row]:
    """What came of a trial: the distance, and the mean probabilities of each bank."""
    yield "all", sweep, level, 0, "distance", trial.distance, "1"
    for name, means in trial.means.items():
        for quantity, mean in zip(QUANTITIES, means, strict=True):
            yield name, sweep, level, 0, quantity, mean, "1"


@dataclass(frozen=True)
class KeptSearch:
    """What `reobserve.papers.imm.search.run` returns."""

    found: dict[str, float]
    distance: float
    worst_nearby: float
    means: dict[str, tuple[float, float, float]]
    trials: int
    tuned: int
    targets: int
    history: tuple[tuple[int, float], ...]
    outside: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class _Stored:
    search: KeptSearch
    provenance: dict[str, Any] | None = None


def read_kept(path: Path) -> KeptSearch:
    """The result of a search, as it is kept.

    Raises
    ------
    InputError
        If the file is missing or damaged, or none of a search's.
    """
    kept = parse(_Stored, read_json(path), str(path)).search
    if set(kept.found) != set(TUNED):
        raise InputError(str(path), "holds other numbers than the search tunes; run it anew")
    return kept
