"""Exact sampling of linear systems whose inputs are held between the samples."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.errors import InputError
from reobserve.matrices import as_floats, as_positive

Array = NDArray[np.float64]


def zero_order_hold(A: ArrayLike, B: ArrayLike, period: float) -> tuple[Array, Array]:
    """Ad and Bd of ``x' = A x + B u`` with u held: ``x(t + period) = Ad x(t) + Bd u``.

    Both come from one exponential of [[A, B], [0, 0]], so that a singular A does no harm
    (Van Loan 1978).

    Parameters
    ----------
    A
        Shape (n, n) [1/s].
    B
        Shape (n, p).
    period
        Between the samples [s].

    Raises
    ------
    InputError
        If the shapes do not fit or the period is not positive.
    """
    from scipy.linalg import expm

    state, control = as_floats("A", A), as_floats("B", B)
    if state.ndim != 2 or state.shape[0] != state.shape[1]:
        raise InputError("A", f"has shape {state.shape}, must be square")
    if control.ndim != 2 or len(control) != len(state):
        raise InputError("B", f"has shape {control.shape}, must have {len(state)} rows like A")
    n, p = control.shape
    block = np.zeros((n + p, n + p))
    block[:n, :n], block[:n, n:] = state, control
    held: Array = expm(block * as_positive("period", period))
    return np.ascontiguousarray(held[:n, :n]), np.ascontiguousarray(held[:n, n:])
