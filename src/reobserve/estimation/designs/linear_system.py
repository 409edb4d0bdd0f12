"""A linear system as a model's file states it, and the state that its filters start from."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

import numpy as np

from reobserve.core.discretisation import zero_order_hold
from reobserve.core.errors import InputError
from reobserve.core.matrices import FloatArray, as_floats, as_positive, as_vector
from reobserve.core.validation import checked
from reobserve.estimation.designs.signals import Signals
from reobserve.systems.linear import LinearModel

Array = FloatArray


def positive(place: str, value: float) -> None:
    """Greater than zero."""
    as_positive(place, value)


Period = Annotated[float, checked(positive)]


@dataclass(frozen=True, eq=False, kw_only=True)
class LinearSystem:
    """x' = A x + B u or x(k+1) = A x(k) + B u(k), by the word ``time``, with y = H x + D u.

    A system in continuous time is sampled for inputs that are held. ``Q`` and ``R`` are covariances
    of the noise of a sample, in either time.
    """

    time: Literal["continuous", "discrete"]
    sampling_period: Period
    states: Signals
    inputs: Signals = field(default_factory=dict)
    measurements: Signals
    A: Array
    B: Array | None = None
    H: Array
    D: Array | None = None
    Q: Array = field(default_factory=lambda: np.array(0.0))
    R: Array = field(default_factory=lambda: np.array(1.0))
    initial_state: list[float] | None = None
    initial_variance: Array = field(default_factory=lambda: np.array(0.0))

    def __post_init__(self) -> None:
        n, p, m = len(self.states), len(self.inputs), len(self.measurements)
        shapes = {"A": (n, n), "B": (n, p), "H": (m, n), "D": (m, p)}
        for name, shape in shapes.items():
            check_shape(name, getattr(self, name), shape)
        if p and self.B is None:
            raise InputError("B", f"is missing, must have shape {(n, p)}, as there are inputs")
        if self.initial_state is not None:
            as_vector("initial_state", self.initial_state, n)

    @property
    def mean(self) -> Array:
        """The initial state, zero where it is not stated, shape (n,)."""
        n = len(self.states)
        return np.zeros(n) if self.initial_state is None else as_floats("", self.initial_state)

    @property
    def model(self) -> LinearModel:
        """The sampled model; `InputError` if it is none that filters can have."""
        n, p = len(self.states), len(self.inputs)
        A, B = self.A, np.zeros((n, p)) if self.B is None else self.B
        if self.time == "continuous":
            A, B = zero_order_hold(A, B, self.sampling_period)
        return LinearModel(
            A, B, self.H, self.D, self.Q, self.R, unusual=self.time == "continuous",
            sampling_period=self.sampling_period,
        )  # fmt: skip


def check_shape(name: str, value: Any, shape: tuple[int, ...]) -> None:
    """Refuse a matrix of another shape than the signals ask for; None is not there."""
    if value is not None and value.shape != shape:
        raise InputError(name, f"has shape {value.shape}, must be {shape}, as the signals say")
