"""What the observers of a normal form have in common: the record they read, state and result."""

from __future__ import annotations

import warnings
from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.errors import DivergenceError, InputError
from reobserve.matrices import as_positive, as_record, as_vector
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
class NormalFormObserver(ABC):
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
        as_positive("step_size", self.step_size)
        highest = self.normal_form.problem.degree - 1
        if not 0 <= self.order <= highest:
            raise InputError(
                "order",
                f"{self.order} must be from 0 to {highest}, one less than the degree of the series",
            )

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
            If the state leaves the range of floating-point numbers in this step.
        """
        run = self.run(output, state)
        if run.diverged_at is not None:
            raise DivergenceError(type(self).__name__, state.count * self.step_size)
        return run.state, run.estimate[-1]

    def run(self, output: ArrayLike, state: State) -> Run:
        """Estimates over a whole record, by one compiled loop.

        Parameters
        ----------
        output
            Measured y, shape (2 m + 1, p), sampled every half step.
        state
            From `init`, or from an earlier run to go on.

        Raises
        ------
        InputError
            If a shape is wrong or a sample is not finite.
        """
        system = self.normal_form.problem.system
        if state.values.shape != (system.states,):
            raise InputError("state", f"must be of an observer of {system.states} states")
        samples = as_record("output", output, system.outputs)
        steps = len(samples) // 2
        rows = np.empty((steps + 1, system.states))
        rows[0] = state.values
        finite = self._run(state.values, samples, rows)
        estimate, coordinates = self._read(rows[:finite])
        bad = ~np.isfinite(estimate).all(axis=1)
        if bad.any():  # the estimate T(z) may overflow where z does not
            finite = int(np.argmax(bad))
            estimate = estimate[:finite]
            coordinates = None if coordinates is None else coordinates[:finite]
        if finite == steps + 1:
            after = State(rows[-1].copy(), state.count + steps)
            return Run(estimate, coordinates, after, None)
        return Run(estimate, coordinates, state, max(finite - 1, 0) * self.step_size)

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
