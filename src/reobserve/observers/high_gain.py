"""Standard high-gain observer of a system with an input delay (Lechappe et al. 2018, (36)).

    x^' = Lambda x^ + f(x^) + (0, ..., 0, G(y))^T u(t - tau_m) - S^-1 C^T (x^1 - y)

It estimates the state alone and takes the delay to be a constant tau_m. The paper prints S^-1
without C^T, in (34), too: that is a matrix times a number, not a vector. With C^T it is the first
column of S^-1, the gains binom(n, i) rho^i.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.models.triangular import TriangularModel
from reobserve.numerics.arguments import as_kind
from reobserve.numerics.kernel import kernel
from reobserve.numerics.matrices import as_positive, as_vector
from reobserve.observers import contract
from reobserve.observers.contract import FixedStepObserver, OnDivergence, Rows, Samples, check_state
from reobserve.synthesis.high_gain import high_gain

Array = NDArray[np.float64]


class Record(NamedTuple):
    """What the observer reads, arrays of shape (2 m + 1,); see `HighGainObserver.run`."""

    output: Array
    output_before: Array
    delayed_input: Array
    input_before: Array


@dataclass(frozen=True)
class State:
    """All the observer remembers: a value that may be stored, copied and stepped again.

    ``estimate`` is x^, shape (n,); ``count`` steps were taken.
    """

    estimate: Array
    count: int = 0


@dataclass(frozen=True)
class Run:
    """Estimates at the ends of the steps of a record.

    ``estimate`` x^ has shape (m, n), its first row at the start of the record. ``diverged_at`` is
    None, or the time [s] since that start after which the state left the range of floating-point
    numbers; then m counts the rows up to it. ``state`` is the one to go on from, or after a
    divergence the one that the run started from.
    """

    estimate: Array
    state: State
    diverged_at: float | None


@dataclass(frozen=True, eq=False)
class HighGainObserver(FixedStepObserver[State, Run]):
    """The observer (36), integrated by the classical Runge-Kutta method.

    It reads the record at both ends and in the middle of each step: two samples a step. The
    method itself is stable only for rho times the step below 2.78.

    Parameters
    ----------
    model
        The plant as the observer knows it; n is its number of states.
    rho
        [1/s]; all eigenvalues of Lambda - S^-1 C^T C are -rho.
    step_size
        [s].

    Raises
    ------
    InputError
        If ``rho`` or ``step_size`` is not positive, or rho^n is beyond floating-point numbers.
    """

    model: TriangularModel
    rho: float
    step_size: float

    def __post_init__(self) -> None:
        put = object.__setattr__
        as_kind("model", self.model, TriangularModel)
        put(self, "rho", as_positive("rho", self.rho))
        put(self, "step_size", as_positive("step_size", self.step_size))
        _ = self.gain  # refuses what has no gain now and not at the first step

    @cached_property
    def gain(self) -> Array:
        """S^-1 C^T, shape (n,)."""
        return high_gain(self.model.states, self.rho)

    def init(self, initial_estimate: ArrayLike) -> State:
        """The state before the first step, from an estimate of x, shape (n,).

        Raises
        ------
        InputError
            If it is not n finite numbers.
        """
        return State(as_vector("initial_estimate", initial_estimate, self.model.states))

    def step(
        self,
        state: State,
        output: ArrayLike,
        delayed_input: ArrayLike,
        output_before: ArrayLike | None = None,
        input_before: ArrayLike | None = None,
    ) -> tuple[State, Array]:
        """One step: the next state, and the estimate at the step's end, shape (n,).

        The arguments are those of `run` for a record of three samples: the start, the middle and
        the end of the step. Stepping through a record gives the bits that `run` gives.

        Raises
        ------
        InputError
            As `run`.
        DivergenceError
            As `run`.
        """
        run = self.run(output, delayed_input, state, output_before, input_before)
        return run.state, run.estimate[-1]

    def run(
        self,
        output: ArrayLike,
        delayed_input: ArrayLike,
        state: State,
        output_before: ArrayLike | None = None,
        input_before: ArrayLike | None = None,
        *,
        on_divergence: OnDivergence = "raise",
    ) -> Run:
        """Estimates over a whole record, by one compiled loop.

        Parameters
        ----------
        output, delayed_input
            Measured y and u(t - tau_m), shape (2 m + 1,), sampled every half step.
        state
            From `init`, or from an earlier run to go on.
        output_before, input_before
            Where a record jumps at samples, as held noise does: the limits from the left, same
            shape. They are used at the ends of steps: a jump belongs there, not in the middle.
        on_divergence
            ``raise``, or ``return`` what there was up to then, with `Run.diverged_at`.

        Raises
        ------
        InputError
            If a shape is wrong, a sample is not finite or the state is not of such an observer.
        DivergenceError
            If an estimate leaves the range of floating-point numbers; it says whether a shorter
            step would have helped.
        """
        n = self.model.states
        state = check_state(state, State, f"must be of an observer of {n} states", estimate=(n,))
        y = Samples.read("output", output, output_before, None)
        u = Samples.read(
            "delayed_input", delayed_input, input_before, None,
            rows=len(y.right), like="output", left_name="input_before",
        )  # fmt: skip
        return self._observe(state, (y, u), on_divergence)

    def _fill(self, state: State, record: contract.Record) -> Rows:
        y, u = record
        rows = np.empty((y.steps + 1, self.model.states))
        rows[0] = state.estimate
        finite = _run(
            self.model.drift,
            self.model.input_gain,
            self.model.parameters,
            self.gain,
            self.step_size,
            Record(y.right, y.left, u.right, u.left),
            rows,
        )
        return Rows((rows,), finite, State(rows[-1].copy(), state.count + y.steps))

    def _result(self, arrays: tuple[Array, ...], state: State, diverged_at: float | None) -> Run:
        return Run(arrays[0], state, diverged_at)


@kernel
def _run(
    drift: Any,
    input_gain: Any,
    parameters: Array,
    gain: Array,
    step: float,
    record: Record,
    rows: Array,
) -> int:
    """Fill ``rows`` from its first one; return the number of finite rows."""
    n = rows.shape[1]
    slopes, x, f = np.empty((4, n)), np.empty(n), np.empty(n)
    measured, known, driven = np.empty(3), np.empty(3), np.empty(3)
    for k in range(len(rows) - 1):
        for j in range(2):
            measured[j], known[j] = record.output[2 * k + j], record.delayed_input[2 * k + j]
        measured[2], known[2] = record.output_before[2 * k + 2], record.input_before[2 * k + 2]
        for j in range(3):
            input_gain(measured[j : j + 1], parameters, driven[j : j + 1])
        for stage in range(4):
            place = (stage + 1) // 2
            for i in range(n):
                x[i] = rows[k, i]
                if stage > 0:
                    x[i] += (step if stage == 3 else 0.5 * step) * slopes[stage - 1, i]
            drift(x, parameters, f)
            error = x[0] - measured[place]
            for i in range(n):
                slopes[stage, i] = f[i] - gain[i] * error
                if i + 1 < n:
                    slopes[stage, i] += x[i + 1]
            slopes[stage, n - 1] += driven[place] * known[place]
        for i in range(n):
            mean = slopes[0, i] + 2.0 * slopes[1, i] + 2.0 * slopes[2, i] + slopes[3, i]
            after = rows[k, i] + step / 6.0 * mean
            if not np.isfinite(after):
                return k + 1
            rows[k + 1, i] = after
    return len(rows)
