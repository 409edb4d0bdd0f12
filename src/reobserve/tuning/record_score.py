"""The score of a method on one record.

The error is the root of sum |estimate - truth|^2 over sum |truth|^2: an estimate of zero has 1. A
record that states its ``size`` has that in place of the root mean square of its truth.
Nothing counts as more than `WORST`, which is also the error of a run that failed.

The normalised squared error of estimates with covariances P (NEES) is the mean over rows of
(estimate - truth)^T P^-1 (estimate - truth) / q for q components, which is 1 if P is right
(Bar-Shalom, Li & Kirubarajan 2001, 5.4). Rows in which P is singular are left out, such as a start
that is known exactly.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from reobserve.core.errors import InputError
from reobserve.tuning.task import Array, Estimates, Runner, Task, TaskRecord

WORST = 3.0
_SINGULAR = 1e-12  # the smallest eigenvalue of the correlations in a row that counts


@dataclass(frozen=True)
class Score:
    """Score of a record: error, lag [s], and 95 % quantile of |error| over rms of truth.

    ``nees`` is the mean normalised squared error of a component, nan without covariances. Of a
    detector, ``missed`` is 1 if it has not alarmed in time, else 0. ``redrawn`` are errors for
    other draws of what all records of a condition have in common, such as a threshold.
    """

    error: float
    lag: float = np.nan
    quantile: float = np.nan
    failed: bool = False
    nees: float = np.nan
    missed: float = np.nan
    redrawn: tuple[float, ...] = ()


def score(run: Runner, record: TaskRecord, since: float, *, details: bool = True) -> Score:
    """Compare an estimate with ``record.truth``, of the same shape, from ``since`` [s] on.

    Without ``details`` there is only the error: the lag takes as long as many methods.
    """
    result = run(record)
    estimate = result.values if isinstance(result, Estimates) else result
    if not np.isfinite(estimate).all():
        return Score(np.nan, failed=True)
    first = int(np.searchsorted(record.time, since - 1e-9))
    wrong = np.linalg.norm(estimate - record.truth, axis=1)[first:]
    power = len(wrong) * record.size**2 if record.size else float((record.truth[first:] ** 2).sum())
    error = min(np.sqrt(float((wrong**2).sum()) / power), WORST)
    if not details:
        return Score(float(error))
    rms = np.sqrt(power / len(wrong))
    lag = _lag(estimate, record.truth, first) * float(np.median(np.diff(record.time)))
    nees = _nees(result, record.truth, first) if isinstance(result, Estimates) else np.nan
    return Score(float(error), lag, float(np.quantile(wrong, 0.95) / rms), nees=nees)


def _nees(result: Estimates, truth: Array, first: int) -> float:
    shapes, q = (truth.shape, (*truth.shape, truth.shape[1])), truth.shape[1]
    if result.covariances.shape not in shapes:
        problem = f"have the shape {result.covariances.shape}, must have {shapes[0]} or {shapes[1]}"
        raise InputError("covariances", problem)
    wrong, covariances = (result.values - truth)[first:], result.covariances[first:]
    if covariances.ndim == 2:
        covariances = covariances[:, :, None] * np.eye(q)
    scale = np.sqrt(np.maximum(np.einsum("kii->ki", covariances), 0.0))
    safe = np.where(scale > 0, scale, 1.0)
    correlations = covariances / (safe[:, :, None] * safe[:, None, :])
    definite = np.linalg.eigvalsh(correlations)[:, 0] > _SINGULAR
    if not definite.any():
        return np.nan
    wrong, correlations = (wrong / safe)[definite], correlations[definite]
    solved = np.linalg.solve(correlations, wrong[:, :, None])[:, :, 0]
    return float((wrong * solved).sum() / wrong.size)


def _lag(estimate: Array, truth: Array, first: int) -> float:
    """The number of samples by which the truth must be delayed to fit best: the first minimum."""

    def misfit(shift: int) -> float:
        late = truth[max(first - shift, 0) : len(truth) - shift]
        off = (estimate[len(estimate) - len(late) :] - late).ravel()
        return float(off @ off) / len(off)

    shift, before, here, after = 0, np.inf, misfit(0), misfit(1)
    while after < here and shift < len(truth) // 4:
        shift += 1
        before, here, after = here, after, misfit(shift + 1)
    if not np.isfinite(before):
        return 0.0
    # The vertex of a parabola through the three, unless they are on a line.
    bend = before - 2 * here + after
    return shift + (0.5 * (before - after) / bend if bend else 0.0)


def score_of(task: Task, run: Runner, record: TaskRecord, *, details: bool = True) -> Score:
    """The score of a method on a record, by the task's own ``score`` if it has one."""
    scored: Callable[..., Score] = getattr(task.module, "score", score)
    return scored(run, record, task.scored_from, details=details)
