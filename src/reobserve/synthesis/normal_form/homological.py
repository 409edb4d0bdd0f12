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

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reobserve.kernel import kernel
from reobserve.power_series.monomials import Monomials

Complex = NDArray[np.complex128]
Array = NDArray[np.float64]


class Rotations(NamedTuple):
    """A unitary matrix as rotations G1 G2 ... Gk of two coordinates each.

    ``first`` and ``second`` name the coordinates, ``entries`` has shape (k, 2, 2).
    """

    first: NDArray[np.int64]
    second: NDArray[np.int64]
    entries: Complex


class SchurSolver:
    """Solves the equation of any degree for one pair of F and A.

    ``alpha`` and ``lambdas`` are the eigenvalues of F and A in the order of their Schur forms;
    ``imaginary`` is the largest imaginary part that was left of a real solution so far, relative
    to its size: what the complex arithmetic has cost.
    """

    def __init__(self, F: Array, A: Array) -> None:
        from scipy.linalg import schur

        U, Q = schur(F.astype(np.complex128), output="complex", check_finite=False)
        self._V, self._W = schur(A.astype(np.complex128), output="complex", check_finite=False)
        self._there, phases = _rotations(Q)
        # Q = G1 ... Gk D: the phases D go into U, what is left is a product of rotations.
        self._U = phases[:, None] * U * phases.conj()
        self._back = Rotations(
            self._there.first[::-1].copy(),
            self._there.second[::-1].copy(),
            np.ascontiguousarray(self._there.entries[::-1].conj().transpose(0, 2, 1)),
        )
        self.alpha: Complex = np.diag(self._U).copy()
        self.lambdas: Complex = np.diag(self._V).copy()
        self.imaginary = 0.0

    def __call__(self, basis: Monomials, right: Array, degree: int) -> Array:
        """P for a homogeneous R of ``degree``; both of shape (n, monomials of that degree)."""
        p = self._W.conj().T @ right
        _substitute(basis, p, degree, self._there)
        _solve(basis, p, degree, self._U, self._V)
        _substitute(basis, p, degree, self._back)
        p = self._W @ p
        size = float(np.max(np.abs(p)))
        if size > 0:
            self.imaginary = max(self.imaginary, float(np.max(np.abs(p.imag))) / size)
        return np.ascontiguousarray(p.real)


def _rotations(Q: Complex) -> tuple[Rotations, Complex]:
    """Rotations G and phases D with Q = G1 ... Gk diag(D), Q unitary."""
    n = len(Q)
    rest = Q.copy()
    first, second, entries = [], [], []
    for j in range(n - 1):
        for i in range(n - 1, j, -1):
            a, b = rest[j, j], rest[i, j]
            length = np.hypot(abs(a), abs(b))
            if b == 0 or length == 0:
                continue
            G = np.array([[a, -b.conjugate()], [b, a.conjugate()]]) / length
            rest[[j, i]] = G.conj().T @ rest[[j, i]]
            first.append(j)
            second.append(i)
            entries.append(G)
    shaped = np.array(entries, dtype=np.complex128).reshape(-1, 2, 2)
    places = (np.array(first, dtype=np.int64), np.array(second, dtype=np.int64))
    return Rotations(*places, shaped), np.diag(rest).copy()


@kernel
def _substitute(basis: Monomials, p: Complex, degree: int, rotations: Rotations) -> None:
    """Replace p(x) by p(G1 G2 ... w) in place; p has shape (c, monomials of the degree)."""
    start = basis.first[degree]
    forms = np.zeros((degree + 1, degree + 1, degree + 1), dtype=np.complex128)
    group = np.empty(degree + 1, dtype=np.int64)
    before = np.empty(degree + 1, dtype=np.complex128)
    for g in range(len(rotations.first)):
        i, j = rotations.first[g], rotations.second[g]
        G = rotations.entries[g]
        # forms[k, t]: the coefficients of (G00 u + G01 v)^(k - t) (G10 u + G11 v)^t.
        forms[:] = 0
        forms[0, 0, 0] = 1
        for k in range(1, degree + 1):
            for t in range(k + 1):
                shorter, row = (forms[k - 1, t], G[0]) if t < k else (forms[k - 1, t - 1], G[1])
                for s in range(k):
                    forms[k, t, s] += shorter[s] * row[0]
                    forms[k, t, s + 1] += shorter[s] * row[1]
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
def _solve(basis: Monomials, p: Complex, degree: int, U: Complex, V: Complex) -> None:
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
