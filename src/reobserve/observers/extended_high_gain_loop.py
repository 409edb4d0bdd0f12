"""The compiled loop of the extended high-gain observer: steps that are cut where modes change.

A mode says which right-hand side holds: whether the delay is held at a bound (-1 lower, 0 free,
1 upper) and whether its gain is switched off. Inputs stand in rows

    y, u, u', ..., u^(m), gain_1, ..., gain_(n+1), G(y)

in the table ``at``: three of a step (its start, its middle and its end, the last as the limit from
inside), and three of a part of it. Points stand in rows of a table, too.

What makes the loop fast: G is asked for once a row and not at each stage. ``size`` is a tuple of n
zeros, whose length the compiler knows, so that it can write short loops out. Nothing on the usual
way can raise, see `reobserve.core.direct_call`. Tables are passed with the number of a row, not
by views of rows.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.chandrupatla import next_trial
from reobserve.core.direct_call import call
from reobserve.core.kernel import inlined_kernel, kernel

Array = NDArray[np.float64]

# Modes change a few times in a whole run; where an input jumps back and forth around the threshold
# in one step, or the delay moves xi^ so that each of two modes leads back into the other, there is
# no point in following every change.
MAX_CHANGES = 16
MAX_TRIALS = 60
NEAREST = 2.0**-50  # of a step: how near the end of a mode is found

# Rows of the table of inputs.
_STEP, _PART = 0, 3
# Rows of the table of points.
_FROM, _TO, _SUM = 0, 1, 2

Size = tuple[int, ...]
Bounds = tuple[float, float, float]
# Whether the delay is held; 0, 1 if the gain of the delay is switched off, 2 if all gains are; and
# xi^ where the mode began.
Mode = tuple[int, int, float]
# The parameters of drift and input gain, then these two: a tuple that begins with a function makes
# numba warn.
Model = tuple[Array, Any, Any]
Work = tuple[Array, Array, Array, Array]  # for what they read and write: x, f, y and G


@kernel
def _add_gain(
    input_gain: Any, parameters: Array, at: Array, row: int, y: Array, gain: Array
) -> None:
    """Put G(y) at the end of a row."""
    y[0] = at[row, 0]
    call(input_gain, (y, parameters, gain))
    at[row, at.shape[1] - 1] = gain[0]


@kernel
def _interpolate(model: Model, at: Array, theta: float, row: int, work: Work) -> None:
    """Put the inputs at the part ``theta`` of the step into a row: a parabola through its three."""
    first = 2.0 * (theta - 0.5) * (theta - 1.0)
    middle = 4.0 * theta * (1.0 - theta)
    last = 2.0 * theta * (theta - 0.5)
    for c in range(at.shape[1] - 1):
        at[row, c] = first * at[0, c] + middle * at[1, c] + last * at[2, c]
    _add_gain(model[2], model[0], at, row, work[2], work[3])


@kernel
def _seen(order: int, delay: float, at: Array, row: int) -> float:
    """The factor xi^ of (10) for an estimate of the delay."""
    total, factor = 0.0, -1.0
    for i in range(1, order + 1):
        total += factor * at[row, 1 + i]
        factor *= -delay / (i + 1)
    xi: float = at[row, at.shape[1] - 1] * total
    return xi


@kernel
def _raw_rate(angle: float, xi: float, at: Array, row: int) -> float:
    """The rate of the delay before its projection."""
    rate: float = -at[row, at.shape[1] - 2] * (angle - at[row, 0]) / xi
    return rate


@kernel
def _mode(delay: float, rate: float, xi: float, bounds: Bounds) -> tuple[int, bool]:
    """The mode that holds from here on, for a delay in its interval and its raw rate."""
    least, most, threshold = bounds
    off = abs(xi) < threshold or xi == 0.0
    held = 0
    if not off and delay == most and rate > 0.0:
        held = 1
    elif not off and delay == least and rate < 0.0:
        held = -1
    return held, off


@kernel
def _margin(delay: float, rate: float, xi: float, bounds: Bounds, mode: Mode) -> float:
    """How far a mode is from its end at a point that it has led to; it holds from zero on.

    Where xi^ changes its sign the delay runs away from one bound and back from the other.
    """
    (least, most, threshold), (held, off, before) = bounds, mode
    if off > 0:
        return threshold - abs(xi)
    margin = (xi if before > 0.0 else -xi) - threshold
    if held == 0:
        return min(margin, delay - least, most - delay)
    return min(margin, held * rate)


@kernel
def _runge_kutta(
    model: Model, size: Size, order: int, at: Array, base: int, h: float, mode: Mode,
    points: Array, work: Work,
) -> None:  # fmt: skip
    """One step of the method in one mode, with the three rows of inputs from ``base`` on.

    It leads from the point in row _FROM to that in row _TO.
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
        # As `_seen`, whose call could raise for numba.
        total, factor = 0.0, -1.0
        for i in range(1, order + 1):
            total += factor * at[row, 1 + i]
            factor *= -x[n] / (i + 1)
        xi = at[row, gains + n + 1] * total
        error = 0.0 if off == 2 else x[0] - at[row, 0]
        pushed = xi * x[n] + at[row, gains + n + 1] * at[row, 1]
        for i in range(n):
            slope = (x[i + 1] if i < n - 1 else pushed) + f[i] - at[row, gains + i] * error
            points[_SUM, i] += weight * slope
            x[i] = points[_FROM, i] + ahead * slope
        slope = 0.0
        if held == 0 and off == 0:
            slope = -at[row, gains + n] * error / xi
        points[_SUM, n] += weight * slope
        x[n] = points[_FROM, n] + ahead * slope
    for i in range(n + 1):
        points[_TO, i] = points[_FROM, i] + h / 6.0 * points[_SUM, i]


@kernel
def _cut(model: Model, at: Array, start: float, end: float, work: Work) -> int:
    """Fill the rows of a part of the step; return the first of them."""
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
    """Go on from ``start`` to ``end`` of the step in a mode; return its margin there, and the rate.

    It leads from the point in row _FROM to that in row _TO.
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
    """Go on from ``start`` to the first point beyond the end of a mode; returns where that is.

    ``above`` and ``below`` are the mode's margins at the start and at the end of the step. It is
    looked for ``here`` first: where the delay turns round, if the mode holds at the end, too. If it
    holds there as well it is gone on to the end of the step.
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
    """Fill ``states`` from its first row; return the number of finite rows.

    Lechappe et al. 2018, (9) to (11), after (8), before (9) and after (36).

    ``bounds`` holds the least and the greatest delay and the threshold of |xi^|; ``switched`` is 1
    if only the gain of the delay is switched off below it, 2 if all are. ``right`` and ``left``
    hold the inputs, two rows a step, and their limits from the left. ``switched_off`` gets the
    share of each step in which the gain is off.
    """
    size = (0,) * (states.shape[1] - 1)
    least, most, threshold = bounds.tolist()
    return _run(
        (parameters, drift, input_gain), size, order, switched, (least, most, threshold), step,
        right, left, states, switched_off,
    )  # fmt: skip


@kernel
def _run(
    model: Model, size: Size, order: int, switched: int, bounds: Bounds, step: float,
    right: Array, left: Array, states: Array, switched_off: Array,
) -> int:  # fmt: skip
    """The loop of `run`, for sizes that are known when it is compiled."""
    n, channels = len(size), right.shape[1]
    least, most, _ = bounds
    at, points = np.empty((6, channels + 1)), np.empty((3, n + 1))
    _, _, y, gain = work = np.empty(n + 1), np.empty(n), np.empty(1), np.empty(1)
    parameters, _, input_gain = model
    for i in range(n + 1):
        points[_FROM, i] = states[0, i]
    for k in range(len(states) - 1):
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
            points[_FROM, n] = min(max(points[_FROM, n], least), most)
            held, off = _mode(points[_FROM, n], rate, xi, bounds)
            mode, end = (held, switched if off else 0, xi), 1.0
            margin, after = _go(
                model, size, order, bounds, at, start, end, step, mode, points, work
            )  # fmt: skip
            holds = margin >= 0.0
            # A free delay whose rate changes its sign turns round inside the step, where it may
            # have left its interval.
            turns = holds and held == 0 and not off and rate != 0.0 and not rate * after >= 0.0
            if (turns or not holds) and change < MAX_CHANGES - 1:
                above = _margin(points[_FROM, n], rate, xi, bounds, mode)
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
        points[_FROM, n] = min(max(points[_FROM, n], least), most)
        for i in range(n + 1):
            states[k + 1, i] = points[_FROM, i]
    return len(states)
