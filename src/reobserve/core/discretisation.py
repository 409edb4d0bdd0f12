"""Exact sampling of linear systems whose inputs are polynomials of time between the samples."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_whole
from reobserve.core.errors import InputError, shown
from reobserve.core.matrices import as_positive, as_sized

Array = NDArray[np.float64]


def zero_order_hold(A: ArrayLike, B: ArrayLike, period: float) -> tuple[Array, Array]:
    """Ad and Bd of ``x' = A x + B u`` with u held: ``x(t + period) = Ad x(t) + Bd u``.

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

    Examples
    --------
    >>> from reobserve.core.discretisation import zero_order_hold
    >>> Ad, Bd = zero_order_hold([[-1.0]], [[1.0]], period=0.1)
    >>> print(Ad.round(3), Bd.round(3))
    [[0.905]] [[0.095]]
    """
    transition, effects = polynomial_hold(A, B, period, 0)
    return transition, effects[0]


def interpolating_hold(
    A: ArrayLike, B: ArrayLike, period: float, nodes: Sequence[float]
) -> tuple[Array, Array]:
    """Ad and B1 to Bk of ``x' = A x + B u`` with u the polynomial through k of its values.

    ``x(t + period) = Ad x(t) + sum_j Bj u(t + nodes[j] period)``. The nodes (0,) give the
    zero-order hold, (0, 1) the first-order hold, (0, 1/2, 1) parabolas.

    Parameters
    ----------
    A, B, period
        As in `zero_order_hold`.
    nodes
        k different fractions of the period.

    Returns
    -------
    tuple
        Ad, shape (n, n), and B1 to Bk, shape (k, n, p).

    Raises
    ------
    InputError
        If the shapes do not fit or the period is not positive.
    """
    places = as_sized("nodes", nodes)
    if places.ndim != 1 or len(np.unique(places)) != len(places) or not len(places):
        raise InputError("nodes", f"{shown(places.tolist())} must be different numbers")
    transition, effects = polynomial_hold(A, B, period, len(places) - 1)
    with np.errstate(all="ignore"):  # what is not finite is refused
        coefficients = np.linalg.inv(np.vander(places, increasing=True))
        matrices = np.einsum("ij,inp->jnp", coefficients, effects)
    if not np.isfinite(matrices).all():
        raise InputError("nodes", f"{shown(places.tolist())} are too near each other")
    return transition, matrices


def polynomial_hold(A: ArrayLike, B: ArrayLike, period: float, degree: int) -> tuple[Array, Array]:
    """Ad and B0 to Bd of ``x' = A x + B u`` with ``u = sum_k ck (s / period)^k``, s since t.

    ``x(t + period) = Ad x(t) + sum_k Bk ck``. All come from one exponential, of the system with
    a chain of integrators for u before it, so that a singular A does no harm (Van Loan 1978).

    Parameters
    ----------
    A, B, period
        As in `zero_order_hold`.
    degree
        d, from 0 on.

    Returns
    -------
    tuple
        Ad, shape (n, n), and B0 to Bd, shape (d + 1, n, p).

    Raises
    ------
    InputError
        If the shapes do not fit or the period is not positive.
    """
    from scipy.linalg import expm

    state, control, degree = as_sized("A", A), as_sized("B", B), as_whole("degree", degree, 0, 50)
    if state.ndim != 2 or state.shape[0] != state.shape[1]:
        raise InputError("A", f"has shape {state.shape}, must be square")
    if control.ndim != 2 or len(control) != len(state):
        raise InputError("B", f"has shape {control.shape}, must have {len(state)} rows like A")
    n, p = control.shape
    block = np.zeros((n + (degree + 1) * p,) * 2)
    # In units of the period: the chain holds u and its derivatives, k! ck at the start.
    block[:n, :n], block[:n, n : n + p] = state, control
    with np.errstate(over="ignore", invalid="ignore"):  # refused below
        block *= as_positive("period", period)
        block[n : n + degree * p, n + p :] = np.eye(degree * p)
        held: Array = expm(block)
    if not np.isfinite(held).all():
        raise InputError("period", f"{period:g} s takes the states beyond floating-point numbers")
    factorials = np.cumprod([1.0, *range(1, degree + 1)])
    effects = held[:n, n:].reshape(n, degree + 1, p).transpose(1, 0, 2)
    return np.ascontiguousarray(held[:n, :n]), effects * factorials[:, None, None]


def held_noise(A: ArrayLike, density: ArrayLike, period: float) -> Array:
    """The covariance that white noise adds to the state of ``x' = A x + w`` over a period.

        Q = int_0^T exp(A s) W exp(A' s) ds

    By Van Loan's exponential (1978) over a fraction of the period, which is then doubled; so it
    does not overflow where states decay fast.

    Parameters
    ----------
    A
        Shape (n, n) [1/s].
    density
        W, the spectral density of w, shape (n, n).
    period
        T [s].

    Raises
    ------
    InputError
        If the period is not positive, or takes the states beyond floating-point numbers.
    """
    from scipy.linalg import expm

    state, noise = as_sized("A", A), as_sized("density", density)
    n, length = len(state), as_positive("period", period)
    doublings = max(0, math.frexp(2.0 * length * np.linalg.norm(state, 1))[1])
    step = math.ldexp(length, -doublings)
    # exp([-A W; 0 A'] h) = [. exp(-A h) Q(h); 0 exp(A' h)]
    block: Array = expm(step * np.block([[-state, noise], [np.zeros((n, n)), state.T]]))
    transition = block[n:, n:].T
    Q = transition @ block[:n, n:]
    with np.errstate(over="ignore", invalid="ignore"):  # refused below
        for _ in range(doublings):
            # Q(2h) = Q(h) + exp(A h) Q(h) exp(A' h)
            Q = Q + transition @ Q @ transition.T
            transition = transition @ transition
    if not np.isfinite(Q).all():
        raise InputError("period", f"{period:g} s takes the states beyond floating-point numbers")
    return 0.5 * (Q + Q.T)
