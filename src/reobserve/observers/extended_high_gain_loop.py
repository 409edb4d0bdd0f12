"""The compiled loop of the extended high-gain observer: steps are split where modes change.

A mode selects the right-hand side: whether the delay is held at a bound (-1 lower, 0 free, 1 upper)
and whether gains are switched off. The table ``at`` holds inputs in rows

    y, u, u', ..., u^(m), gain_1, ..., gain_(n+1), G(y)

three for a step (start, middle and end, the end as the limit from the left) and three for a part of
it. Points are rows of a table, too.

For speed, G is evaluated once a row and not at each stage. ``size`` is a tuple of n zeros, whose
length the compiler knows, so that it can unroll short loops. No call on the usual path can raise,
see `reobserve.core.direct_call`. Tables are passed with row numbers instead of views of rows.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.chandrupatla import next_trial
from reobserve.core.direct_call import call
from reobserve.core.interrupts import FIRST, poll
from reobserve.core.kernel import allocating_kernel, inlined_kernel, kernel

Array = NDArray[np.float64]

# Modes change a few times in a run. Not every change is followed if an input crosses the threshold
# repeatedly in one step, or if the delay moves xi^ so that each of two modes leads to the other.
MAX_CHANGES = 16
MAX_TRIALS = 60
NEAREST = 2.0**-50  # of a step: the precision of the end of a mode

# Rows of the table of inputs.
_STEP, _PART = 0, 3
# Rows of the table of points.
_FROM, _TO, _SUM = 0, 1, 2

Size = tuple[int, ...]
Bounds = tuple[float, float, float]
# Whether the delay is held; which gains are off: 0 none, 1 that of the delay, 2 all; and xi^ at the
# start of the mode.
Mode = tuple[int, int, float]
# Parameters, drift and input gain; numba warns about a tuple that begins with a function.
Model = tuple[Array, Any, Any]
Work = tuple[Array, Array, Array, Array]  # arguments and results of these: x, f, y and G


@kernel
def _add_gain(
    input_gain: Any, parameters: Array, at: Array, row: int, y: Array, gain: Array
) -> None:
    """Write G(y) to the end of a row."""
    y[0] = at[row, 0]
    call(input_gain, (y, parameters, gain))
    at[row, at.shape[1] - 1] = gain[0]


@kernel
def _interpolate(model: Model, at: Array, theta: float, row: int, work: Work) -> None:
    """Write the inputs at the fraction ``theta`` of the step to a row, by a parabola."""
    # p(theta) = 2 (theta - 1/2) (theta - 1) p0 + 4 theta (1 - theta) p1 + 2 theta (theta - 1/2) p2
    first = 2.0 * (theta - 0.5) * (theta - 1.0)
    middle = 4.0 * theta * (1.0 - theta)
    last = 2.0 * theta * (theta - 0.5)
    for c in range(at.shape[1] - 1):
        at[row, c] = first * at[0, c] + middle * at[1, c] + last * at[2, c]
    _add_gain(model[2], model[0], at, row, work[2], work[3])


@kernel
def _seen(order: int, delay: float, at: Array, row: int) -> float:
    """The factor xi^ of (10) for an estimate of the delay."""
    # xi^ = G(y) sum over i = 1..m of (-1)^i tau^^(i-1) / i! u^(i): (10)
    total, factor = 0.0, -1.0
    for i in range(1, order + 1):
        total += factor * at[row, 1 + i]
        factor *= -delay / (i + 1)
    xi: float = at[row, at.shape[1] - 1] * total
    return xi


@kernel
def _raw_rate(angle: float, xi: float, at: Array, row: int) -> float:
    """The rate of the delay before its projection."""
    # tau^' = -gain_(n+1) (x^1 - y) / xi^
    rate: float = -at[row, at.shape[1] - 2] * (angle - at[row, 0]) / xi
    return rate


@kernel
def _mode(delay: float, rate: float, xi: float, bounds: Bounds) -> tuple[int, bool]:
    """The mode that starts here, for a delay in its interval and its rate before projection."""
    low, high, threshold = bounds
    off = abs(xi) < threshold or xi == 0.0
    # tau^' = 0 where tau^ = tau_max and tau^' > 0, or tau^ = tau_min and tau^' < 0: (11)
    held = 0
    if not off and delay == high and rate > 0.0:
        held = 1
    elif not off and delay == low and rate < 0.0:
        held = -1
    return held, off


@kernel
def _margin(delay: float, rate: float, xi: float, bounds: Bounds, mode: Mode) -> float:
    """The margin of a mode at a point that it has led to, which is zero or more while it holds.

    Where xi^ changes its sign, the rate of the delay has a pole and changes its sign, too.
    """
    (low, high, threshold), (held, off, before) = bounds, mode
    # off: threshold - |xi^|;   on: +-xi^ - threshold, with the sign of xi^ at the start, or if less
    # free: tau^ - tau_min or tau_max - tau^;   held: +-tau^', + at the maximum
    if off > 0:
        return threshold - abs(xi)
    margin = (xi if before > 0.0 else -xi) - threshold
    if held == 0:
        return min(margin, delay - low, high - delay)
    return min(margin, held * rate)


@kernel
def _runge_kutta(
    model: Model, size: Size, order: int, at: Array, base: int, h: float, mode: Mode,
    points: Array, work: Work,
) -> None:  # fmt: skip
    """One Runge-Kutta step in one mode, with the three rows of inputs from ``base`` on.

    It starts at the point in row _FROM and writes its end to row _TO.
    """
    n, gains = len(size), 2 + order
    (parameters, drift, _), (x, f, _, _), (held, off, _) = model, work, mode
    for i in range(n + 1):
        x[i], points[_SUM, i] = points[_FROM, i], 0.0
    for stage in range(4):
        row = base + (stage + 1) // 2
        ahead = h if stage == 2 else 0.5 * h
        weight = 2.0 if stage in (1, 2) else 1.0
        call(drift, (x, parameters, f))
        # The code of `_seen`: numba assumes that a call may raise.
        total, factor = 0.0, -1.0
        for i in range(1, order + 1):
            total += factor * at[row, 1 + i]
            factor *= -x[n] / (i + 1)
        xi = at[row, gains + n + 1] * total
        # x^i' = x^(i+1) + f_i(x^) - gain_i (x^1 - y), with xi^ tau^ + G(y) u for x^(n+1): (9)
        error = 0.0 if off == 2 else x[0] - at[row, 0]
        pushed = xi * x[n] + at[row, gains + n + 1] * at[row, 1]
        for i in range(n):
            slope = (x[i + 1] if i < n - 1 else pushed) + f[i] - at[row, gains + i] * error
            points[_SUM, i] += weight * slope
            x[i] = points[_FROM, i] + ahead * slope
        # tau^' = -gain_(n+1) (x^1 - y) / xi^, zero where it is held or its gain is off
        slope = 0.0
        if held == 0 and off == 0:
            slope = -at[row, gains + n] * error / xi
        points[_SUM, n] += weight * slope
        x[n] = points[_FROM, n] + ahead * slope
    # X^(t + h) = X^(t) + h/6 (k1 + 2 k2 + 2 k3 + k4)
    for i in range(n + 1):
        points[_TO, i] = points[_FROM, i] + h / 6.0 * points[_SUM, i]


@kernel
def _cut(model: Model, at: Array, start: float, end: float, work: Work) -> int:
    """Fill the rows of a part of the step, and return the first of them."""
    if start == 0.0 and end == 1.0:
        return _STEP
    _interpolate(model, at, start, _PART, work)
    _interpolate(model, at, 0.5 * (start + end), _PART + 1, work)
    _interpolate(model, at, end, _PART + 2, work)
    return _PART


@inlined_kernel
def _go(
    model: Model, size: Size, order: int, bounds: Bounds, at: Array, start: float, end: float,
    step: float, mode: Mode, points: Array, work: Work,
) -> tuple[float, float]:  # fmt: skip
    """Integrate from ``start`` to ``end`` of the step in a mode, and return margin and rate there.

    It starts at the point in row _FROM and writes its end to row _TO.
    """
    n, base = len(size), _cut(model, at, start, end, work)
    _runge_kutta(model, size, order, at, base, (end - start) * step, mode, points, work)
    xi = _seen(order, points[_TO, n], at, base + 2)
    rate = _raw_rate(points[_TO, 0], xi, at, base + 2)
    return _margin(points[_TO, n], rate, xi, bounds, mode), rate


@kernel
def _to_mode_end(
    model: Model, size: Size, order: int, bounds: Bounds, at: Array, start: float, above: float,
    below: float, here: float, step: float, mode: Mode, points: Array, work: Work,
) -> float:  # fmt: skip
    """Integrate from ``start`` to the first point beyond the end of a mode, and return that point.

    ``above`` and ``below`` are the mode's margins at the start and at the end of the step. The
    search begins at ``here``: if the mode also holds at the end, this is where the rate of the
    delay changes its sign. If it holds there, too, the integration goes on to the end of the step.
    """
    newest, opposite = (start, above), (1.0, below)
    former = newest
    for _ in range(MAX_TRIALS):
        margin, _ = _go(model, size, order, bounds, at, start, here, step, mode, points, work)
        if (margin >= 0.0) == (newest[1] >= 0.0):
            former = newest
        else:
            former, opposite = opposite, newest
        newest = here, margin
        ends = not (margin >= 0.0 and opposite[1] >= 0.0)
        if ends and abs(here - opposite[0]) > 2.0 * NEAREST:
            here = next_trial(newest, opposite, former, NEAREST)
        elif here >= opposite[0]:
            break
        else:
            here = opposite[0]
    return newest[0]


def run(
    drift: Any,
    input_gain: Any,
    parameters: Array,
    order: int,
    switched: int,
    bounds: Array,
    step: float,
    right: Array,
    left: Array,
    states: Array,
    switched_off: Array,
) -> int:
    """Fill ``states`` from its first row, and return the number of finite rows.

    Lechappe et al. 2018, (9) to (11), after (8), before (9) and after (36).

    ``bounds`` holds the minimum and the maximum delay and the threshold of |xi^|; ``switched`` is 1
    if only the gain of the delay is switched off below it, 2 if all gains are. ``right`` and
    ``left`` hold the inputs, two rows for each step, and their limits from the left. The share of
    each step in which gains are off is written to ``switched_off``.
    """
    size = (0,) * (states.shape[1] - 1)
    low, high, threshold = bounds.tolist()
    return _run(
        (parameters, drift, input_gain), size, order, switched, (low, high, threshold), step,
        right, left, states, switched_off,
    )  # fmt: skip


@allocating_kernel
def _run(
    model: Model, size: Size, order: int, switched: int, bounds: Bounds, step: float,
    right: Array, left: Array, states: Array, switched_off: Array,
) -> int:  # fmt: skip
    """The loop of `run`, for sizes that are known at compile time."""
    n, channels = len(size), right.shape[1]
    low, high, _ = bounds
    at, points = np.empty((6, channels + 1)), np.empty((3, n + 1))
    _, _, y, gain = work = np.empty(n + 1), np.empty(n), np.empty(1), np.empty(1)
    parameters, _, input_gain = model
    for i in range(n + 1):
        points[_FROM, i] = states[0, i]
    due = FIRST
    for k in range(len(states) - 1):
        if k >= due:
            due = poll(k)
        for c in range(channels):
            at[0, c], at[1, c] = right[2 * k, c], right[2 * k + 1, c]
            at[2, c] = left[2 * k + 2, c]
        for row in range(3):
            _add_gain(input_gain, parameters, at, row, y, gain)
        start, here = 0.0, _STEP
        switched_off[k] = 0.0
        for change in range(MAX_CHANGES):
            xi = _seen(order, points[_FROM, n], at, here)
            rate = _raw_rate(points[_FROM, 0], xi, at, here)
            points[_FROM, n] = min(max(points[_FROM, n], low), high)
            held, off = _mode(points[_FROM, n], rate, xi, bounds)
            mode, end = (held, switched if off else 0, xi), 1.0
            margin, after = _go(
                model, size, order, bounds, at, start, end, step, mode, points, work
            )  # fmt: skip
            holds = margin >= 0.0
            # If the rate of a free delay changes its sign inside the step, the delay may have left
            # its interval in between.
            turns = holds and held == 0 and not off and rate != 0.0 and not rate * after >= 0.0
            if (turns or not holds) and change < MAX_CHANGES - 1:
                above = _margin(points[_FROM, n], rate, xi, bounds, mode)
                # Where a rate that changes linearly is zero: rate + part (after - rate) = 0.
                part = rate / (rate - after) if turns else 0.5
                end = _to_mode_end(
                    model, size, order, bounds, at, start, above, margin,
                    start + (1.0 - start) * part, step, mode, points, work,
                )  # fmt: skip
            if off:
                switched_off[k] += end - start
            finite = True
            for i in range(n + 1):
                points[_FROM, i] = points[_TO, i]
                finite &= np.isfinite(points[_TO, i])
            if not finite:
                return k + 1
            if end == 1.0:
                break
            start, here = end, _PART + 2
        points[_FROM, n] = min(max(points[_FROM, n], low), high)
        for i in range(n + 1):
            states[k + 1, i] = points[_FROM, i]
    return len(states)
