"""Gains for given poles: the only one of one output, the least sensitive of several.

Matrices are those of `reobserve.core.balancing`, so that the search does not depend on units.
"""

from __future__ import annotations

import warnings
from fractions import Fraction
from operator import mul

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError, shown
from reobserve.core.matrices import spectral_radius

Array = NDArray[np.float64]

_PLACED = 1e-6  # of a coefficient of the polynomial of the poles: how far it may be off
_ROUNDING = 1e-12  # the same of the polynomial of the largest pole or eigenvalue
_HALF = 2.0**32
_CORRECTED = 2  # steps; from half of the digits one would do


def least_sensitive(A: Array, C: Array, poles: NDArray[np.complex128]) -> Array:
    """The gain for different poles, shape (n, m), the same where last digits of A and C differ."""
    # The search amplifies last digits, in which scaled matrices of other units differ.
    gain = searched(_rounded(A), _rounded(C), poles)
    for _ in range(_CORRECTED):
        gain = gain + _correction(A, C, gain, poles)
    return checked(A, C, gain, poles)


def checked(A: Array, C: Array, gain: Array, poles: NDArray[np.complex128]) -> Array:
    """The gain, if it places the poles."""
    # Compared by the polynomial: the order of near poles is not defined.
    if np.isfinite(gain).all():
        largest = max(spectral_radius(A), float(np.abs(poles).max()))
        allowed = _PLACED * np.poly(-np.abs(poles)) + _ROUNDING * np.poly([-largest] * len(A))
        reached = np.poly(np.linalg.eigvals(A - gain @ C))
        if np.all(np.abs(reached - np.poly(poles)) <= allowed):
            return gain
    said = f"{shown(poles.tolist())} are too far from the eigenvalues of A to be placed"
    raise InputError("poles", said)


def _rounded(matrix: Array) -> Array:
    """The array with half of the digits."""
    fractions, exponents = np.frexp(matrix)
    rounded: Array = np.ldexp(np.rint(fractions * _HALF) / _HALF, exponents)
    return rounded


def _correction(A: Array, C: Array, gain: Array, poles: NDArray[np.complex128]) -> Array:
    """The smallest change of a gain that moves eigenvalues to the poles near them.

    Eigenvalue s with left and right eigenvectors y and x, y x = 1, moves by -y dL C x.
    """
    from scipy.optimize import linear_sum_assignment

    values, right = np.linalg.eig(A - gain @ C)
    order = linear_sum_assignment(np.abs(values[:, None] - poles))[1]
    left = np.linalg.inv(right)
    slopes = np.einsum("ia,bi->iab", left, C @ right).reshape(len(A), -1)
    off = values - poles[order]
    both = np.vstack([slopes.real, slopes.imag]), np.concatenate([off.real, off.imag])
    change: Array = np.linalg.lstsq(*both, rcond=1e-12)[0].reshape(gain.shape)
    return change


def searched(A: Array, C: Array, poles: NDArray[np.complex128]) -> Array:
    """The gain that scipy finds, shape (n, m)."""
    from scipy.signal import place_poles

    # As far as it goes: short of that the eigenvalues are off by some 1e-9, as the sensitivity is.
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Convergence was not reached")
        try:
            result = place_poles(A.T, C.T, poles, rtol=1e-12, maxiter=300)
        except (ValueError, np.linalg.LinAlgError):
            said = f"{shown(poles.tolist())} are too far from the eigenvalues of A to be placed"
            raise InputError("poles", said) from None
    gain: Array = np.ascontiguousarray(result.gain_matrix.T)
    return gain


def only_gain(A: Array, C: Array, poles: NDArray[np.complex128]) -> Array:
    """The only gain of one output, shape (n, 1), in exact fractions and then rounded."""
    a = [[Fraction(entry) for entry in row] for row in A.tolist()]
    rows = [[Fraction(entry) for entry in C[0].tolist()]]
    for _ in range(len(A) - 1):
        rows.append([sum(map(mul, rows[-1], column)) for column in zip(*a, strict=True)])
    # Ackermann: L = p(A) x with [C; C A; ...] x = [0; ...; 0; 1] and the polynomial p of the poles
    x = _solved(rows, [Fraction(0)] * (len(A) - 1) + [Fraction(1)])
    for pole in poles[poles.imag >= 0].tolist():
        size = Fraction(pole.real)
        moved = [sum(map(mul, row, x)) for row in a]
        shifted = [entry - size * other for entry, other in zip(moved, x, strict=True)]
        if pole.imag:  # (A - re)^2 + im^2
            moved = [sum(map(mul, row, shifted)) for row in a]
            square = Fraction(pole.imag) ** 2
            shifted = [
                first - size * second + square * third
                for first, second, third in zip(moved, shifted, x, strict=True)
            ]
        x = shifted
    try:
        return np.array([[float(entry)] for entry in x])
    except OverflowError:
        return np.full((len(x), 1), np.inf)


def _solved(rows: list[list[Fraction]], right: list[Fraction]) -> list[Fraction]:
    """x of a regular system in fractions, by elimination."""
    whole = [[*row, entry] for row, entry in zip(rows, right, strict=True)]
    for k in range(len(whole)):
        pivot = next(i for i in range(k, len(whole)) if whole[i][k])
        whole[k], whole[pivot] = whole[pivot], whole[k]
        whole[k] = [entry / whole[k][k] for entry in whole[k]]
        for i, row in enumerate(whole):
            if i != k and row[k]:
                whole[i] = [a - row[k] * b for a, b in zip(row, whole[k], strict=True)]
    return [row[-1] for row in whole]
