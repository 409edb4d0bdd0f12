"""Base class of the normal-form observers: their inputs, state and estimates."""

from __future__ import annotations

import warnings
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_kind
from reobserve.core.errors import InputError, shown
from reobserve.core.matrices import as_vector
from reobserve.core.value import Value, converter
from reobserve.observers.contract import IntegratingObserver
from reobserve.observers.fixed_step import Samples, Steps
from reobserve.observers.record import Rows, check_state
from reobserve.observers.run import Run
from reobserve.synthesis.normal_form.convergence import convergence, warning
from reobserve.synthesis.normal_form.transform import NormalForm

Array = NDArray[np.float64]


class ConvergenceWarning(UserWarning):
    """A trajectory leaves the domain in which the series of its observer converges."""


@dataclass(frozen=True, eq=False, repr=False)
class NormalFormState(Value):
    """All an observer remembers: a value that may be stored, copied and stepped again.

    ``values`` are x^ or, for the transformed form, z, shape (n,); the rest is as in
    `reobserve.observers.record.ObserverState`.
    """

    values: Array
    sample: Array | None = None
    count: int = 0
    time: float | None = None


@dataclass(frozen=True, eq=False, repr=False)
class NormalFormObserver(IntegratingObserver[NormalFormState]):
    """Base class of normal-form observers, which estimate x from y and known inputs.

    Its estimate is ``state``, x^, shape (k, n). Without a state a run starts from x^ = 0, the
    equilibrium about which the series are expanded.

    Parameters
    ----------
    normal_form
        The series, of a degree above the order.
    order
        The degree up to which the gain L is kept, as the paper counts; S and T are kept up to
        one degree more. Order 0 is the constant gain.
    sampling_period
        [s], and the step of the method.

    Raises
    ------
    InputError
        If the order is not from 0 to the degree of the normal form less one, or the period not
        positive.
    """

    normal_form: NormalForm = field(metadata=converter(as_kind, NormalForm))
    order: int = field(kw_only=True)

    units: ClassVar[Mapping[str, str]] = {"state": ""}

    def __post_init__(self) -> None:
        super().__post_init__()
        highest = self.normal_form.problem.degree - 1
        whole = isinstance(self.order, int | np.integer) and not isinstance(self.order, bool)
        if not whole or not 0 <= self.order <= highest:
            raise InputError(
                "order",
                f"{shown(self.order)} must be from 0 to {highest}, one less than the degree of "
                "the series",
            )
        self._set("order", int(self.order))

    @property
    def measurements(self) -> int:
        """p, the number of outputs of the system."""
        return self.normal_form.problem.system.outputs

    @property
    def inputs(self) -> int:
        """m, the number of known inputs of the system."""
        return self.normal_form.inputs

    @abstractmethod
    def _values(self, estimate: Array) -> Array:
        """The values that a state holds for an estimate of x."""

    @abstractmethod
    def _run(self, known: Samples, rows: Array) -> int:
        """Run the compiled loop, fill ``rows`` from the first, and return how many are finite.

        ``known`` has the columns of y and then those of u.
        """

    @abstractmethod
    def _estimates(self, rows: Array) -> dict[str, Array]:
        """The estimates, by name, of rows of such values."""

    def init(self, state: ArrayLike) -> NormalFormState:
        """The state at the first sample, from an estimate of x, shape (n,).

        Raises
        ------
        InputError
            If it is not n finite numbers.
        """
        n = self.normal_form.problem.system.states
        return NormalFormState(self._values(as_vector("state", state, n)))

    def _start(self, first: Array) -> NormalFormState:
        return self.init(np.zeros(self.normal_form.problem.system.states))

    def _checked(self, state: Any) -> NormalFormState:
        n = self.normal_form.problem.system.states
        p, m = self.measurements, self.inputs
        inputs_too = f", {m} inputs" if m else ""
        problem = f"must be of an observer of {n} states{inputs_too} and {p} outputs"
        return check_state(state, NormalFormState, problem, values=(n,), sample=(p + m,))

    def _integrate(self, state: NormalFormState, steps: Steps) -> Rows:
        known = steps.y
        if self.inputs:
            known = Samples(*(np.hstack(sides) for sides in zip(steps.y, steps.u, strict=True)))
        rows = np.empty((known.steps + 1, len(state.values)))
        rows[0] = state.values
        finite = self._run(known, rows)
        after = NormalFormState(rows[-1].copy(), state.sample, state.count + known.steps)
        return Rows(self._estimates(rows[:finite]), finite, after)

    def check_domain(self, run: Run[NormalFormState]) -> str | None:
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
        sentence = warning(convergence(self.normal_form.S), run["state"], self.sampling_period)
        if sentence is not None:
            warnings.warn(sentence, ConvergenceWarning, stacklevel=2)
        return sentence
