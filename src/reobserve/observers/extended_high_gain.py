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
from reobserve.core.covariances import as_positive_definite
from reobserve.core.errors import InputError
from reobserve.core.matrices import as_positive, as_scalar, as_vector
from reobserve.core.value import Value, converter, for_loop
from reobserve.observers.contract import IntegratingObserver
from reobserve.observers.extended_high_gain_loop import run
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
        xi^ = G(y) sum over i = 1..m of (-1)^i tau^^(i-1) / i! u^(i)(t)                      (10)

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
    >>> run = observer.run(time - 1.6, time, state=observer.init([-1.6], delay=0.3))
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
        finite = run(
            self.model.drift,
            self.model.input_gain,
            for_loop(self.model.parameters),
            self.order,
            1 + SWITCHED.index(self.switched),
            np.array([*self.delay_bounds, self.threshold], dtype=np.float64),
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
