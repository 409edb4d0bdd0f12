"""The score of a method on one record.

The error is the root of sum |estimate - truth|^2 over sum |truth|^2: an estimate of zero has 1.
Nothing counts as more than `WORST`, which is also the error of a run that failed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from reobserve.bench.task import Array, Record, Runner, Task

WORST = 3.0


@dataclass(frozen=True)
class Score:
    """Of a record: the error, the lag [s], and the 95 % quantile of |error| over rms of truth."""

    error: float
    lag: float = np.nan
    quantile: float = np.nan
    failed: bool = False


def score(estimate: Array, record: Record, since: float, *, with_lag: bool = True) -> Score:
    """The score of an estimate in the shape of ``record.truth``, from ``since`` [s] on.

    The lag takes as long as many methods; tuning leaves it out.
    """
    first = int(np.searchsorted(record.time, since - 1e-9))
    wrong = np.linalg.norm(estimate - record.truth, axis=1)[first:]
    power = float((record.truth[first:] ** 2).sum())
    error = np.sqrt(float((wrong**2).sum()) / power)
    rms = np.sqrt(power / len(wrong))
    lag = _lag(estimate, record.truth, first) if with_lag else np.nan
    step = float(record.time[1] - record.time[0])
    return Score(min(float(error), WORST), lag * step, float(np.quantile(wrong, 0.95) / rms))


def _lag(estimate: Array, truth: Array, first: int) -> float:
    """By how many samples the truth must be delayed to fit best: the first minimum."""

    def misfit(shift: int) -> float:
        late = truth[max(first - shift, 0) : len(truth) - shift]
        return float(np.mean((estimate[len(estimate) - len(late) :] - late) ** 2))

    shift, before, here, after = 0, np.inf, misfit(0), misfit(1)
    while after < here and shift < len(truth) // 4:
        shift += 1
        before, here, after = here, after, misfit(shift + 1)
    if not np.isfinite(before):
        return 0.0
    # The vertex of a parabola through the three.
    return shift + 0.5 * (before - after) / (before - 2 * here + after)


def score_of(task: Task, run: Runner, record: Record, *, with_lag: bool = True) -> Score:
    """The score of a run, by the task's own ``score`` if it has one."""
    estimate = run(record)
    if not np.isfinite(estimate).all():
        return Score(np.nan, failed=True)
    default = partial(score, with_lag=with_lag)
    scored: Callable[..., Score] = getattr(task.module, "score", default)
    return scored(estimate, record, task.scored_from)
