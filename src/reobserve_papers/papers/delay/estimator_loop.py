"""The compiled loop of the delay estimators that are differential equations.

The estimate of the delay, the first of the values, is projected: at a bound it is held while its
rate points outwards. The right-hand side differs between free and held, so a step in which the mode
changes is split at that instant, which bisection finds, and each part is a step of the classical
Runge-Kutta method. This keeps the order of the method and the delay inside its bounds. In the parts
of a split step x is interpolated by the parabola through its three samples.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from reobserve.core.direct_call import call
from reobserve.core.kernel import FunctionPointer, allocating_kernel, kernel
from reobserve_papers.papers.delay.estimator import DelayEstimator

Array = NDArray[np.float64]

# (values, parameters, x, u(t - tau^), u'(t - tau^), out): write the derivative of the values.
_LAW = "void(float64[::1], float64[::1], float64, float64, float64, float64[::1])"

# A delay reaches a bound and leaves it a few times in a run; more changes than this within one step
# are not followed.
MAX_CHANGES = 16
BISECTIONS = 60


class EstimatorInputs(NamedTuple):
    """Inputs of the loop: ``first`` is the row of the inputs at which the record starts."""

    parameters: Array
    bounds: tuple[float, float]
    step: float
    output: Array
    inputs: Array
    first: int


class EstimatorWork(NamedTuple):
    """Preallocated arrays: four slopes, a point and the end of a part."""

    slopes: Array
    point: Array
    after: Array


def law(function: Any) -> FunctionPointer:
    """The derivative of an estimator's values in the form that the loop takes."""
    return FunctionPointer(_LAW, function)


def run_law(
    law: FunctionPointer,
    parameters: list[float],
    estimator: DelayEstimator,
    output: Array,
    inputs: Array,
    first: int,
    rows: Array,
) -> int:
    """`DelayEstimator._fill` for a law with ``parameters``."""
    bounds, step = estimator.delay_bounds, estimator.sampling_period
    return _run(
        law.compiled,
        EstimatorInputs(np.array(parameters), bounds, step, output, inputs, first),
        rows,
    )


@kernel
def past_input(
    inputs: Array, now: int, fraction: float, lag: float, step: float
) -> tuple[float, float]:
    """Values of u and u', ``lag`` steps before a point of the step that starts in row ``now``.

    The inputs are samples of u and u' at both ends and in the middle of each step. Within a step
    the polynomial of degree five through these samples gives u to order 6 and u' to order 5 of the
    step; a cubic between two samples would reduce the order of the Runge-Kutta method.

    ``fraction``, from 0 to 1, is the point in the step; if the instant is NaN, so are the values.
    Steps are counted back from the present one, so that the same samples give bitwise identical
    results at any place in the arrays. Before the first row and after the present step the
    polynomials are extrapolated by up to one step, because the integrator may try delays slightly
    outside the bounds.
    """
    place = fraction - lag
    if not np.isfinite(place):  # must not become an index
        return np.nan, np.nan
    cell = 0
    if place < 0.0:
        oldest = -(now // 2)
        cell = oldest if place <= oldest else int(np.floor(place))
    row = now + 2 * cell
    s = 2.0 * (place - cell) - 1.0  # -1, 0 and 1 at the three samples of the step
    s = min(max(s, -3.0), 3.0)
    half = 0.5 * step
    value, slope = inputs[row + 1, 0], half * inputs[row + 1, 1]
    first, last = half * inputs[row, 1], half * inputs[row + 2, 1]
    bend = 0.5 * (inputs[row + 2, 0] + inputs[row, 0]) - value
    rest = 0.5 * (inputs[row + 2, 0] - inputs[row, 0]) - slope
    c4 = 0.25 * (last - first) - bend
    c2 = bend - c4
    c5 = 0.5 * (0.5 * (last + first) - slope - 3.0 * rest)
    c3 = rest - c5
    u = value + s * (slope + s * (c2 + s * (c3 + s * (c4 + s * c5))))
    rate = slope + s * (2.0 * c2 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)))
    return u, rate / half


@kernel
def _slope(
    law: Any, task: EstimatorInputs, k: int, fraction: float, values: Array, out: Array
) -> None:
    """The derivative at a point of step ``k``, before the projection."""
    x = 2.0 * (fraction - 0.5) * (fraction - 1.0) * task.output[2 * k, 0]
    x += 4.0 * fraction * (1.0 - fraction) * task.output[2 * k + 1, 0]
    x += 2.0 * fraction * (fraction - 0.5) * task.output[2 * k + 2, 0]
    lag = values[0] / task.step
    u, rate = past_input(task.inputs, task.first + 2 * k, fraction, lag, task.step)
    call(law, (values, task.parameters, x, u, rate, out))


@kernel
def _part(
    law: Any,
    task: EstimatorInputs,
    k: int,
    start: float,
    end: float,
    held: int,
    values: Array,
    work: EstimatorWork,
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
def _rate(
    law: Any, task: EstimatorInputs, k: int, fraction: float, values: Array, work: EstimatorWork
) -> float:
    """The rate of the delay before its projection."""
    _slope(law, task, k, fraction, values, work.point)
    rate: float = work.point[0]
    return rate


@kernel
def _stays(
    law: Any, task: EstimatorInputs, k: int, fraction: float, held: int, work: EstimatorWork
) -> bool:
    """True if the mode still holds at the end of the part."""
    if held == 0:
        delay = work.after[0]
        return not (delay < task.bounds[0] or delay > task.bounds[1])
    return not held * _rate(law, task, k, fraction, work.after, work) < 0.0


@kernel
def _to_mode_end(
    law: Any,
    task: EstimatorInputs,
    k: int,
    start: float,
    held: int,
    values: Array,
    work: EstimatorWork,
) -> float:
    """Integrate from ``start`` to the end of the step or of the mode, and return the end."""
    _part(law, task, k, start, 1.0, held, values, work)
    high = 1.0
    stays = _stays(law, task, k, high, held, work)
    if stays and held == 0:
        # A delay whose rate changes its sign inside the step may leave the interval in between: at
        # the bound that it moves towards, if its initial rate takes it that far.
        rate = work.slopes[0, 0]
        margin = task.bounds[1] - values[0] if rate > 0.0 else values[0] - task.bounds[0]
        if margin < abs(rate) * task.step:
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


@allocating_kernel
def _run(law: Any, task: EstimatorInputs, rows: Array) -> int:
    """Fill ``rows`` from its first one, and return how many are finite."""
    n = rows.shape[1]
    work = EstimatorWork(np.empty((4, n)), np.empty(n), np.empty(n))
    values = rows[0].copy()
    low, high = task.bounds
    for k in range(len(rows) - 1):
        start = 0.0
        for change in range(MAX_CHANGES):
            held = 0
            if values[0] <= low or values[0] >= high:
                rate = _rate(law, task, k, start, values, work)
                if values[0] <= low and rate < 0.0:
                    held = -1
                elif values[0] >= high and rate > 0.0:
                    held = 1
            if change == MAX_CHANGES - 1:
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
            values[0] = min(max(values[0], low), high)
            if start == 1.0:
                break
        for i in range(n):
            rows[k + 1, i] = values[i]
    return len(rows)
