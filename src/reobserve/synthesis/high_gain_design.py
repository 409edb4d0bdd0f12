"""Gains of a high-gain observer with one parameter rho (Lechappe et al. 2018, (9) and (34)).

S, symmetric and positive definite, solves the Lyapunov equation

    rho S + A^T S + S A - C^T C = 0,      A the shift upwards of size N,  C = (1, 0, ..., 0),

and the observer's gain is S^-1 C^T. Multiplied by S^-1 the equation says

    A - S^-1 C^T C = -(rho I + S^-1 A^T S),

so the error matrix has the eigenvalues of -(rho I + A^T): all of them are -rho. A companion matrix
with the polynomial (s + rho)^N has its coefficients in its first column, hence the gains

    S^-1 C^T = (binom(N, 1) rho, binom(N, 2) rho^2, ..., rho^N)^T.

S itself is the integral over s > 0 of e^(-rho s) v(s) v(s)^T, v(s) = e^(-A^T s) C^T, and
v_j(s) = (-s)^j / j! with j from 0; each entry is a gamma function.

An initial value S(0) requires the dynamic equation

    S' = -rho S - A^T S - S A + C^T C,

whose solution converges to the same S. Variation of constants gives it in closed form:

    S(t) = e^(-rho t) e^(-A^T t) S(0) e^(-A t) + integral over 0 < s < t of e^(-rho s) v(s) v(s)^T,

a sum of a positive definite and a semidefinite matrix, so S(t) is always invertible.
"""

from __future__ import annotations

from math import comb, factorial

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import gammainc

from reobserve.core.arguments import as_whole
from reobserve.core.covariances import as_positive_definite
from reobserve.core.errors import InputError
from reobserve.core.matrices import as_floats, as_positive

Array = NDArray[np.float64]


def lyapunov_matrix(size: int, rho: float) -> Array:
    """S of the algebraic equation: (-1)^(i+j) binom(i+j, i) / rho^(i+j+1), indices from 0.

    Lechappe et al. 2018, (9), (22), before (9) and after (22).

    Parameters
    ----------
    size, rho
        As in `high_gain`.

    Returns
    -------
    Array
        Shape (N, N); entry (i, j) in s^(i+j+1).
    """
    size, rho = as_whole("size", size, 1, _LARGEST), as_positive("rho", rho)
    index = np.arange(size)
    with np.errstate(over="ignore"):
        matrix = _at_one(size) * _powers(2 * size - 1, rho, -1.0)[index[:, None] + index]
    return _in_range(matrix, rho)


def high_gain(size: int, rho: float) -> Array:
    """S^-1 C^T of the algebraic equation: binom(N, i) rho^i for i = 1 to N.

    Lechappe et al. 2018, (9).

    Parameters
    ----------
    size
        N, the number of states: n of the standard observer (36), n + 1 of the extended one (9).
    rho
        [1/s].

    Returns
    -------
    Array
        Shape (N,); entry i, counted from 1, in 1/s^i.

    Raises
    ------
    InputError
        If ``size`` is not a whole number above zero, or ``rho`` is not positive or so large that
        a gain is beyond the range of floating-point numbers.
    """
    size, rho = as_whole("size", size, 1, _LARGEST), as_positive("rho", rho)
    scale = _powers(size, rho, 1.0)
    with np.errstate(over="ignore"):
        gain = np.array([float(comb(size, i + 1)) for i in range(size)]) * scale
    return _in_range(gain, rho)


def high_gain_over_time(size: int, rho: float, initial: ArrayLike, times: ArrayLike) -> Array:
    """S(t)^-1 C^T of the dynamic equation at any times, exactly and without integration.

    Lechappe et al. 2018, (34).

    Parameters
    ----------
    size, rho
        As in `high_gain`.
    initial
        S(0), symmetric and positive definite: a number (times the identity), a diagonal or N x N.
        The paper uses the identity.
    times
        [s], shape (m,), none below zero, in any order.

    Returns
    -------
    Array
        Shape (m, N), one row for each time.

    Raises
    ------
    InputError
        If ``initial`` is of another shape, not symmetric or not positive definite, a time is
        negative or not finite, or as `high_gain`.
    """
    size, rho = as_whole("size", size, 1, _LARGEST), as_positive("rho", rho)
    if size >= _LARGEST_OVER_TIME:
        problem = f"{size} must be below {_LARGEST_OVER_TIME}, its factorial is needed"
        raise InputError("size", problem)
    first = as_positive_definite("initial", initial, size)
    instants = as_floats("times", times)
    if instants.ndim != 1:
        raise InputError("times", f"has shape {instants.shape}, must be a list of times")
    if instants.size and instants.min() < 0:
        raise InputError("times", f"{instants.min():g} s must not be before the start at 0 s")
    # In units of 1/rho for time and rho^-(i+1) for component i the equation is that of rho = 1,
    # which avoids a loss of precision for a large rho.
    scale = _powers(size, rho, 1.0)
    index = np.arange(size)
    with np.errstate(over="ignore", invalid="ignore"):
        elapsed = rho * instants
        start = first * (scale[:, None] * (scale / rho))
        lag = index[None, :] - index[:, None]  # e^(-A t) has (-t)^lag / lag! above its diagonal
        size_of = np.array([factorial(k) for k in range(size)], dtype=np.float64)
        power = np.where(lag >= 0, (-elapsed[:, None, None]) ** np.maximum(lag, 0), 0.0)
        turn = power / size_of[np.maximum(lag, 0)]
        decayed = np.exp(-elapsed)[:, None, None] * (turn.transpose(0, 2, 1) @ start @ turn)
        gathered = _at_one(size) * gammainc(index[:, None] + index + 1, elapsed[:, None, None])
        total = _in_range(decayed + gathered, rho)
    unit = np.zeros((size, 1))
    unit[0] = 1.0
    try:
        gain = np.linalg.solve(total, unit)[..., 0] * scale
    except np.linalg.LinAlgError:
        raise _out_of_range(rho) from None
    return _in_range(gain, rho)


_LARGEST = 500  # the binomials of S stay below 1e300
_LARGEST_OVER_TIME = 171  # factorials below it are floating-point numbers


def _at_one(size: int) -> Array:
    """S for rho = 1: binomials with alternating signs."""
    rows = [[(-1) ** (i + j) * comb(i + j, i) for j in range(size)] for i in range(size)]
    return np.array(rows, dtype=np.float64)


def _powers(size: int, rho: float, sign: float) -> Array:
    """rho^(sign i) for i = 1 to N."""
    with np.errstate(over="ignore"):
        return np.float64(rho) ** (sign * np.arange(1, size + 1))


def _in_range(values: Array, rho: float) -> Array:
    if not np.all(np.isfinite(values)):
        raise _out_of_range(rho)
    return values


def _out_of_range(rho: float) -> InputError:
    return InputError("rho", f"{rho:g} 1/s must keep S and the gains inside the float range")
