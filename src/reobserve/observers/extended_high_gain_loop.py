"""The compiled loop of the extended high-gain observer: steps that are cut where modes change.

A mode says which right-hand side holds: whether the delay is held at a bound (-1 lower, 0 free,
1 upper) and whether its gain is switched off. Inputs stand in rows

    y, u, u', ..., u^(m), gain_1, ..., gain_(n+1)

in the table ``at``: three of a step (its start, its middle and its end, the last as the limit from
inside), three of a part of it, and one of any instant. Tables are passed with the number of a row,
not by views of rows: in loops as short as these a view costs more than the arithmetic on it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.kernel import kernel

Array = NDArray[np.float64]

# Modes change a few times in a whole run; where an input jumps back and forth around the threshold
# in one step there is no point in following every change.
_MOST_CHANGES = 16
_BISECTIONS = 60

# Rows of the table of inputs.
_STEP, _PART, _INSTANT = 0, 3, 6


@kernel
def _interpolate(at: Array, theta: float, row: int) -> None:
    """Put the inputs at the part ``theta`` of the step into a row: a parabola through its three."""
    first = 2.0 * (theta - 0.5) * (theta - 1.0)
    middle = 4.0 * theta * (1.0 - theta)
    last = 2.0 * theta * (theta - 0.5)
    for c in range(at.shape[1]):
        at[row, c] = first * at[0, c] + middle * at[1, c] + last * at[2, c]


@kernel
def _seen(
    input_gain: Any,
    parameters: Array,
    order: int,
    delay: float,
    at: Array,
    row: int,
    y: Array,
    gain: Array,
) -> float:
    """The factor xi^ of (10) for an estimate of the delay; leaves G(y) in ``gain``."""
    y[0] = at[row, 0]
    input_gain(y, parameters, gain)
    total, factor = 0.0, -1.0
    for i in range(1, order + 1):
        total += factor * at[row, 1 + i]
        factor *= -delay / (i + 1)
    xi: float = gain[0] * total
    return xi


@kernel
def _raw_rate(X: Array, xi: float, at: Array, row: int) -> float:
    """The rate of the delay before its projection."""
    rate: float = -at[row, at.shape[1] - 1] * (X[0] - at[row, 0]) / xi
    return rate


@kernel
def _mode(X: Array, bounds: Array, xi: float, at: Array, row: int) -> tuple[int, bool]:
    """The mode that holds from here on; a delay outside its interval is put on the bound."""
    last = len(X) - 1
    X[last] = min(max(X[last], bounds[0]), bounds[1])
    if abs(xi) < bounds[2]:
        return 0, True
    if X[last] == bounds[1] and _raw_rate(X, xi, at, row) > 0.0:
        return 1, False
    if X[last] == bounds[0] and _raw_rate(X, xi, at, row) < 0.0:
        return -1, False
    return 0, False


@kernel
def _holds(X: Array, bounds: Array, xi: float, at: Array, row: int, held: int, off: bool) -> bool:
    """Whether a mode still holds at a point that it has led to."""
    if (abs(xi) < bounds[2]) != off:
        return False
    if off:
        return True
    if held == 0:
        return bool(bounds[0] <= X[len(X) - 1] <= bounds[1])
    return held * _raw_rate(X, xi, at, row) >= 0.0


@kernel
def _part(
    drift: Any,
    input_gain: Any,
    parameters: Array,
    order: int,
    at: Array,
    start: float,
    end: float,
    step: float,
    held: int,
    off: int,
    X: Array,
    out: Array,
    slopes: Array,
    x: Array,
    f: Array,
    y: Array,
    gain: Array,
) -> None:
    """One step of the Runge-Kutta method over a part of a step, in one mode.

    ``off`` is 0, 1 if the gain of the delay is switched off, 2 if all gains are.
    """
    n = len(X) - 1
    h = (end - start) * step
    gains = 2 + order
    base = _STEP
    if start != 0.0 or end != 1.0:
        base = _PART
        for place in range(3):
            _interpolate(at, start + 0.5 * place * (end - start), base + place)
    for stage in range(4):
        row = base + (stage + 1) // 2
        ahead = 0.0 if stage == 0 else h if stage == 3 else 0.5 * h
        for i in range(n + 1):
            x[i] = X[i] if stage == 0 else X[i] + ahead * slopes[stage - 1, i]
        drift(x, parameters, f)
        xi = _seen(input_gain, parameters, order, x[n], at, row, y, gain)
        error = 0.0 if off == 2 else x[0] - at[row, 0]
        for i in range(n - 1):
            slopes[stage, i] = x[i + 1] + f[i] - at[row, gains + i] * error
        pushed = xi * x[n] + gain[0] * at[row, 1]
        slopes[stage, n - 1] = f[n - 1] + pushed - at[row, gains + n - 1] * error
        slopes[stage, n] = 0.0
        if held == 0 and off == 0:
            slopes[stage, n] = -at[row, gains + n] * error / xi
    for i in range(n + 1):
        mean = slopes[0, i] + 2.0 * slopes[1, i] + 2.0 * slopes[2, i] + slopes[3, i]
        out[i] = X[i] + h / 6.0 * mean


@kernel
def _to_mode_end(
    drift: Any,
    input_gain: Any,
    parameters: Array,
    order: int,
    bounds: Array,
    at: Array,
    start: float,
    step: float,
    held: int,
    off: int,
    rate: float,
    X: Array,
    out: Array,
    slopes: Array,
    x: Array,
    f: Array,
    y: Array,
    gain: Array,
) -> float:
    """Go on from ``start`` to the end of the step, or to where the mode ends; returns where.

    ``rate`` is that of the delay at the start if it is free, else 0: where it changes its sign
    inside the step, the delay turns round, and may have left its interval on the way.
    """
    n = len(X) - 1
    high, holds = 1.0, True
    for attempt in range(2):
        _part(
            drift, input_gain, parameters, order, at, start, high, step, held, off, X, out, slopes,
            x, f, y, gain,
        )  # fmt: skip
        row = _STEP + 2
        if high < 1.0:
            row = _INSTANT
            _interpolate(at, high, row)
        xi = _seen(input_gain, parameters, order, out[n], at, row, y, gain)
        holds = _holds(out, bounds, xi, at, row, held, off > 0)
        after = rate if rate == 0.0 else _raw_rate(out, xi, at, row)
        if attempt == 1 or not holds or rate * after >= 0.0:
            break
        high = start + (1.0 - start) * rate / (rate - after)
    if holds and high == 1.0:
        return high
    if holds:
        high = 1.0
    else:
        low = start
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            if not low < middle < high:
                break
            _part(
                drift, input_gain, parameters, order, at, start, middle, step, held, off, X, out,
                slopes, x, f, y, gain,
            )  # fmt: skip
            _interpolate(at, middle, _INSTANT)
            xi = _seen(input_gain, parameters, order, out[n], at, _INSTANT, y, gain)
            if _holds(out, bounds, xi, at, _INSTANT, held, off > 0):
                low = middle
            else:
                high = middle
    _part(
        drift, input_gain, parameters, order, at, start, high, step, held, off, X, out, slopes, x,
        f, y, gain,
    )  # fmt: skip
    return high


@kernel
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

    ``bounds`` holds the least and the greatest delay and the threshold of |xi^|; ``switched`` is 1
    if only the gain of the delay is switched off below it, 2 if all are. ``right`` and ``left``
    hold the inputs, two rows a step, and their limits from the left. ``switched_off`` gets the
    share of each step in which the gain is off.
    """
    n, channels = states.shape[1] - 1, right.shape[1]
    at, slopes = np.empty((7, channels)), np.empty((4, n + 1))
    X, out, x = states[0].copy(), np.empty(n + 1), np.empty(n + 1)
    f, y, gain = np.empty(n), np.empty(1), np.empty(1)
    for k in range(len(states) - 1):
        for c in range(channels):
            at[0, c], at[1, c] = right[2 * k, c], right[2 * k + 1, c]
            at[2, c] = left[2 * k + 2, c]
        start, row = 0.0, _STEP
        switched_off[k] = 0.0
        for change in range(_MOST_CHANGES):
            xi = _seen(input_gain, parameters, order, X[n], at, row, y, gain)
            held, off = _mode(X, bounds, xi, at, row)
            rate = 0.0 if off or held != 0 else _raw_rate(X, xi, at, row)
            kind = switched if off else 0
            if change < _MOST_CHANGES - 1:
                end = _to_mode_end(
                    drift, input_gain, parameters, order, bounds, at, start, step, held, kind,
                    rate, X, out, slopes, x, f, y, gain,
                )  # fmt: skip
            else:
                end = 1.0
                _part(
                    drift, input_gain, parameters, order, at, start, end, step, held, kind, X, out,
                    slopes, x, f, y, gain,
                )  # fmt: skip
            if off:
                switched_off[k] += end - start
            finite = True
            for i in range(n + 1):
                X[i] = out[i]
                finite &= np.isfinite(out[i])
            if not finite:
                return k + 1
            if end == 1.0:
                break
            start, row = end, _INSTANT
            _interpolate(at, end, row)
        X[n] = min(max(X[n], bounds[0]), bounds[1])
        for i in range(n + 1):
            states[k + 1, i] = X[i]
    return len(states)
