"""Extended high-gain observer of state and input delay (Lechappe et al. 2018, (9) to (11)).

    X^' = Lambda_ext(xi^) X^ + f_ext(X^) + g_ext(y) u(t) - lambda(xi^)^-1 S^-1 C^T (x^1 - y)
    xi^ = G(y) sum over i = 1..m of (-1)^i tau^^(i-1) / i! u^(i)(t)                          (10)

The last state is the delay: row n has xi^ tau^ + G(y) u, the Taylor expansion of the delayed input
up to order m, and the delay itself moves by its gain over xi^. (The printed (34) lacks the C^T.)
Its rate is projected (11): at a bound of its interval the delay is held as long as it would leave.
Where |xi^| is below a threshold the delay cannot be seen, and gains are switched off: that of the
delay alone, or all of them.

Held and free, on and off are different right-hand sides, so a step that would run from one into
another is cut where that happens: the instant is found by bisection, and each part is a step of
the classical Runge-Kutta method. This keeps its order, and the delay inside its interval, also
between the samples. Inside a step, inputs are taken from their three samples by a parabola.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.errors import InputError, shown
from reobserve.models.triangular import TriangularModel
from reobserve.numerics.arguments import as_kind, as_word
from reobserve.numerics.matrices import as_positive, as_positive_definite, as_scalar, as_vector
from reobserve.observers.contract import (
    FixedStepObserver,
    OnDivergence,
    Record,
    Rows,
    Samples,
    check_state,
)
from reobserve.observers.extended_high_gain_loop import run
from reobserve.synthesis.high_gain import high_gain, high_gain_over_time

Array = NDArray[np.float64]

SWITCHED = ("delay", "all")

_FORGOTTEN = 100.0


class SwitchedOffWarning(UserWarning):
    """The threshold is above |xi^| for the whole record: the delay was never observed."""


@dataclass(frozen=True)
class State:
    """All the observer remembers: x^ and tau^ in one vector, shape (n + 1,), and its steps."""

    values: Array
    count: int = 0


@dataclass(frozen=True)
class Run:
    """Estimates at the ends of the steps of a record.

    ``estimate`` x^, shape (k, n), and ``delay`` tau^ [s], shape (k,), have their first row at the
    start of the record; ``switched_off``, shape (k - 1,), is the share of each step in which the
    gain was off. ``diverged_at`` is None, or the time [s] since that start after which the state
    left the range of floating-point numbers; then k counts the rows up to it. ``state`` is the
    one to go on from, or after a divergence the one that the run started from.
    """

    estimate: Array
    delay: Array
    switched_off: Array
    state: State
    diverged_at: float | None


@dataclass(frozen=True, eq=False)
class ExtendedHighGainObserver(FixedStepObserver[State, Run]):
    """The observer (9) for a model (1) of any size and any Taylor order.

    Parameters
    ----------
    model
        f, G and their parameters.
    step_size
        [s]; a record has two samples a step.
    rho
        The one tuning parameter of the gain [1/s].
    order
        m, the order of the Taylor expansion: how many derivatives of u a record holds.
    delay_bounds
        The interval [s] in which the delay is known to be.
    threshold
        Of |xi^|, below which gains are switched off; 0 for never.
    switched
        Which: ``delay`` or ``all``.
    initial_matrix
        S(0), shape (n + 1, n + 1), of the dynamic equation of the gain; None for the algebraic
        one, to whose solution it comes.

    Raises
    ------
    InputError
        If rho or the step is not positive, the order below 1, the bounds are negative or not in
        order, the threshold is negative, ``switched`` another word, or S(0) not positive definite.
    """

    model: TriangularModel
    step_size: float
    rho: float
    order: int
    delay_bounds: tuple[float, float]
    threshold: float = 0.0
    switched: str = "delay"
    initial_matrix: ArrayLike | None = None

    def __post_init__(self) -> None:
        put = object.__setattr__
        as_kind("model", self.model, TriangularModel)
        put(self, "step_size", as_positive("step_size", self.step_size))
        if not isinstance(self.order, int) or isinstance(self.order, bool) or self.order < 1:
            raise InputError(
                "order",
                f"{shown(self.order)} must be a whole number, 1 or more: order 0 holds no delay",
            )
        least, most = as_vector("delay_bounds", self.delay_bounds, 2).tolist()
        put(self, "delay_bounds", (least, most))
        if not 0.0 <= least < most:
            raise InputError("delay_bounds", f"[{least:g}, {most:g}] s must be 0 or more, rising")
        put(self, "threshold", as_scalar("threshold", self.threshold))
        if self.threshold < 0:
            raise InputError("threshold", f"{self.threshold:g} must not be negative")
        as_word("switched", self.switched, SWITCHED)
        size = self.model.states + 1
        if self.initial_matrix is not None:
            matrix = as_positive_definite("initial_matrix", self.initial_matrix, size)
            put(self, "initial_matrix", matrix)
        self._gains(np.zeros(1))

    def _gains(self, times: NDArray[Any]) -> Array:
        """S^-1 C^T at times since the start, shape (k, n + 1)."""
        size = self.model.states + 1
        gains = np.tile(high_gain(size, self.rho), (len(times), 1))
        if self.initial_matrix is not None:
            # What the start has left by then, e^(-rho t), is far below rounding.
            early = np.asarray(times) < _FORGOTTEN / self.rho
            gains[early] = high_gain_over_time(size, self.rho, self.initial_matrix, times[early])
        return gains

    def init(self, initial_estimate: ArrayLike, initial_delay: float) -> State:
        """The state before the first step, from x^(0), shape (n,), and tau^(0) [s].

        Raises
        ------
        InputError
            If a shape is wrong or the delay is outside its bounds (Assumption 6).
        """
        x = as_vector("initial_estimate", initial_estimate, self.model.states)
        delay = as_scalar("initial_delay", initial_delay)
        least, most = self.delay_bounds
        if not least <= delay <= most:
            raise InputError(
                "initial_delay", f"{delay:g} s must be inside its bounds, [{least:g}, {most:g}] s"
            )
        return State(np.append(x, delay))

    def step(
        self,
        state: State,
        output: ArrayLike,
        inputs: ArrayLike,
        output_before: ArrayLike | None = None,
        inputs_before: ArrayLike | None = None,
    ) -> tuple[State, Array, float]:
        """One step: the next state, and x^ and tau^ at the step's end.

        The arguments are those of `run` for a record of three rows. Stepping through a record
        gives the bits that `run` gives.

        Raises
        ------
        InputError
            As `run`.
        DivergenceError
            As `run`.
        """
        record = self._read(output, inputs, output_before, inputs_before)
        done = self._observe(self._checked(state), record)
        return done.state, done.estimate[-1], float(done.delay[-1])

    def run(
        self,
        output: ArrayLike,
        inputs: ArrayLike,
        state: State,
        output_before: ArrayLike | None = None,
        inputs_before: ArrayLike | None = None,
        *,
        on_divergence: OnDivergence = "raise",
    ) -> Run:
        """Estimates over a whole record, by one compiled loop.

        Parameters
        ----------
        output
            Measured y, shape (2 k + 1,), sampled every half step.
        inputs
            u and its derivatives up to the order m, shape (2 k + 1, m + 1).
        state
            From `init`, or from an earlier run to go on.
        output_before, inputs_before
            Where a record jumps between samples, as held noise does: the limits from the left.
        on_divergence
            ``raise``, or ``return`` what there was up to then, with `Run.diverged_at`.

        Raises
        ------
        InputError
            If a shape is wrong or a sample is not finite.
        DivergenceError
            If an estimate leaves the range of floating-point numbers; it says whether a shorter
            step would have helped.

        Warns
        -----
        SwitchedOffWarning
            If the gain was off for the whole record.
        """
        record = self._read(output, inputs, output_before, inputs_before)
        done = self._observe(self._checked(state), record, on_divergence)
        if len(done.switched_off) and float(np.min(done.switched_off)) >= 1.0:
            warnings.warn(
                f"threshold: {self.threshold:g} is above |xi^| for 100 % of the record, so the "
                "delay was never observed; lower it",
                SwitchedOffWarning,
                stacklevel=2,
            )
        return done

    def _checked(self, state: State) -> State:
        n = self.model.states
        problem = f"must be of an observer of {n} states"
        return check_state(state, State, problem, values=(n + 1,))

    def _read(
        self,
        output: ArrayLike,
        inputs: ArrayLike,
        output_before: ArrayLike | None,
        inputs_before: ArrayLike | None,
    ) -> Record:
        for name, values in (("inputs", inputs), ("inputs_before", inputs_before)):
            shape = _shape(values)
            if values is not None and (len(shape) != 2 or shape[1] != self.order + 1):
                raise InputError(
                    name,
                    f"has shape {shape}, must have {self.order + 1} columns: u and its "
                    f"derivatives up to the order {self.order}",
                )
        u = Samples.read("inputs", inputs, inputs_before, self.order + 1)
        y = Samples.read("output", output, output_before, None, rows=len(u.right), like="u")
        return y, u

    def _fill(self, state: State, record: Record) -> Rows:
        y, u = record
        states = np.empty((y.steps + 1, self.model.states + 1))
        off = np.zeros(y.steps + 1)
        states[0] = state.values
        right = left = self._table(y.right, u.right, state.count)
        if y.left is not y.right or u.left is not u.right:
            left = self._table(y.left, u.left, state.count)
        finite = run(
            self.model.drift,
            self.model.input_gain,
            self.model.parameters,
            self.order,
            1 + SWITCHED.index(self.switched),
            np.array([*self.delay_bounds, self.threshold], dtype=np.float64),
            self.step_size,
            right,
            left,
            states,
            off[1:],
        )
        return Rows((states, off), finite, State(states[-1].copy(), state.count + y.steps))

    def _table(self, y: Array, u: Array, count: int) -> Array:
        """y, u and its derivatives, and the gains, one row a sample, from step ``count`` on."""
        half = np.arange(2 * count, 2 * count + len(y)) * (0.5 * self.step_size)
        table = np.empty((len(u), u.shape[1] + self.model.states + 2))
        table[:, 0], table[:, 1 : u.shape[1] + 1] = y, u
        table[:, u.shape[1] + 1 :] = self._gains(half)
        return table

    def _result(self, arrays: tuple[Array, ...], state: State, diverged_at: float | None) -> Run:
        states, off = arrays
        return Run(
            np.ascontiguousarray(states[:, :-1]), states[:, -1].copy(), off[1:], state, diverged_at
        )


def _shape(values: ArrayLike | None) -> tuple[int, ...]:
    """The shape of an array, or of lists; rows of different lengths count as one column."""
    try:
        return np.asarray(values).shape
    except Exception:  # rows of different lengths, or an object that fails in a way of its own
        return (len(values),) if isinstance(values, list | tuple) else ()
