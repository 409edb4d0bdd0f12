"""The linear equation of each degree over exact rationals, for checks and for printed tables.

Eigenvalues are not rational, so this method knows none: the sparse equations in the coefficients
are reduced by sympy. It is slow and exact.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np

from reobserve.core.errors import InputError
from reobserve.core.extras import package
from reobserve.polynomials.arithmetic import Coefficients
from reobserve.polynomials.monomials import Monomials


class RationalSolver:
    """Solves P'(x) F x - A P(x) = R(x) for one pair of matrices of fractions."""

    def __init__(self, F: Coefficients, A: Coefficients) -> None:
        self._F, self._A = F, A

    def __call__(self, basis: Monomials, right: Coefficients, degree: int) -> Coefficients:
        """The P for a homogeneous R of ``degree``, both of shape (n, monomials of that degree)."""
        QQ = package("sympy", "solve equations of fractions").QQ
        DomainMatrix = package("sympy.polys.matrices", "solve equations of fractions").DomainMatrix
        n, width = right.shape
        size = n * width
        rows: dict[int, dict[int, Any]] = {}

        def add(row: int, column: int, value: Fraction) -> None:
            if value != 0:
                entries = rows.setdefault(row, {})
                entries[column] = entries.get(column, QQ(0)) + QQ(
                    value.numerator, value.denominator
                )

        start = int(basis.first[degree])
        for k, powers in enumerate(basis.exponents[basis.part(degree)]):
            for i in np.flatnonzero(powers):
                shorter = basis.lowered[start + k, i]
                for j in range(n):
                    place = int(basis.raised[shorter, j]) - start
                    for c in range(n):
                        add(c * width + place, c * width + k, int(powers[i]) * self._F[i, j])
            for c in range(n):
                for b in range(n):
                    add(c * width + k, b * width + k, -self._A[c, b])
                add(c * width + k, size, Fraction(right[c, k]))
        # A row in which everything cancels is one equation less: sympy wants it left out.
        kept = {row: {j: v for j, v in entries.items() if v} for row, entries in rows.items()}
        rows = {row: entries for row, entries in kept.items() if entries}
        reduced, pivots = DomainMatrix(rows, (size, size + 1), QQ).rref()
        if pivots != tuple(range(size)):
            raise InputError(
                "injection",
                f"is resonant: an eigenvalue of A is a sum of {degree} eigenvalues of F",
            )
        solution = np.full(size, Fraction(0), dtype=object)
        for row, entries in reduced.rep.to_sdm().items():
            if size in entries:
                value = entries[size]
                solution[row] = Fraction(int(value.numerator), int(value.denominator))
        matrix: Coefficients = solution.reshape(n, width)
        return matrix
