"""The H-infinity norm of a linear system, between two bounds that are proved.

Boyd, Balakrishnan & Kabamba (1989): G(s) = C (s I - A)^-1 B with a stable A has a norm below one
if and only if the Hamiltonian matrix

    H = [ A         B B^T ]
        [ -C^T C    -A^T  ]

has no eigenvalue on the imaginary axis; an eigenvalue j w there says that one is a singular value
of G(j w). For any other bound gamma, G / gamma stands for G. Bruinsma & Steinbuch (1990) raise a
lower bound to the largest gain midway between such frequencies, until a gamma just above it has
none; the bound converges quadratically.

Whether an eigenvalue is on the axis is no matter of a threshold here. All numbers are balls, which
enclose rounding, and so are the eigenvalues: gamma is an upper bound if no ball touches the axis. A
lower bound is the lower end of the ball of a gain. If the balls are too wide to make progress, all
is done again with more digits, which is also what bad scaling costs: nothing needs balancing.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import isfinite, nextafter
from sys import float_info
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.errors import InputError
from reobserve.core.extras import package
from reobserve.core.matrices import Matrix, as_matrix, as_positive, as_rows
from reobserve.synthesis.definiteness import ball_matrix

if TYPE_CHECKING:
    from flint import acb, acb_mat, arb, arb_mat

_PRECISIONS = (128, 256, 512, 1024)  # bits of the eigenvalues; all else has twice as many
_FINEST = 1e-14  # tolerance, well above what rounding a bound to a float costs
_NOTHING = 2.0**-200  # of |C| |E^-1 B|, the largest entries: the bound of a G of zero


@dataclass(frozen=True)
class Norm:
    """Bounds ``lower`` <= norm <= ``upper``, with the gain ``lower`` at ``frequency`` [rad/s]."""

    lower: float
    upper: float
    frequency: float


class _System(NamedTuple):
    A: arb_mat
    B: arb_mat
    C: arb_mat


def h_infinity_norm(
    A: ArrayLike,
    B: ArrayLike,
    C: ArrayLike,
    E: ArrayLike | None = None,
    tolerance: float = 1e-12,
) -> Norm:
    """The largest singular value of C (j w E - A)^-1 B over all frequencies w.

    Parameters
    ----------
    A
        Shape (n, n); this and all other matrices are taken as exact.
    B
        Input, shape (n, inputs).
    C
        Output, shape (outputs, n).
    E
        A number (times the identity), a diagonal or shape (n, n); the identity if left out.
    tolerance
        The most by which the upper bound may exceed the lower one, as a part of it. If no gain is
        above zero, the upper bound is at most 1e-60 times what the entries of B and C suggest.

    Raises
    ------
    InputError
        If a shape does not fit, E has no inverse, an eigenvalue of s E - A is not left of the
        imaginary axis or so close that 1024 bits cannot tell, or the tolerance is too fine.
    """
    model, descriptor = _checked(A, B, C, E)
    tolerance = as_positive("tolerance", tolerance)
    if tolerance < _FINEST:
        raise InputError("tolerance", f"{tolerance:g} must be {_FINEST:g} or more")
    ctx = package("flint", "bound the H-infinity norm").ctx
    no_path = not (model[1].any() and model[2].any())
    problem = InputError("E", "must have an inverse")
    for bits in _PRECISIONS:
        with ctx.workprec(2 * bits):
            system = _without_descriptor(model, descriptor)
            if not all(entry.is_finite() for entry in system.A.entries()):
                continue
            poles = _eigenvalues(system.A, bits)
            if not all(pole.real < 0 for pole in poles):
                worst = max((complex(pole) for pole in poles), key=lambda pole: pole.real)
                undecided = any(pole.real.contains(0) for pole in poles)
                side = "is not proved to be" if undecided else "must be"
                problem = InputError(
                    "A", f"eigenvalue {worst:.6g} of s E - A {side} left of the imaginary axis"
                )
                if undecided:
                    continue
                break
            if no_path:
                return Norm(0.0, 0.0, 0.0)
            # The share differs: no precision can tell a gamma that happens to be the norm.
            norm = _search(system, poles, tolerance * (1.0 - 64.0 / bits), bits)
            if norm is not None:
                return norm
            problem = InputError("tolerance", f"{tolerance:g} is not reached with {bits} bits")
    raise problem


def _checked(
    A: ArrayLike, B: ArrayLike, C: ArrayLike, E: ArrayLike | None
) -> tuple[list[Matrix], Matrix]:
    """(A, B, C) and E, of shapes that fit."""
    model = [as_rows("A", A), as_rows("B", B), as_rows("C", C)]
    states, inputs, outputs = len(model[0]), model[1].shape[1], len(model[2])
    shapes = [(states, states), (states, inputs), (outputs, states)]
    for name, matrix, shape in zip("ABC", model, shapes, strict=True):
        if matrix.shape != shape or matrix.size == 0:
            raise InputError(name, f"has shape {matrix.shape}, must be {shape} and not empty")
    return model, as_matrix("E", 1.0 if E is None else E, states)


def _without_descriptor(model: list[Matrix], descriptor: Matrix) -> _System:
    """The balls of E^-1 A, E^-1 B and C, not finite if E is not proved to have an inverse."""
    A, B, C = (ball_matrix(matrix) for matrix in model)
    E = ball_matrix(descriptor)
    return _System(E.solve(A, nonstop=True), E.solve(B, nonstop=True), C)


def _search(system: _System, poles: list[acb], tolerance: float, bits: int) -> Norm | None:
    """Bruinsma and Steinbuch's two steps in turn, or none if the balls are too wide for it."""
    from flint import arb

    B, C = (float(np.abs(_middle(matrix)).max()) for matrix in system[1:])
    nothing = max(_NOTHING * (C * B), float_info.min)
    frequencies = [arb(0), *(pole.mid().abs_upper() for pole in poles)]
    gamma = -1.0
    while frequencies:
        gains = [_gain(system, frequency) for frequency in frequencies]
        lower = max(gains)
        if lower <= gamma:
            return None
        best = frequencies[gains.index(lower)]
        gamma = lower * (1.0 + tolerance) or nothing
        if not isfinite(gamma):
            raise InputError("C", "must keep the norm inside the float range")
        root = arb(gamma).sqrt()
        crossings = _crossings(_System(system.A, system.B / root, system.C / root), bits)
        if not crossings:
            return Norm(lower, gamma, float(best))
        frequencies = [((low + high) / 2).mid() for low, high in pairwise(crossings)]
    return None


def _gain(system: _System, frequency: arb) -> float:
    """A proved lower bound of ||G(j w)||, or zero if the balls are too wide."""
    from flint import acb, acb_mat

    A, B, C = (acb_mat(matrix) for matrix in system)
    G = C * (acb(0, frequency) - A).solve(B, nonstop=True)
    middle = _middle(G)
    if not np.isfinite(middle).all():
        return 0.0
    # |u* G v| is at most the norm for any unit vectors, and within the square of an error of it.
    left, _, right = np.linalg.svd(middle, full_matrices=False)
    u, v = acb_mat(left[:, :1].conj().T.tolist()), acb_mat(right[:1].conj().T.tolist())
    lengths = (u * u.conjugate().transpose()) * (v.conjugate().transpose() * v)
    bound = abs((u * G * v)[0, 0]) / abs(lengths[0, 0]).sqrt()
    return max(0.0, nextafter(float(bound.lower()), 0.0))


def _crossings(system: _System, bits: int) -> list[arb]:
    """Frequencies w >= 0, all and rising, at which one may be a singular value of G(j w)."""
    from flint import arb_mat

    A, B, C = system
    right, lower = B * B.transpose(), -C.transpose() * C
    rows = [
        *([*a, *b] for a, b in zip(A.tolist(), right.tolist(), strict=True)),
        *([*a, *b] for a, b in zip(lower.tolist(), (-A.transpose()).tolist(), strict=True)),
    ]
    eigenvalues = _eigenvalues(arb_mat(rows), bits)
    return sorted((abs(e.imag.mid()) for e in eigenvalues if e.real.contains(0)), key=float)


def _eigenvalues(matrix: arb_mat, bits: int) -> list[acb]:
    """Squares in the complex plane that enclose all eigenvalues, by Gershgorin's theorem.

    The matrix is seen in the basis of its approximate eigenvectors. Those of a nearby matrix do as
    well, and keep apart what may coincide in a Jordan block.
    """
    from flint import acb, acb_mat, arb, arb_mat, ctx

    size = matrix.nrows()
    with ctx.workprec(bits):
        nudge = max(abs(entry).upper() for entry in matrix.entries()) * arb(2) ** -bits
        nearby = (matrix + arb_mat.dct(size, size) * nudge).mid()
        basis = acb_mat(nearby).eig(right=True, algorithm="approx")[1]
    turned = basis.solve(acb_mat(matrix) * basis, nonstop=True).tolist()
    squares = []
    for i, row in enumerate(turned):
        radius = sum((entry.abs_upper() for j, entry in enumerate(row) if j != i), arb(0))
        squares.append(row[i] + acb(arb(0, radius), arb(0, radius)))
    return squares


def _middle(matrix: arb_mat | acb_mat) -> NDArray[np.complex128]:
    """The midpoints as complex floats."""
    return np.array([[complex(entry.mid()) for entry in row] for row in matrix.tolist()])
