"""The products of the components of a series that grows, degree by degree."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.kernel import kernel
from reobserve.polynomials.arithmetic import Coefficients, any_numbers, zeros
from reobserve.polynomials.monomials import Index, Monomials, check_size


class Powers:
    """The monomials s^m of a map s without constant terms, for all m that are asked for.

    Part d of a product of two or more components needs s only below degree d. So whoever solves
    for s one degree at a time can have `extend` take the products along.

    Parameters
    ----------
    basis
        The monomials that the components of s are written in.
    series
        s, shape (k, N): a live array, read again by every call of `extend`.
    inner
        The monomials in k variables that m runs over.
    wanted
        Which of them are asked for: their places.
    """

    def __init__(
        self, basis: Monomials, series: Coefficients, inner: Monomials, wanted: NDArray[Any]
    ) -> None:
        asked = [False] * len(inner.exponents)
        for m in wanted.tolist():
            asked[m] = True
        parents = inner.parent.tolist()
        for m in range(len(asked) - 1, 0, -1):
            if asked[m]:
                asked[parents[m]] = True
        kept = np.array(asked)
        kept[: len(series) + 1] = True  # 1 and the components themselves, in this order
        self.basis, self.series = basis, series
        self.places = np.flatnonzero(kept)
        size = len(self.places) * series.shape[1]
        check_size(basis.variables, basis.degree, size, "powers of the series", series.itemsize)
        row = np.cumsum(kept, dtype=np.int32) - 1
        self._parent = row[inner.parent[self.places]]
        self._factor = inner.variable[self.places] + 1
        self._order = inner.exponents[self.places].sum(axis=1, dtype=np.int32)
        self.table = zeros((len(self.places), series.shape[1]), series)
        self.table[0, 0] = 1

    def extend(self, degree: int) -> None:
        """Compute the parts of ``degree`` of the products of two or more components."""
        single = len(self.series) + 1
        if len(self.table) > single:
            known = self.basis.part(degree - 1)
            self.table[1:single, known] = self.series[:, known]
            _extend(self.basis, self.table, self._parent, self._factor, self._order, degree)

    def close(self) -> None:
        """Take in the highest part of s itself, once it is known."""
        self.table[1 : len(self.series) + 1] = self.series

    def part(self, outer: Coefficients, degree: int) -> Coefficients:
        """The part of ``degree`` of the map with the coefficients ``outer``, taken at s."""
        # Products of more components than that begin at a higher degree.
        rows = np.searchsorted(self._order, degree, side="right")
        part = self.basis.part(degree)
        terms: Coefficients = outer[:, self.places[:rows]] @ self.table[:rows, part]
        return terms


@any_numbers
@kernel
def _extend(
    basis: Monomials, table: Coefficients, parent: Index, factor: Index, order: Index, degree: int
) -> None:
    first, products, block = basis.first, basis.products, basis.block
    for row in range(len(table)):
        if order[row] < 2:
            continue
        a, b, out = table[parent[row]], table[factor[row]], table[row]
        # out_d = sum_s a_(d-s) b_s: the parts of degree d, d - s and s of out = a b
        # A product of q components begins at degree q.
        for s in range(1, degree - order[row] + 2):
            r = degree - s
            width = first[s + 1] - first[s]
            for i in range(first[r], first[r + 1]):
                if a[i] != 0:
                    start = block[r, s] + (i - first[r]) * width
                    for k in range(width):
                        other = b[first[s] + k]
                        if other != 0:
                            out[products[start + k]] += a[i] * other
