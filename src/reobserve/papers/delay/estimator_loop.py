"""The compiled loop of the estimators of an input delay that are differential equations.

The estimate of the delay, the first of the values, is projected: at a bound it is held as long as
its law would take it out. Free and held are different right-hand sides, so a step that would run
from one into the other is cut where that happens: the instant is found by bisection, and each part
is a step of the classical Runge-Kutta method. This keeps the order, and the delay inside its
bounds. In the parts of a cut step x is read from the parabola through its three samples.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from reobserve.core.direct_call import call
from reobserve.core.kernel import FunctionPointer, kernel
from reobserve.core.value import for_loop
from reobserve.observers.fixed_step import Samples
from reobserve.papers.delay.estimator import DelayEstimator
from reobserve.papers.delay.input_history import InputHistory, past_input

Array = NDArray[np.float64]

# (values, parameters, x, u(t - tau^), u'(t - tau^), out): write the derivative of the values.
_LAW = "void(float64[::1], float64[::1], float64, float64, float64, float64[::1])"

# A delay comes to a bound and leaves it a few times in a run; there is no point in following a
# law that turns more often than this within one step.
MOST_CHANGES = 16
BISECTIONS = 60


class Task(NamedTuple):
    """What the loop reads: ``first`` is the row of the input at which the record starts."""

    parameters: Array
    bounds: tuple[float, float]
    step: float
    output: Array
    output_before: Array
    right: Array
    left: Array
    first: int


class Work(NamedTuple):
    """Room for four slopes, a point and the end of a part, so that no step asks for any."""

    slopes: Array
    point: Array
    after: Array


def law(function: Any) -> FunctionPointer:
    """The derivative of an estimator's values as the loop is handed it."""
    return FunctionPointer(_LAW, function)


def run_law(
    law: FunctionPointer,
    parameters: list[float],
    estimator: DelayEstimator,
    output: Samples,
    history: InputHistory,
    rows: Array,
) -> int:
    """Fill ``rows``, one for each end of a step, from its first; return how many are finite.

    ``parameters`` are what the law is handed, ``history`` goes on to the end of the record.
    """
    first = 2 * estimator.history_steps
    task = Task(
        np.array(parameters),
        estimator.delay_bounds,
        estimator.sampling_period,
        output.right,
        output.left,
        for_loop(history.right),
        for_loop(history.left),
        first,
    )
    return _run(law.compiled, task, rows)


@kernel
def _slope(law: Any, task: Task, k: int, fraction: float, values: Array, out: Array) -> None:
    """The derivative at a part of step ``k``, before the projection."""
    x = 2.0 * (fraction - 0.5) * (fraction - 1.0) * task.output[2 * k, 0]
    x += 4.0 * fraction * (1.0 - fraction) * task.output[2 * k + 1, 0]
    x += 2.0 * fraction * (fraction - 0.5) * task.output_before[2 * k + 2, 0]
    u, rate = past_input(
        task.right, task.left, task.first + 2 * k, fraction, values[0] / task.step, task.step
    )
    call(law, (values, task.parameters, x, u, rate, out))


@kernel
def _part(
    law: Any, task: Task, k: int, start: float, end: float, held: int, values: Array, work: Work
) -> None:
    """One step of the Runge-Kutta method over a part of step ``k``, in one mode."""
    n = len(values)
    width = end - start
    for stage in range(4):
        ahead = 0.5 * ((stage + 1) // 2)
        for i in range(n):
            work.point[i] = values[i]
            if stage > 0:
                work.point[i] += ahead * width * task.step * work.slopes[stage - 1, i]
        _slope(law, task, k, start + ahead * width, work.point, work.slopes[stage])
        if held != 0:
            work.slopes[stage, 0] = 0.0
    s = work.slopes
    for i in range(n):
        mean = s[0, i] + 2.0 * s[1, i] + 2.0 * s[2, i] + s[3, i]
        work.after[i] = values[i] + width * task.step / 6.0 * mean


@kernel
def _rate(law: Any, task: Task, k: int, fraction: float, values: Array, work: Work) -> float:
    """The rate of the delay before its projection."""
    _slope(law, task, k, fraction, values, work.point)
    rate: float = work.point[0]
    return rate


@kernel
def _stays(law: Any, task: Task, k: int, fraction: float, held: int, work: Work) -> bool:
    """Whether a mode still holds at the end of the part that it has led to."""
    if held == 0:
        delay = work.after[0]
        return not (delay < task.bounds[0] or delay > task.bounds[1])
    return not held * _rate(law, task, k, fraction, work.after, work) < 0.0


@kernel
def _to_mode_end(
    law: Any, task: Task, k: int, start: float, held: int, values: Array, work: Work
) -> float:
    """Go on from ``start`` to the end of the step, or to where the mode ends; returns where."""
    _part(law, task, k, start, 1.0, held, values, work)
    high = 1.0
    stays = _stays(law, task, k, high, held, work)
    if stays and held == 0:
        # A delay that turns round inside the step may have been outside on the way: beyond the
        # bound that it starts towards, if at its first rate it would come so far.
        rate = work.slopes[0, 0]
        room = task.bounds[1] - values[0] if rate > 0.0 else values[0] - task.bounds[0]
        if room < abs(rate) * task.step:
            later = _rate(law, task, k, high, work.after, work)
            if rate * later < 0.0:
                high = start + (1.0 - start) * rate / (rate - later)
                _part(law, task, k, start, high, held, values, work)
                stays = _stays(law, task, k, high, held, work)
                if stays:
                    high = 1.0
                    _part(law, task, k, start, high, held, values, work)
    if stays:
        return high
    low = start
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        _part(law, task, k, start, middle, held, values, work)
        if _stays(law, task, k, middle, held, work):
            low = middle
        else:
            high = middle
    _part(law, task, k, start, high, held, values, work)
    return high


@kernel
def _run(law: Any, task: Task, rows: Array) -> int:
    """Fill ``rows`` from its first; return how many are finite."""
    n = rows.shape[1]
    work = Work(np.empty((4, n)), np.empty(n), np.empty(n))
    values = rows[0].copy()
    least, greatest = task.bounds
    for k in range(len(rows) - 1):
        start = 0.0
        for change in range(MOST_CHANGES):
            held = 0
            if values[0] <= least or values[0] >= greatest:
                rate = _rate(law, task, k, start, values, work)
                if values[0] <= least and rate < 0.0:
                    held = -1
                elif values[0] >= greatest and rate > 0.0:
                    held = 1
            if change == MOST_CHANGES - 1:
                _part(law, task, k, start, 1.0, held, values, work)
                start = 1.0
            else:
                start = _to_mode_end(law, task, k, start, held, values, work)
            total = 0.0
            for i in range(n):
                values[i] = work.after[i]
                total += values[i]
            if not math.isfinite(total):
                return k + 1
            values[0] = min(max(values[0], least), greatest)
            if start == 1.0:
                break
        for i in range(n):
            rows[k + 1, i] = values[i]
    return len(rows)
