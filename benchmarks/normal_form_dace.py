"""The methods in DACE, a library of truncated power series in C, driven from Python.

What DACE does not have, the linear equation of each degree, goes to scipy: with the matrix K of
the derivative along F x on the monomials of the degree it is P K - A P = R, of Sylvester's form.
"""

from __future__ import annotations

from importlib import import_module
from math import factorial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_sylvester

from reobserve.polynomials.monomials import Monomials
from reobserve.synthesis.normal_form.problem import NormalFormProblem

Array = NDArray[np.float64]


def installed() -> bool:
    """Whether daceypy can be imported."""
    try:
        import_module("daceypy")
    except (ImportError, OSError):
        return False
    return True


class Dace:
    """S, T, the inverse and the Lie recursion of one problem; a map is an array of n series."""

    def __init__(self, problem: NormalFormProblem) -> None:
        dace = import_module("daceypy")
        self.DA, self.array = dace.DA, dace.array
        self.problem, self.basis = problem, problem.basis
        self.degree, self.n = problem.degree, problem.system.states
        self.powers = self.basis.exponents.tolist()
        self.begin()
        self.f, self.w = self.series(problem.dynamics), self.series(problem.injected)
        self.f_and_w = self.array(np.concatenate([self.f, self.w]))

    def begin(self) -> None:
        """Tell DACE, which knows one degree and number of variables at a time."""
        if (self.DA.getMaxOrder(), self.DA.getMaxVariables()) != (self.degree, self.n):
            self.DA.init(self.degree, self.n)
        self.DA.setTO(self.degree)

    def series(self, coefficients: Array, degree: int | None = None) -> Any:
        """From coefficients, all or those of one degree."""
        part = slice(None) if degree is None else self.basis.part(degree)
        found = [self.DA(0.0) for _ in coefficients]
        for one, row in zip(found, coefficients, strict=True):
            for powers, value in zip(self.powers[part], row.tolist(), strict=True):
                if value != 0:
                    one.setCoefficient(powers, value)
        return self.array(found)

    def coefficients(self, series: Any, degree: int | None = None) -> Array:
        """The coefficients, all or those of one degree."""
        part = slice(None) if degree is None else self.basis.part(degree)
        return np.array([[one.getCoefficient(m) for m in self.powers[part]] for one in series])

    def solved(self, right: Any, degree: int) -> Any:
        """P for the part of ``degree`` of the right-hand side."""
        K = along_linear(self.basis, self.problem.F, degree)
        return self.series(
            solve_sylvester(-self.problem.A, K, self.coefficients(right, degree)), degree
        )

    def along(self, p: Any, v: Any) -> Any:
        """The derivative p'(x) v(x)."""
        return sum(p.deriv(i + 1) * v[i] for i in range(self.n))

    def applied(self, matrix: Array, series: Any) -> Any:
        """A matrix of numbers times a map."""
        return self.array([sum(a * s for a, s in zip(row, series, strict=True)) for row in matrix])

    def s(self) -> Any:
        """S, degree by degree."""
        self.begin()
        S = self.array.identity(self.n)
        for d in range(2, self.degree + 1):
            self.DA.setTO(d)
            S = S + self.solved(self.applied(self.problem.A, S) - self.w - self.along(S, self.f), d)
        return S

    def t(self) -> Any:
        """T, degree by degree."""
        self.begin()
        z = T = self.array.identity(self.n)
        for d in range(2, self.degree + 1):
            self.DA.setTO(d)
            moved = self.f_and_w.eval(T)
            field = self.applied(self.problem.A, z) - moved[self.n :]
            T = T + self.solved(moved[: self.n] - self.along(T, field), d)
        return T

    def inverse(self, S: Any) -> Any:
        """DACE's own inversion."""
        self.begin()
        return S.invert()

    def lie(self) -> tuple[Any, Any]:
        """T and S by the Lie recursion, divided by factorials as the library does."""
        self.begin()
        n, A = self.n, self.problem.A
        x = T = S = self.array.identity(n)
        w1 = self.w.trim(1, 1)
        U = self.array([self.DA(0.0) for _ in range(n)])
        p, f = [U] * self.degree, self.applied(A, x)
        for k in range(1, self.degree):
            self.DA.setTO(k + 1)
            if k > 1:
                S = S - (T - x).eval(S).trim(k, k)
            # T'(S(x)) w up to degree k + 1, T without its part of degree k + 1
            gain_w = sum(T.deriv(i + 1).eval(S) * self.w[i] for i in range(n))
            known = (self.f + gain_w).trim(k + 1, k + 1)
            for m in range(1, k):
                p[m] = p[m] + (k - m) * p[m - 1].trim(k + 1, k + 1)
                p[m] = p[m] + self.along(p[m - 1], p[0]).trim(k + 1, k + 1)
            q = p[k - 1].trim(k + 1, k + 1) / factorial(k - 1) if k > 1 else 0 * U
            bracket = (self.along(f, p[0]) - self.along(p[0], f)).trim(k + 1, k + 1)
            u = self.solved(k * known + bracket + self.along(q, w1), k + 1)
            for m in range(k):
                p[m] = p[m] + (factorial(k - 1) // factorial(k - 1 - m)) * u
            new = (u + q) / k
            T = T + new
            f = f + known + self.along(new, w1)
        return T, S - (T - x).eval(S).trim(self.degree, self.degree)


def along_linear(basis: Monomials, F: Array, degree: int) -> Array:
    """The matrix K with the coefficients P K of P'(x) F x, for P of one degree."""
    part = basis.part(degree)
    K = np.zeros((part.stop - part.start,) * 2)
    rows = np.arange(part.start, part.stop)
    for i, j in np.argwhere(F != 0):
        powers = basis.exponents[part, i]
        m = rows[powers > 0]
        to = basis.raised[basis.lowered[m, i], j]
        np.add.at(K, (m - part.start, to - part.start), F[i, j] * powers[powers > 0])
    return K
