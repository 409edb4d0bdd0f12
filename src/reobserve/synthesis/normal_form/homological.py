"""The linear equation of each degree, P'(x) F x - A P(x) = R(x), without its matrix.

The paper (Remark 4.18) makes A diagonal; its operator in (20), (21) has A on both sides, but once
the unknown gain is eliminated what remains is F on the domain and A on the range. Here both are
brought to Schur form instead, F = Q U Q* and A = W V W*: unitary changes of variables lose no
accuracy and exist also where eigenvalues repeat and eigenvectors do not suffice. With x = Q w,
P = W p, R = W r the equation is triangular: monomial by monomial from w1^d to wn^d and component
by component from the last, each unknown is a division by m.alpha - lambda, and the eigenvalues of
the operator are seen to be those of Lemma 4.17 with alpha of F and lambda of A.

The substitution x = Q w is done as a sequence of rotations of two variables, each of which mixes
only monomials that agree in the others, so no matrix of the size of a homogeneous part is formed.
"""

from __future__ import annotations

from math import hypot
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reobserve.core.kernel import allocating_kernel, kernel
from reobserve.polynomials.monomials import Monomials

Complex = NDArray[np.complex128]
Array = NDArray[np.float64]


class SchurForms(NamedTuple):
    """U and V, upper triangular, and the unitary W and Q, the latter as rotations of two variables.

    ``pairs``, of shape (2 k, 2), names the variables that each of the ``rotations``, of shape
    (2 k, 2, 2), mixes: those of Q, and from the middle on their inverses in reversed order.
    """

    U: Complex
    V: Complex
    W: Complex
    pairs: NDArray[np.int64]
    rotations: Complex


class SchurSolver:
    """Solves the equation of any degree for one pair of F and A.

    Thomas, Kwatny & Chang, Remark 4.18.

    ``alpha`` and ``lambdas`` are the eigenvalues of F and A in the order of their Schur forms;
    ``imaginary`` is the largest imaginary part that was left of a real solution so far, relative
    to its size: what the complex arithmetic has cost.
    """

    def __init__(self, F: Array, A: Array) -> None:
        U, Q = _schur(F)
        V, W = _schur(A)
        pairs, rotations, phases = _rotations(Q)
        # Q = G1 ... Gk D: the phases D go into U, what is left is a product of rotations.
        U = phases[:, None] * U * phases.conj()
        self._forms = SchurForms(U, V, W, pairs, rotations)
        self.alpha: Complex = np.diag(U).copy()
        self.lambdas: Complex = np.diag(V).copy()
        self.imaginary = 0.0

    def __call__(self, basis: Monomials, right: Array, degree: int) -> Array:
        """The P for a homogeneous R of ``degree``, both of shape (n, monomials of that degree)."""
        solution, size, imaginary = _solve(basis, right, degree, self._forms)
        if size > 0:
            self.imaginary = max(self.imaginary, imaginary / size)
        return solution


def _schur(matrix: Array) -> tuple[Complex, Complex]:
    """The triangular and the unitary factor, by LAPACK itself, as faster for small matrices."""
    from scipy.linalg.lapack import zgees

    triangular, _, _, unitary, _, info = zgees(lambda _: None, matrix)
    if info != 0:
        raise np.linalg.LinAlgError("the Schur form of the linear part was not found")
    return triangular, unitary


def _rotations(Q: Complex) -> tuple[NDArray[np.int64], Complex, Complex]:
    """Rotations and their inverses, as in `SchurForms`, and phases D: Q = G1 ... Gk diag(D)."""
    rest = Q.tolist()
    n = len(rest)
    pairs, there, back = [], [], []
    for j in range(n - 1):
        for i in range(n - 1, j, -1):
            a, b = rest[j][j], rest[i][j]
            if b == 0:
                continue
            length = hypot(abs(a), abs(b))
            c, s = a / length, b / length
            c_, s_ = c.conjugate(), s.conjugate()
            upper, lower = rest[j], rest[i]
            rest[j] = [c_ * x + s_ * y for x, y in zip(upper, lower, strict=True)]
            rest[i] = [c * y - s * x for x, y in zip(upper, lower, strict=True)]
            pairs.append((j, i))
            there.append(((c, -s_), (s, c_)))
            back.append(((c_, s_), (-s, c)))
    return (
        np.array(pairs + pairs[::-1], dtype=np.int64).reshape(-1, 2),
        np.array(there + back[::-1], dtype=np.complex128).reshape(-1, 2, 2),
        np.array([rest[k][k] for k in range(n)]),
    )


@allocating_kernel
def _solve(
    basis: Monomials, right: Array, degree: int, forms: SchurForms
) -> tuple[Array, float, float]:
    """P for R, and the largest real and imaginary parts that were found."""
    n, width = right.shape
    W, pairs, rotations = forms.W, forms.pairs, forms.rotations
    p = np.zeros((n, width), dtype=np.complex128)
    for c in range(n):
        for k in range(n):
            for m in range(width):
                p[c, m] += W[k, c].conjugate() * right[k, m]
    # There by the rotations, and after the solution in their middle back by their inverses.
    half = len(rotations) // 2
    for g in range(len(rotations) + 1):
        if g == half:
            _solve_triangular(basis, p, degree, forms.U, forms.V)
        if g < len(rotations):
            _substitute(basis, p, degree, pairs[g], rotations[g])
    solution = np.empty((n, width))
    size = imaginary = 0.0
    for c in range(n):
        for m in range(width):
            total = 0j
            for k in range(n):
                total += W[c, k] * p[k, m]
            solution[c, m] = total.real
            size = max(size, abs(total.real))
            imaginary = max(imaginary, abs(total.imag))
    return solution, size, imaginary


@allocating_kernel
def _substitute(
    basis: Monomials, p: Complex, degree: int, pair: NDArray[np.int64], G: Complex
) -> None:
    """Replace p(x) by p(G w) in place, p of shape (c, monomials of the degree)."""
    start = basis.first[degree]
    i, j = pair
    # forms[k, t]: the coefficients of (G00 u + G01 v)^(k - t) (G10 u + G11 v)^t.
    forms = np.zeros((degree + 1, degree + 1, degree + 1), dtype=np.complex128)
    forms[0, 0, 0] = 1
    for k in range(1, degree + 1):
        for t in range(k + 1):
            row, shorter = t // k, min(t, k - 1)
            for s in range(k):
                forms[k, t, s] += forms[k - 1, shorter, s] * G[row, 0]
                forms[k, t, s + 1] += forms[k - 1, shorter, s] * G[row, 1]
    group = np.empty(degree + 1, dtype=np.int64)
    before = np.empty(degree + 1, dtype=np.complex128)
    for m in range(start, basis.first[degree + 1]):
        k = basis.exponents[m, i]
        if k == 0 or basis.exponents[m, j] != 0:
            continue
        # The monomials that share the other powers: x_i^k, x_i^(k-1) x_j, ..., x_j^k.
        group[0] = m
        for t in range(1, k + 1):
            group[t] = basis.raised[basis.lowered[group[t - 1], i], j]
        for c in range(len(p)):
            for t in range(k + 1):
                before[t] = p[c, group[t] - start]
            for s in range(k + 1):
                total = 0j
                for t in range(k + 1):
                    total += before[t] * forms[k, t, s]
                p[c, group[s] - start] = total


@kernel
def _solve_triangular(basis: Monomials, p: Complex, degree: int, U: Complex, V: Complex) -> None:
    """Solve p'(w) U w - V p(w) = r(w), U and V upper triangular, in place of r."""
    n = len(U)
    start = basis.first[degree]
    for q in range(start, basis.first[degree + 1]):
        diagonal = 0j
        for i in range(n):
            diagonal += basis.exponents[q, i] * U[i, i]
        for c in range(n - 1, -1, -1):
            total = p[c, q - start]
            for j in range(1, n):
                if basis.exponents[q, j] > 0:
                    # d/dw_i of the monomial m = q w_i / w_j, times U_ij w_j, falls on q.
                    without = basis.lowered[q, j]
                    for i in range(j):
                        if U[i, j] != 0:
                            m = basis.raised[without, i]
                            total -= (basis.exponents[q, i] + 1) * U[i, j] * p[c, m - start]
            for k in range(c + 1, n):
                total += V[c, k] * p[k, q - start]
            p[c, q - start] = total / (diagonal - V[c, c])
