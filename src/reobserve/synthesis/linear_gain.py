"""Gains of linear observers: placed poles, and the steady gain of the Kalman filter.

Both ask what the measurements show. By Popov, Belevitch and Hautus the mode of an eigenvalue s of A
is unobservable if [A - s I; C] has no full column rank; no gain moves it. Matrices are scaled by
`reobserve.core.balancing` before anything is decided, so that units have no part in it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_kind, as_poles
from reobserve.core.balancing import Scales, logarithm, output_scales, powers
from reobserve.core.covariances import as_covariance
from reobserve.core.errors import InputError, shown
from reobserve.core.finite import finite
from reobserve.core.matrices import as_floats, as_sized, spectral_radius
from reobserve.synthesis.placed_gains import (
    checked,
    least_sensitive,
    only_gain,
    searched,
)
from reobserve.systems.linear import LinearModel

Array = NDArray[np.float64]

_RANK = 1e-10  # of the size of A and C: the singular value of [A - s I; C] that counts as zero
_CIRCLE = 1e-9  # how near to the unit circle an eigenvalue counts as on it
_MODERATE = 10.0  # powers of two between scales that are left as they are
_EXACT = 20  # states up to which fractions are used, in at most three seconds
_NEWTON = 20  # steps, at most; some two are usual
_CLOSE = 1e-8  # of the gain: what the last step may move
_DOUBLINGS = 80  # more than a mode needs that floats can tell from the unit circle


@finite("A, C, poles")
def place(A: ArrayLike, C: ArrayLike, poles: ArrayLike) -> Array:
    """The gain L, shape (n, m), with which A - L C has these eigenvalues.

    With several outputs it is the one of scipy's ``place_poles``, whose eigenvalues are the least
    sensitive that it finds, in scales that do not depend on units. With one output there is only
    one.

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
    >>> from reobserve.synthesis.linear_gain import place
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
    # The poles, too, say how fast states are: a chain of integrators has no cycle.
    with np.errstate(divide="ignore"):
        rate = float(np.log2(np.abs(chosen).max()))
    scales = output_scales(A, C, rate=rate)
    a, c = scales.transition(A), scales.output(C)
    rank = int(np.linalg.matrix_rank(c))
    if len(C) == 1 and n <= _EXACT:
        return scales.gain(checked(a, c, only_gain(a, c, chosen), chosen))
    if len(C) == 1 and often > 1:
        return scales.gain(ackermann(a.T, c.T, chosen).reshape(-1, 1))
    if often > rank:
        said = f"have one {often} times, at most {rank} times is possible with rank {rank} of C"
        raise InputError("poles", said)
    if often > 1:
        return scales.gain(searched(a, c, chosen))
    return scales.gain(least_sensitive(a, c, chosen))


def ackermann(A: Array, B: Array, poles: NDArray[np.complex128]) -> Array:
    """The gain K, shape (1, n), with which A - B K of one input has these eigenvalues.

    By Ackermann's formula: the last row of the inverse controllability matrix times the polynomial
    of the poles in A. For few states; no check is made.
    """
    n = len(A)
    scales = output_scales(A.T, B.T).rounded()
    if np.ptp(scales.states) > _MODERATE and np.isfinite(scales.states).all():
        even = ackermann(scales.transition(A.T).T, scales.output(B.T).T, poles)
        return scales.gain(even.T).T
    reached = np.hstack([np.linalg.matrix_power(A, k) @ B for k in range(n)])
    polynomial = np.zeros((n, n))
    for coefficient in np.poly(poles).real:
        polynomial = polynomial @ A + coefficient * np.eye(n)
    return np.asarray(np.linalg.solve(reached, polynomial)[-1:], dtype=np.float64)


def steady_kalman_gain(model: LinearModel) -> Array:
    """Kalman's gain at rest, shape (n, m): P C' (C P C' + R)^-1 with P of the Riccati equation.

    It is the limit of the filter's gain from any positive definite covariance. scipy's solution is
    improved by Newton's method until the gain moves no more.

    Parameters
    ----------
    model
        The linear model of the plant.

    Raises
    ------
    InputError
        If there is none: a mode that does not decay is unobservable, or one on the unit circle is
        not driven by the noise of covariance Q. The mode is named. Or if it cannot be computed to
        eight digits.

    Examples
    --------
    >>> from reobserve import LinearModel
    >>> from reobserve.synthesis.linear_gain import steady_kalman_gain
    >>> model = LinearModel([[1, 0.1], [0, 1]], C=[[1, 0]], Q=1e-4, R=1e-2)
    >>> print(steady_kalman_gain(model).round(3))
    [[0.159]
     [0.092]]
    """
    from scipy.linalg import solve_discrete_are

    A, _, C, _, Q, _ = as_kind("model", model, LinearModel).arrays
    unobservable = undetectable_modes(A, C)
    if len(unobservable):
        said = f"has an unobservable mode of the eigenvalue {_format(unobservable[0])}"
        raise InputError("model", f"{said} that does not decay: there is no steady gain")
    still = unobservable_modes(A.T, Q)
    still = still[np.abs(np.abs(still) - 1.0) <= _CIRCLE]
    if len(still):
        said = f"has a mode of the eigenvalue {_format(still[0])} on the unit circle"
        raise InputError("model", f"{said} that Q does not drive: there is no steady gain")
    near = InputError(
        "model",
        "has modes too near to the unit circle, or too weakly observable, for a steady gain",
    )
    even = _noise_scaled(model)
    try:
        with np.errstate(invalid="ignore"):  # scipy's, of entries far apart
            P = solve_discrete_are(even.A.T, even.C.T, even.Q, even.R)
        gain, moves = _kalman_gain(even, P), np.inf
        for _ in range(_NEWTON):
            better = _kalman_gain(even, _covariance(even, gain))
            before, moves = moves, np.abs(better - gain).max()
            gain = better
            if moves >= before / 2.0 or moves == 0:
                break
    except (ValueError, np.linalg.LinAlgError):  # ValueError: scipy's, of eigenvalues far apart
        raise near from None
    if not moves <= _CLOSE * np.abs(gain).max():
        raise near
    return even.scales.gain(gain)


@finite("gain")
def kalman_gain_error(model: LinearModel, gain: ArrayLike) -> Array:
    """The change of a steady gain by the Riccati equation, as parts of it, shape (n, m).

    One step of Newton's method: it finds the error of a gain near Kalman's, in any units.

    Raises
    ------
    InputError
        If the gain has another shape, or errors do not decay with it.
    """
    even = _noise_scaled(as_kind("model", model, LinearModel))
    given, wanted = as_floats("gain", gain), (model.states, model.outputs)
    if given.shape != wanted:
        raise InputError("gain", f"has shape {given.shape}, must be {wanted}")
    scaled = powers(given, even.scales.states[:, None] - even.scales.outputs)
    try:
        better = _kalman_gain(even, _covariance(even, scaled))
    except np.linalg.LinAlgError:
        raise InputError("gain", "gives an error that does not decay") from None
    size = np.maximum(np.abs(better), 1e-6 * np.abs(better).max())
    return np.abs(scaled - better) / np.where(size > 0, size, 1.0)


class _Even(NamedTuple):
    """A model in units of its own noise, in which R has a diagonal of about ones."""

    A: Array
    C: Array
    Q: Array
    R: Array
    scales: Scales


def _noise_scaled(model: LinearModel) -> _Even:
    A, _, C, _, Q, R = model.arrays
    as_covariance("R", R, len(R), definite=True)
    scales = output_scales(A, C, -0.5 * logarithm(np.diag(R)), rate=0.0)
    driven, hidden = 0.5 * logarithm(np.diag(Q)), ~np.isfinite(scales.states)
    r = np.array(scales.completed(A, driven).states)
    # All states alike, so that what measurements tell and what noise adds is of one size.
    largest = float(np.max((driven + r)[~hidden], initial=-np.inf))
    r[~hidden] -= 0.5 * largest if np.isfinite(largest) else 0.0
    exact = Scales(r, scales.outputs, scales.rate).rounded()
    rows, outputs = exact.states, exact.outputs
    return _Even(
        exact.transition(A), exact.output(C), powers(Q, rows[:, None] + rows),
        powers(R, outputs[:, None] + outputs), exact,
    )  # fmt: skip


def _kalman_gain(even: _Even, P: Array) -> Array:
    """P C' (C P C' + R)^-1."""
    _, C, _, R, _ = even
    return np.asarray(np.linalg.solve(C @ P @ C.T + R, C @ P).T, dtype=np.float64)


def _covariance(even: _Even, gain: Array) -> Array:
    """P of the predicted error with a constant gain, or LinAlgError if it does not decay.

    P = F P F' + A K R K' A' + Q with F = A (I - K C), as the sum of F^k (...) F'^k by doubling.
    """
    A, C, Q, R, _ = even
    F = A @ (np.eye(len(A)) - gain @ C)
    if not spectral_radius(F) < 1.0:
        raise np.linalg.LinAlgError
    total = A @ gain @ R @ gain.T @ A.T + Q
    for _ in range(_DOUBLINGS):
        added = F @ total @ F.T
        total = total + added
        F = F @ F
        if not np.abs(F).max() > 1e-20:
            break
    return 0.5 * (total + total.T)


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
    """The eigenvalues of A whose modes C does not show, shape (k,)."""
    A, C = _pair(A, C)
    beyond = InputError("A, C", "have entries whose products are beyond floating-point numbers")
    if not np.isfinite(np.linalg.norm(A, 1) + np.linalg.norm(A, np.inf)):
        raise beyond
    scales = output_scales(A, C)
    shown = np.isfinite(scales.states)
    # No output depends on these, whatever their numbers are.
    modes = list(np.linalg.eigvals(A[np.ix_(~shown, ~shown)])) if not shown.all() else []
    if shown.any():
        kept = Scales(scales.states[shown], scales.outputs, scales.rate)
        a, rows = kept.transition(A[np.ix_(shown, shown)]), _unit(kept.output(C[:, shown]))
        size = max(float(np.linalg.norm(a, 2)), float(np.finfo(float).tiny))
        for value in np.linalg.eigvals(a):
            pencil = np.vstack([a - value * np.eye(len(a)), size * rows])
            try:
                smallest = np.linalg.svd(pencil, compute_uv=False)[-1]
            except np.linalg.LinAlgError:
                raise beyond from None
            if smallest <= _RANK * size:
                modes.append(value)
    return np.array(modes, dtype=np.complex128)


def _unit(rows: Array) -> Array:
    sizes = np.linalg.norm(rows, axis=1, keepdims=True)
    return rows / np.where(sizes > 0, sizes, 1.0)


def _pair(A: ArrayLike, C: ArrayLike) -> tuple[Array, Array]:
    square, rows = as_sized("A", A), as_sized("C", C)
    if square.ndim != 2 or square.shape[0] != square.shape[1] or not square.size:
        raise InputError("A", f"has shape {square.shape}, must be square")
    if rows.ndim != 2 or rows.shape[1] != len(square) or not len(rows):
        problem = f"has shape {rows.shape}, must have {len(square)} columns like A"
        raise InputError("C", problem)
    return square, rows


def _format(value: complex) -> str:
    return f"{value:.4g}" if value.imag else f"{value.real:.4g}"
