"""What the observers of a normal form have in common: the record they read, state and result."""

from __future__ import annotations

import warnings
from abc import abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.errors import InputError, shown
from reobserve.numerics.arguments import as_kind
from reobserve.numerics.matrices import as_positive, as_vector
from reobserve.observers.contract import (
    FixedStepObserver,
    OnDivergence,
    Record,
    Rows,
    Samples,
    check_state,
)
from reobserve.synthesis.normal_form.convergence import convergence, warning
from reobserve.synthesis.normal_form.design import NormalForm

Array = NDArray[np.float64]


class ConvergenceWarning(UserWarning):
    """A trajectory leaves the domain in which the series of its observer converges."""


@dataclass(frozen=True)
class State:
    """All an observer remembers: a value that may be stored, copied and stepped again.

    ``values`` are x^ or, for the transformed form, z, shape (n,); ``count`` steps were taken.
    """

    values: Array
    count: int = 0


@dataclass(frozen=True)
class Run:
    """Estimates at the ends of the steps of a record.

    ``estimate`` x^ and ``coordinates`` z have shape (m, n), their first row at the start of the
    record; an identity observer has no z of its own, there they are None. ``diverged_at`` is
    None, or the time [s] since that start after which the state left the range of floating-point
    numbers; then m counts the rows up to it. ``state`` is the one to go on from, or after a
    divergence the one that the run started from.
    """

    estimate: Array
    coordinates: Array | None
    state: State
    diverged_at: float | None


@dataclass(frozen=True, eq=False)
class NormalFormObserver(FixedStepObserver[State, Run]):
    """An observer that measures y of an autonomous system and estimates its state.

    It reads the record at both ends and in the middle of each step: two samples a step.

    Parameters
    ----------
    normal_form
        The series, of a degree above the order.
    order
        The degree up to which the gain L is kept, as the paper counts; S and T are kept up to
        one degree more. Order 0 is the constant gain.
    step_size
        [s].

    Raises
    ------
    InputError
        If the order is not from 0 to the degree of the normal form less one.
    """

    normal_form: NormalForm
    order: int
    step_size: float

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "step_size", as_positive("step_size", self.step_size))
        highest = as_kind("normal_form", self.normal_form, NormalForm).problem.degree - 1
        whole = isinstance(self.order, int | np.integer) and not isinstance(self.order, bool)
        if not whole or not 0 <= self.order <= highest:
            raise InputError(
                "order",
                f"{shown(self.order)} must be from 0 to {highest}, one less than the degree of "
                "the series",
            )
        put(self, "order", int(self.order))

    @abstractmethod
    def _start(self, estimate: Array) -> Array:
        """The state for an estimate of x."""

    @abstractmethod
    def _run(self, values: Array, output: Array, rows: Array) -> int:
        """Run the compiled loop, fill ``rows`` with states; return how many are finite."""

    @abstractmethod
    def _read(self, rows: Array) -> tuple[Array, Array | None]:
        """The estimates and, if the states are not these, the coordinates z."""

    def init(self, initial_estimate: ArrayLike) -> State:
        """The state before the first step, from an estimate of x, shape (n,).

        Raises
        ------
        InputError
            If it is not n finite numbers.
        """
        n = self.normal_form.problem.system.states
        return State(self._start(as_vector("initial_estimate", initial_estimate, n)))

    def step(self, state: State, output: ArrayLike) -> tuple[State, Array]:
        """One step: the next state, and the estimate at the step's end, shape (n,).

        ``output`` holds y at the start, the middle and the end of the step, shape (3, p).
        Stepping through a record gives the bits that `run` gives.

        Raises
        ------
        InputError
            As `run`.
        DivergenceError
            As `run`.
        """
        run = self.run(output, state)
        return run.state, run.estimate[-1]

    def run(self, output: ArrayLike, state: State, *, on_divergence: OnDivergence = "raise") -> Run:
        """Estimates over a whole record, by one compiled loop.

        Parameters
        ----------
        output
            Measured y, shape (2 m + 1, p), sampled every half step.
        state
            From `init`, or from an earlier run to go on.
        on_divergence
            ``raise``, or ``return`` what there was up to then, with `Run.diverged_at`.

        Raises
        ------
        InputError
            If a shape is wrong or a sample is not finite.
        DivergenceError
            If an estimate leaves the range of floating-point numbers; it says whether a shorter
            step would have helped.
        """
        system = self.normal_form.problem.system
        problem = f"must be of an observer of {system.states} states"
        state = check_state(state, State, problem, values=(system.states,))
        record = (Samples.read("output", output, None, system.outputs),)
        return self._observe(state, record, on_divergence)

    def _fill(self, state: State, record: Record) -> Rows:
        (samples,) = record
        rows = np.empty((samples.steps + 1, len(state.values)))
        rows[0] = state.values
        finite = self._run(state.values, samples.right, rows)
        estimate, coordinates = self._read(rows[:finite])
        arrays = (estimate,) if coordinates is None else (estimate, coordinates)
        return Rows(arrays, finite, State(rows[-1].copy(), state.count + samples.steps))

    def _result(self, arrays: tuple[Array, ...], state: State, diverged_at: float | None) -> Run:
        return Run(arrays[0], arrays[1] if len(arrays) > 1 else None, state, diverged_at)

    def check_domain(self, run: Run) -> str | None:
        """Warn if the estimates of a run leave the domain in which S converges.

        The radius is estimated from the parts of S, for which the normal form must be of a
        degree well above the order.

        Returns
        -------
        str or None
            The sentence of the `ConvergenceWarning` that was given.

        Raises
        ------
        InputError
            If the series is too short for an estimate.
        """
        sentence = warning(convergence(self.normal_form.S), run.estimate, self.step_size)
        if sentence is not None:
            warnings.warn(sentence, ConvergenceWarning, stacklevel=2)
        return sentence
