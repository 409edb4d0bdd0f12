"""Gains of linear observers: placed poles, and the steady gain of the Kalman filter.

Both ask what the measurements show. By Popov, Belevitch and Hautus the mode of an eigenvalue s of A
is unobservable if [A - s I; C] has no full column rank; no gain moves it.
"""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_kind, as_poles
from reobserve.core.errors import InputError, shown
from reobserve.core.matrices import as_floats
from reobserve.systems.linear import LinearModel

Array = NDArray[np.float64]

_RANK = 1e-10  # of the size of A and C: the singular value of [A - s I; C] that counts as zero
_CIRCLE = 1e-9  # how near to the unit circle an eigenvalue counts as on it


@np.errstate(over="ignore", invalid="ignore")  # what is not finite is refused
def place(A: ArrayLike, C: ArrayLike, poles: ArrayLike) -> Array:
    """The gain L, shape (n, m), with which A - L C has these eigenvalues.

    With several outputs it is the one of scipy's ``place_poles``, whose eigenvalues are the least
    sensitive that it finds. With one output there is only one.

    Parameters
    ----------
    A
        Shape (n, n), of continuous or discrete time.
    C
        Shape (m, n).
    poles
        n eigenvalues, complex ones in conjugate pairs; each as often as C has independent rows, or,
        with one output, as often as you like.

    Raises
    ------
    InputError
        If shapes do not fit, the poles are not so, or a mode of A is unobservable: it is named.

    Examples
    --------
    >>> from reobserve.synthesis.linear import place
    >>> print(place([[1, 0.1], [0, 1]], [[1, 0]], poles=[0.5, 0.6]).round(3))
    [[0.9]
     [2. ]]
    """
    A, C = _pair(A, C)
    chosen, n = as_poles("poles", poles), len(A)
    if chosen.shape != (n,) or not np.isfinite(chosen).all() or np.any(np.poly(chosen).imag):
        problem = f"{shown(chosen.tolist())} must be {n} finite numbers, complex ones in pairs"
        raise InputError("poles", problem)
    unobservable = unobservable_modes(A, C)
    if len(unobservable):
        eigenvalue = _format(unobservable[0])
        said = f"do not show the mode of the eigenvalue {eigenvalue}, which no gain moves"
        raise InputError("A, C", said)
    often = max(int(np.sum(chosen == pole)) for pole in chosen)
    rank = int(np.linalg.matrix_rank(C))
    if len(C) == 1 and often > 1:
        return ackermann(A.T, C.T, chosen).reshape(-1, 1)
    if often > rank:
        said = f"have one {often} times, at most {rank} times is possible with rank {rank} of C"
        raise InputError("poles", said)
    return _placed(A, C, chosen)


def _placed(A: Array, C: Array, poles: NDArray[np.complex128]) -> Array:
    from scipy.signal import place_poles

    # As far as it goes: short of that the eigenvalues are off by some 1e-9, as the sensitivity is.
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Convergence was not reached")
        try:
            found = place_poles(A.T, C.T, poles, rtol=1e-12, maxiter=300)
        except (ValueError, np.linalg.LinAlgError):
            said = f"{shown(poles.tolist())} are too far from the eigenvalues of A to be placed"
            raise InputError("poles", said) from None
    gain: Array = np.ascontiguousarray(found.gain_matrix.T)
    return gain


def ackermann(A: Array, B: Array, poles: NDArray[np.complex128]) -> Array:
    """The gain K, shape (1, n), with which A - B K of one input has these eigenvalues.

    By Ackermann's formula: the last row of the inverse controllability matrix times the polynomial
    of the poles in A. For few states; no check is made.
    """
    n = len(A)
    reached = np.hstack([np.linalg.matrix_power(A, k) @ B for k in range(n)])
    polynomial = np.zeros((n, n))
    for coefficient in np.poly(poles).real:
        polynomial = polynomial @ A + coefficient * np.eye(n)
    return np.asarray(np.linalg.solve(reached, polynomial)[-1:], dtype=np.float64)


def steady_kalman_gain(model: LinearModel) -> Array:
    """Kalman's gain at rest, shape (n, m): P C' (C P C' + R)^-1 with P of the Riccati equation.

    It is the limit of the filter's gain from any positive definite covariance.

    Parameters
    ----------
    model
        The linear model of the plant.

    Raises
    ------
    InputError
        If there is none: a mode that does not decay is unobservable, or one on the unit circle is
        not driven by the noise of covariance Q. The mode is named.

    Examples
    --------
    >>> from reobserve import LinearModel
    >>> from reobserve.synthesis.linear import steady_kalman_gain
    >>> model = LinearModel([[1, 0.1], [0, 1]], C=[[1, 0]], Q=1e-4, R=1e-2)
    >>> print(steady_kalman_gain(model).round(3))
    [[0.159]
     [0.092]]
    """
    from scipy.linalg import solve_discrete_are

    A, _, C, _, Q, R = as_kind("model", model, LinearModel).arrays
    unobservable = undetectable_modes(A, C)
    if len(unobservable):
        said = f"has an unobservable mode of the eigenvalue {_format(unobservable[0])}"
        raise InputError("model", f"{said} that does not decay: there is no steady gain")
    still = unobservable_modes(A.T, Q)
    still = still[np.abs(np.abs(still) - 1.0) <= _CIRCLE]
    if len(still):
        said = f"has a mode of the eigenvalue {_format(still[0])} on the unit circle"
        raise InputError("model", f"{said} that Q does not drive: there is no steady gain")
    try:
        P = solve_discrete_are(A.T, C.T, Q, R)
    except (ValueError, np.linalg.LinAlgError):  # ValueError: scipy's, of eigenvalues far apart
        said = "has modes too near to the unit circle, or too weakly observable, for a steady gain"
        raise InputError("model", said) from None
    gain: Array = np.linalg.solve(C @ P @ C.T + R, C @ P).T
    return gain


def undetectable_modes(A: ArrayLike, C: ArrayLike) -> NDArray[np.complex128]:
    """Modes of `unobservable_modes` that do not decay in discrete time: from the unit circle on.

    Raises
    ------
    InputError
        If the shapes do not fit.
    """
    unobservable = unobservable_modes(A, C)
    return unobservable[np.abs(unobservable) >= 1.0 - _CIRCLE]


@np.errstate(over="ignore", invalid="ignore")  # what is not finite is refused
def unobservable_modes(A: ArrayLike, C: ArrayLike) -> NDArray[np.complex128]:
    """The eigenvalues of A whose modes C does not show, shape (k,).

    Raises
    ------
    InputError
        If the shapes do not fit, or numbers are too large to tell.
    """
    A, C = _pair(A, C)
    # Rows of C in units of their own: how large they are has no part in what they show.
    rows = _unit(C / _nonzero(np.abs(C).max(axis=1, keepdims=True)))
    scale = max(float(np.linalg.norm(A, 2)), float(np.finfo(float).tiny))
    rows = scale * rows
    found = []
    for value in np.linalg.eigvals(A):
        pencil = np.vstack([A - value * np.eye(len(A)), rows])
        try:
            smallest = np.linalg.svd(pencil, compute_uv=False)[-1]
        except np.linalg.LinAlgError:
            said = "have entries whose products are beyond floating-point numbers"
            raise InputError("A, C", said) from None
        if smallest <= _RANK * scale:
            found.append(value)
    return np.array(found, dtype=np.complex128)


def _unit(rows: Array) -> Array:
    return rows / _nonzero(np.linalg.norm(rows, axis=1, keepdims=True))


def _nonzero(sizes: Array) -> Array:
    return np.where(sizes > 0, sizes, 1.0)


def _pair(A: ArrayLike, C: ArrayLike) -> tuple[Array, Array]:
    square, rows = as_floats("A", A), as_floats("C", C)
    if square.ndim != 2 or square.shape[0] != square.shape[1] or not square.size:
        raise InputError("A", f"has shape {square.shape}, must be square")
    if rows.ndim != 2 or rows.shape[1] != len(square) or not len(rows):
        problem = f"has shape {rows.shape}, must have {len(square)} columns like A"
        raise InputError("C", problem)
    return square, rows


def _format(value: complex) -> str:
    return f"{value:.4g}" if value.imag else f"{value.real:.4g}"
