"""A linear model in discrete time with Gaussian noise: what Kalman filters and their kin assume.

    x(k+1) = A x(k) + B u(k) + w(k)             w ~ N(0, Q)
    z(k+1) = H x(k+1) + D u(k) + v(k+1)         v ~ N(0, R)

The measurement that ends a step sees the input that was held during the step: of an acceleration,
say, that has a feedthrough, the limit from the left.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_flag
from reobserve.core.errors import InputError, shown
from reobserve.core.matrices import as_floats, as_matrix, as_positive

Array = NDArray[np.float64]


class ModelArrays(NamedTuple):
    """The matrices of a model as compiled loops read them."""

    A: Array
    B: Array
    H: Array
    D: Array
    Q: Array
    R: Array


@dataclass(frozen=True, eq=False)
class LinearModel:
    """A linear model in discrete time.

    Parameters
    ----------
    A
        Transition of the state, shape (n, n).
    B
        Effect of the input, shape (n, p).
    H
        Measurement, shape (m, n).
    Q
        Covariance of the process noise: a number, n numbers or (n, n); positive semidefinite.
    R
        Covariance of the measurement noise: a number, m numbers or (m, m); positive definite.
    D
        Feedthrough, shape (m, p); zero if left out.
    unusual
        Accept a transition that looks like one of continuous time, see below.
    sampling_period
        Of the transition [s]; left out, time is counted in samples.

    Raises
    ------
    InputError
        If the shapes do not fit; Q or R is not symmetric positive (semi)definite; the sampling
        period is not positive; or A looks like one of continuous time: all its eigenvalues have a
        real part of zero or less, or one with a negative real part lies outside the unit circle.
        Sampling a real system gives neither, unless it turns more than a quarter of a circle in a
        sample.
    """

    A: Array
    B: Array
    H: Array
    Q: Array
    R: Array
    D: Array = None  # type: ignore[assignment]  # zeros, once it is made
    unusual: bool = False
    sampling_period: float = field(default=1.0, kw_only=True)

    if TYPE_CHECKING:  # what it takes is wider than what it then holds

        def __init__(
            self,
            A: ArrayLike,
            B: ArrayLike,
            H: ArrayLike,
            Q: ArrayLike,
            R: ArrayLike,
            D: ArrayLike | None = ...,
            unusual: bool = ...,
            *,
            sampling_period: float = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        object.__setattr__(self, "unusual", as_flag("unusual", self.unusual))
        A = as_floats("A", self.A)
        if A.ndim != 2 or A.shape[0] != A.shape[1] or not A.size:
            raise InputError("A", f"has shape {A.shape}, must be square")
        n = len(A)
        B, H = as_floats("B", self.B), as_floats("H", self.H)
        if B.ndim != 2 or len(B) != n:
            raise InputError("B", f"has shape {B.shape}, must have {n} rows like A, {A.shape}")
        if H.ndim != 2 or H.shape[1] != n or not len(H):
            raise InputError("H", f"has shape {H.shape}, must have {n} columns like A, {A.shape}")
        m, p = len(H), B.shape[1]
        D = np.zeros((m, p)) if self.D is None else as_floats("D", self.D)
        if D.shape != (m, p):
            raise InputError("D", f"has shape {D.shape}, must be {(m, p)}, as H and B ask for")
        if not self.unusual:
            _check_discrete(A)
        put = object.__setattr__
        put(self, "A", A)
        put(self, "B", B)
        put(self, "H", H)
        put(self, "D", D)
        put(self, "Q", as_covariance("Q", self.Q, n))
        put(self, "R", as_covariance("R", self.R, m, definite=True))
        put(self, "sampling_period", as_positive("sampling_period", self.sampling_period))

    @cached_property
    def arrays(self) -> ModelArrays:
        """The matrices, C-contiguous."""
        names = ModelArrays._fields
        return ModelArrays(*(np.ascontiguousarray(getattr(self, name)) for name in names))

    @property
    def states(self) -> int:
        """Their number n."""
        return len(self.arrays.A)

    @property
    def inputs(self) -> int:
        """Their number p."""
        return int(self.arrays.B.shape[1])

    @property
    def outputs(self) -> int:
        """Their number m."""
        return len(self.arrays.H)


def as_covariance(name: str, value: ArrayLike, size: int, *, definite: bool = False) -> Array:
    """A covariance from a number (times identity), a diagonal or the matrix itself.

    Raises
    ------
    InputError
        If it has another size, is not symmetric, or has an eigenvalue below zero by more than
        rounding, or with ``definite`` one that is not above zero.
    """
    matrix = as_matrix(name, value, size)
    if not np.array_equal(matrix, matrix.T):
        raise InputError(name, f"{shown(matrix.tolist())} must be symmetric")
    eigenvalues = np.linalg.eigvalsh(matrix)
    least = 0.0 if definite else -1e-12 * max(float(eigenvalues[-1]), 0.0)
    if eigenvalues[0] < least or (definite and eigenvalues[0] <= 0):
        wanted = "definite" if definite else "semidefinite"
        listed = ", ".join(f"{value:g}" for value in eigenvalues)
        raise InputError(name, f"must be positive {wanted}, its eigenvalues are {listed}")
    return matrix


def _check_discrete(A: Array) -> None:
    """Refuse what can hardly be the transition of a sampled system."""
    eigenvalues = np.linalg.eigvals(A)
    outside = eigenvalues[(eigenvalues.real < 0) & (np.abs(eigenvalues) > 1)]
    if np.all(eigenvalues.real <= 0) or outside.size:
        suspect = outside[0] if outside.size else eigenvalues[np.argmin(eigenvalues.real)]
        shown = suspect if suspect.imag else suspect.real
        raise InputError(
            "A",
            f"has the eigenvalue {shown:.4g}, as A of continuous time has; it must be the "
            "transition over one sample (sample it by zero_order_hold, or say unusual=True)",
        )
