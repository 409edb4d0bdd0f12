"""Values of polynomials inside compiled loops."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reobserve.core.kernel import inlined_kernel
from reobserve.polynomials.maps import PolynomialMap

Array = NDArray[np.float64]
Places = NDArray[np.int64]


class Polynomials(NamedTuple):
    """The terms of a map that are not zero, and the monomials needed to build them up.

    Monomial k is monomial ``parent[k]`` times the variable ``variable[k]``, and the first is 1.
    Component c is the sum over j from ``start[c]`` to ``start[c + 1]`` of ``coefficient[j]`` times
    monomial ``term[j]``.
    """

    parent: Places
    variable: Places
    start: Places
    term: Places
    coefficient: Array


def polynomials(source: PolynomialMap) -> Polynomials:
    """A map in the form in which `evaluate` reads it."""
    table = source.coefficients.astype(np.float64)
    needed = np.any(table != 0, axis=0)
    needed[0] = True
    parent = source.basis.parent
    for m in range(len(needed) - 1, 0, -1):
        if needed[m]:
            needed[parent[m]] = True
    places = np.flatnonzero(needed)
    row = np.cumsum(needed) - 1
    component, term = np.nonzero(table)
    return Polynomials(
        row[parent[places]].astype(np.int64),
        source.basis.variable[places].astype(np.int64),
        np.searchsorted(component, np.arange(len(table) + 1)).astype(np.int64),
        row[term].astype(np.int64),
        np.ascontiguousarray(table[component, term]),
    )


@inlined_kernel
def evaluate(p: Polynomials, x: Array, monomials: Array, out: Array) -> None:
    """Write the values at ``x`` to ``out``, with ``monomials`` a buffer, one number a monomial."""
    # x^m = x^parent(m) x_variable(m), from x^0 = 1
    monomials[0] = 1.0
    for k in range(1, len(p.parent)):
        monomials[k] = monomials[p.parent[k]] * x[p.variable[k]]
    # p_c(x) = sum_j coefficient_j x^term(j)
    for c in range(len(out)):
        total = 0.0
        for j in range(p.start[c], p.start[c + 1]):
            total += p.coefficient[j] * monomials[p.term[j]]
        out[c] = total
