"""Extended high-gain observer of state and input delay (Lechappe et al. 2018, (9) to (11)).

The right-hand side differs between held and free, on and off. A step in which the mode changes is
therefore split at that instant, and each part is a step of the classical Runge-Kutta method. This
keeps the order of the method, and the delay inside its interval, also between samples. Inside a
step the inputs are interpolated by a parabola through their three samples.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import MOST_STATES, as_kind, as_whole, as_word
from reobserve.core.chandrupatla import next_trial
from reobserve.core.covariances import as_positive_definite
from reobserve.core.direct_call import call
from reobserve.core.errors import InputError
from reobserve.core.interrupts import FIRST, poll
from reobserve.core.kernel import allocating_kernel, inlined_kernel, kernel
from reobserve.core.matrices import as_positive, as_scalar, as_vector
from reobserve.core.value import Value, converter, for_loop
from reobserve.observers.contract import IntegratingObserver
from reobserve.observers.fixed_step import Steps
from reobserve.observers.record import Record, Rows, check_state, warn_caller
from reobserve.observers.row_derivatives import as_signal_rows, completed, latest
from reobserve.synthesis.high_gain_design import high_gain, high_gain_over_time
from reobserve.systems.triangular import TriangularModel

Array = NDArray[np.float64]

SWITCHED = ("delay", "all")

_FORGOTTEN = 100.0


class SwitchedOffWarning(UserWarning):
    """The threshold exceeds |xi^| over the whole record, so the delay was never observed."""


@dataclass(frozen=True, eq=False, repr=False)
class ExtendedHighGainState(Value):
    """The observer's state: a value that may be stored, copied and stepped again.

    ``values`` are x^ and tau^ in one vector, shape (n + 1,); ``recent`` is u at the latest m + 1
    samples, the last one last; ``sample`` has y, u and all its derivatives, including those that
    were computed; the rest is as in `reobserve.observers.record.ObserverState`.
    """

    values: Array
    recent: Array
    sample: Array | None = None
    count: int = 0
    time: float | None = None


@dataclass(frozen=True, eq=False, repr=False)
class ExtendedHighGainObserver(IntegratingObserver[ExtendedHighGainState]):
    """Extended high-gain observer of state and input delay, of any size and any Taylor order.

        X^' = Lambda_ext(xi^) X^ + f_ext(X^) + g_ext(y) u(t) - lambda(xi^)^-1 S^-1 C^T (x^1 - y)
        xi^ = G(y) sum over i = 1..m of (-1)^i tau^^(i-1) / i! u^(i)(t)

    Lechappe et al. 2018, (9) to (12), (34), (35), after (36) and Lemma 1. (The printed (34) lacks
    the C^T.) The last state is the delay: row n has xi^ tau^ + G(y) u, the Taylor expansion of the
    delayed input up to order m, and the gain of the delay is divided by xi^. The rate of the delay
    is projected (11): at a bound of its interval the delay is held while its rate points outwards.

    `init` takes the state and the delay. `run` and `step` take y, shape (k,), and u with its
    derivatives up to order m, (k, m + 1), or u alone: then the derivatives are computed by the past
    samples, see `reobserve.observers.row_derivatives`. The input is assumed to be smooth: between
    rows u, its derivatives and y are interpolated linearly. Estimates: ``state``, x^, shape (k, n),
    in units of the model, ``delay``, tau^ [s], (k,), and ``switched_off`` [1], (k,): the share of
    the period before the row in which gains were switched off, 0 in the first row of a record.

    Parameters
    ----------
    model
        f, G and their parameters.
    rho
        The one tuning parameter of the gain [1/s].
    order
        m, the order of the Taylor expansion, which uses m derivatives of u.
    delay_bounds
        The known interval of the delay [s].
    threshold
        Gains are switched off where |xi^| is below it, as the delay is nearly unobservable there;
        0 for never.
    switched
        Which gains are switched off: ``delay`` or ``all``.
    initial_matrix
        S(0), shape (n + 1, n + 1), of the dynamic equation of the gain; None for the algebraic
        equation, to whose solution the dynamic one converges.
    sampling_period
        [s], also the integration step.

    Raises
    ------
    InputError
        If rho or the period is not positive, the order below 1, the bounds are negative or not in
        order, the threshold is negative, ``switched`` another word, or S(0) not positive definite.

    Warns
    -----
    SwitchedOffWarning
        If the gain was off for the whole record of a run.

    Examples
    --------
    >>> import numpy as np
    >>> from reobserve import ExtendedHighGainObserver
    >>> from reobserve.systems.triangular_text import triangular_model
    >>> lag = triangular_model(["x"], drift=["-x"], input_gain="1")
    >>> observer = ExtendedHighGainObserver(
    ...     lag, rho=3.0, order=1, delay_bounds=(0.0, 1.0), sampling_period=0.02
    ... )
    >>> time = 0.02 * np.arange(600)
    >>> run = observer.run(time - 1.6, time, start=observer.init([-1.6], delay=0.3))
    >>> print(run["delay"][-1].round(3), run["switched_off"][-1])
    0.6 0.0
    """

    model: TriangularModel = field(metadata=converter(as_kind, TriangularModel))
    rho: float = field(kw_only=True, metadata=converter(as_positive))
    order: int = field(kw_only=True, metadata=converter(as_whole, 1, MOST_STATES))
    delay_bounds: tuple[float, float] = field(kw_only=True)
    threshold: float = field(default=0.0, kw_only=True, metadata=converter(as_scalar))
    switched: str = field(default="delay", kw_only=True, metadata=converter(as_word, SWITCHED))
    initial_matrix: ArrayLike | None = field(default=None, kw_only=True)

    measurements: ClassVar[int] = 1
    units: ClassVar[Mapping[str, str]] = {"state": "", "delay": "s", "switched_off": "1"}

    def __post_init__(self) -> None:
        super().__post_init__()
        low, high = as_vector("delay_bounds", self.delay_bounds, 2).tolist()
        self._set("delay_bounds", (low, high))
        if not 0.0 <= low < high:
            raise InputError("delay_bounds", f"[{low:g}, {high:g}] s must be 0 or more, rising")
        if self.threshold < 0:
            raise InputError("threshold", f"{self.threshold:g} must not be negative")
        size = self.model.states + 1
        if self.initial_matrix is not None:
            matrix = as_positive_definite("initial_matrix", self.initial_matrix, size)
            self._set("initial_matrix", matrix)
        self._gains(np.zeros(1))

    def _gains(self, times: NDArray[Any]) -> Array:
        """S^-1 C^T at times since the start, shape (k, n + 1)."""
        size = self.model.states + 1
        gains = np.tile(high_gain(size, self.rho), (len(times), 1))
        if self.initial_matrix is not None:
            # The effect of S(0), e^(-rho t), is then far below rounding.
            early = np.asarray(times) < _FORGOTTEN / self.rho
            gains[early] = high_gain_over_time(size, self.rho, self.initial_matrix, times[early])
        return gains

    @property
    def inputs(self) -> int:
        """The number of inputs, m + 1, of which u alone is sufficient."""
        return self.order + 1

    def init(self, state: ArrayLike, *, delay: float) -> ExtendedHighGainState:
        """The state at the first sample, from x^(0), shape (n,), and tau^(0) [s].

        Lechappe et al. 2018, (13) and Assumption 6.

        Raises
        ------
        InputError
            If a shape is wrong or the delay is outside its bounds (Assumption 6).
        """
        x, tau = as_vector("state", state, self.model.states), as_scalar("delay", delay)
        low, high = self.delay_bounds
        if not low <= tau <= high:
            raise InputError("delay", f"{tau:g} s must be inside its bounds, [{low:g}, {high:g}] s")
        return ExtendedHighGainState(np.append(x, tau), np.zeros(self.order + 1))

    def _checked(self, state: Any) -> ExtendedHighGainState:
        n, derivatives = self.model.states, self.order + 1
        return check_state(
            state, ExtendedHighGainState,
            f"must be of an observer of {n} states and the order {self.order}",
            values=(n + 1,), recent=(derivatives,), sample=(1 + derivatives,),
        )  # fmt: skip

    def _read_inputs(self, name: str, u: ArrayLike | None, rows: int) -> Array:
        if u is None:
            return super()._read_inputs(name, u, rows)
        return as_signal_rows(name, u, self.order, rows=rows)

    def _completed(
        self, state: ExtendedHighGainState, record: Record
    ) -> tuple[ExtendedHighGainState, Record]:
        """State and record with all derivatives, and with an input that varies between rows."""
        begun = state.sample is not None
        last, u, before, middle = completed(
            record.u, record.before[1], record.middle[1],
            recent=state.recent, known=state.count + 1 if begun else 0,
            last=None if state.sample is None else state.sample[1:], period=self.sampling_period,
        )  # fmt: skip
        if state.sample is not None and last is not None:
            state = state._with(sample=np.concatenate([state.sample[:1], last]))
        y_before, y_middle = record.before[0], record.middle[0]
        return state, record._replace(u=u, before=(y_before, before), middle=(y_middle, middle))

    def _fill(self, state: ExtendedHighGainState, record: Record) -> Rows:
        rows = super()._fill(state, record)
        off = rows.estimates["switched_off"][state.sample is None : rows.finite]
        # No warning in single steps: each one with the gain off would warn.
        if len(record.y) > 1 and len(off) and float(np.min(off)) >= 1.0:
            warn_caller(SwitchedOffWarning(
                f"threshold: {self.threshold:g} is above |xi^| for 100 % of the record, so the "
                "delay was never observed; lower it"
            ))  # fmt: skip
        after = rows.state._with(recent=latest(state.recent, record.u[:, 0]))
        return rows._replace(state=after)

    def _integrate(self, state: ExtendedHighGainState, steps: Steps) -> Rows:
        y, u = steps
        rows = np.empty((y.steps + 1, self.model.states + 1))
        off = np.zeros(y.steps + 1)
        rows[0] = state.values
        right = left = self._table(y.right[:, 0], u.right, state.count)
        if y.left is not y.right or u.left is not u.right:
            left = right.copy()
            left[:, :1], left[:, 1 : self.order + 2] = y.left, u.left
        model = self.model
        finite = _run(
            (for_loop(model.parameters), model.drift, model.input_gain),
            (0,) * model.states,
            self.order,
            1 + SWITCHED.index(self.switched),
            (*self.delay_bounds, self.threshold),
            self.sampling_period,
            right,
            left,
            rows,
            off[1:],
        )
        after = state._with(values=rows[-1].copy(), count=state.count + y.steps)
        estimates = {
            "state": np.ascontiguousarray(rows[:, :-1]), "delay": rows[:, -1].copy(),
            "switched_off": off,
        }  # fmt: skip
        return Rows(estimates, finite, after)

    def _table(self, y: Array, u: Array, count: int) -> Array:
        """y, u and its derivatives, and the gains, one row per sample, from step ``count`` on."""
        half = np.arange(2 * count, 2 * count + len(y)) * (0.5 * self.sampling_period)
        table = np.empty((len(u), u.shape[1] + self.model.states + 2))
        table[:, 0], table[:, 1 : u.shape[1] + 1] = y, u
        table[:, u.shape[1] + 1 :] = self._gains(half)
        return table


# A mode selects the right-hand side: whether the delay is held at a bound (-1 lower, 0 free,
# 1 upper) and whether gains are switched off. The table ``at`` holds inputs in rows
#
#     y, u, u', ..., u^(m), gain_1, ..., gain_(n+1), G(y)
#
# three for a step (start, middle and end, the end as the limit from the left) and three for a part
# of it. Points are rows of a table, too. Tables are passed with row numbers instead of views.
#
# For speed, G is evaluated once a row and not at each stage. ``size`` is a tuple of n zeros, whose
# length the compiler knows, so that it can unroll short loops. No call on the usual path can raise,
# see `reobserve.core.direct_call`.

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
Bounds = tuple[float, float, float]  # of the delay, and the threshold of |xi^|
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
    """Write G(y) to the end of a row (Lechappe et al. 2018, (9))."""
    # g_ext(y) = (0, ..., 0, G(y), 0)^T
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
    """The factor xi^ for an estimate of the delay (Lechappe et al. 2018, (10))."""
    # xi^ = G(y) sum over i = 1..m of (-1)^i tau^^(i-1) / i! u^(i)
    total, factor = 0.0, -1.0
    for i in range(1, order + 1):
        total += factor * at[row, 1 + i]
        factor *= -delay / (i + 1)
    xi: float = at[row, at.shape[1] - 1] * total
    return xi


@kernel
def _raw_rate(angle: float, xi: float, at: Array, row: int) -> float:
    """The rate of the delay before its projection (Lechappe et al. 2018, (9))."""
    # tau^' = -gain_(n+1) (x^1 - y) / xi^
    rate: float = -at[row, at.shape[1] - 2] * (angle - at[row, 0]) / xi
    return rate


@kernel
def _mode(delay: float, rate: float, xi: float, bounds: Bounds) -> tuple[int, bool]:
    """The mode that starts here, for a delay in its interval and its rate before projection.

    Lechappe et al. 2018, (11) and after (36).
    """
    low, high, threshold = bounds
    off = abs(xi) < threshold or xi == 0.0
    # tau^' = 0 where tau^ = tau_max and tau^' > 0, or tau^ = tau_min and tau^' < 0
    held = 0
    if not off and delay == high and rate > 0.0:
        held = 1
    elif not off and delay == low and rate < 0.0:
        held = -1
    return held, off


@kernel
def _margin(delay: float, rate: float, xi: float, bounds: Bounds, mode: Mode) -> float:
    """The margin of a mode at a point that it has led to, which is zero or more while it holds.

    Lechappe et al. 2018, (11), (12) and after (36). Where xi^ changes its sign, the rate of the
    delay has a pole and changes its sign, too.
    """
    (low, high, threshold), (held, off, before) = bounds, mode
    if off > 0:
        # |xi^| <= threshold
        return threshold - abs(xi)
    # |xi^| >= threshold, with the sign of xi^ at the start of the mode
    margin = (xi if before > 0.0 else -xi) - threshold
    if held == 0:
        # tau_min <= tau^ <= tau_max
        return min(margin, delay - low, high - delay)
    # tau^' >= 0 at tau_max, tau^' <= 0 at tau_min
    return min(margin, held * rate)


@kernel
def _runge_kutta(
    model: Model, size: Size, order: int, at: Array, base: int, h: float, mode: Mode,
    points: Array, work: Work,
) -> None:  # fmt: skip
    """One Runge-Kutta step in one mode, with the three rows of inputs from ``base`` on.

    Lechappe et al. 2018, (9) and (10). It starts at the point in row _FROM and writes its end to
    row _TO.
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
        # xi^ by the code of `_seen`: numba assumes that a call may raise.
        total, factor = 0.0, -1.0
        for i in range(1, order + 1):
            total += factor * at[row, 1 + i]
            factor *= -x[n] / (i + 1)
        xi = at[row, gains + n + 1] * total
        # x^i' = x^(i+1) + f_i(x^) - gain_i (x^1 - y), with xi^ tau^ + G(y) u for x^(n+1)
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
    # theta = start + (end - start) i / 2 for i = 0, 1, 2
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
    # X^(t + end h) = X^(t + start h) + integral of X^' of the mode
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
    # margin(theta) = 0 for start <= theta <= 1, a root in an interval that shrinks
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


@allocating_kernel
def _run(
    model: Model, size: Size, order: int, switched: int, bounds: Bounds, step: float,
    right: Array, left: Array, states: Array, switched_off: Array,
) -> int:  # fmt: skip
    """Fill ``states`` from its first row, and return the number of finite rows.

    Lechappe et al. 2018, (9) to (12), after (8), before (9) and after (36).

    ``switched`` is 1 if only the gain of the delay is switched off, 2 if all gains are. ``right``
    and ``left`` hold the inputs, two rows for each step, and their limits from the left. The share
    of each step in which gains are off is written to ``switched_off``.
    """
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
            # tau_min <= tau^ <= tau_max
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
