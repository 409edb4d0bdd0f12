"""Sums of products of power series, one degree at a time, over floats or over exact rationals.

A series is a row of coefficients, a map some rows; an entry is a float, a complex number or a
Python `Fraction`. The source of a kernel stands once: floats run it compiled, fractions as it is.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from functools import wraps
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from reobserve.core.kernel import allocating_kernel, kernel
from reobserve.polynomials.monomials import Monomials

Coefficients = NDArray[Any]

Function = TypeVar("Function", bound=Callable[..., None])


def any_numbers(function: Function) -> Function:
    """Run the compiled function on floats, and its source on arrays of Python numbers."""
    source = getattr(function, "py_func", function)

    @wraps(source)
    def either(basis: Monomials, first: Coefficients, *rest: Any) -> None:
        (source if first.dtype == object else function)(basis, first, *rest)

    return cast(Function, either)


@any_numbers
@allocating_kernel
def add_derivatives_along(
    basis: Monomials,
    p: Coefficients,
    v: Coefficients,
    lowest: int,
    highest: int,
    degree: int,
    scale: Any,
    out: Coefficients,
) -> None:
    """Add ``scale`` times the part of ``degree`` of p'(x) v(x), p from degree lowest to highest.

    The part of degree r of p meets the part of degree ``degree + 1 - r`` of v. ``p`` and ``out``
    have shape (c, N), ``v`` has shape (n, N). This is L_v p, the derivative of p along v.
    """
    first, products, block = basis.first, basis.products, basis.block
    lowered, exponents = basis.lowered, basis.exponents
    # out_c += scale sum_i dp_c/dx_i v_i, of one degree;   d(x^m)/dx_i = m_i x^m / x_i
    for r in range(lowest, highest + 1):
        s = degree + 1 - r
        width = first[s + 1] - first[s]
        for i in range(len(v)):
            nonzero = [k for k in range(width) if v[i, first[s] + k] != 0]
            if len(nonzero) == 0:
                continue
            for m in range(first[r], first[r + 1]):
                power = exponents[m, i]
                if power == 0:
                    continue
                row = block[r - 1, s] + (lowered[m, i] - first[r - 1]) * width
                for c in range(len(p)):
                    if p[c, m] != 0:
                        factor = scale * power * p[c, m]
                        for k in nonzero:
                            out[c, products[row + k]] += factor * v[i, first[s] + k]


@any_numbers
@kernel
def add_applied(
    basis: Monomials,
    matrix: Coefficients,
    v: Coefficients,
    degree_m: int,
    degree_v: int,
    out: Coefficients,
) -> None:
    """Add M(x) v(x), with the parts of one degree each.

    ``matrix`` has shape (c n, N), row n c + i for the entry (c, i); ``v`` has shape (n, N) and
    ``out`` shape (c, N).
    """
    first, products, block = basis.first, basis.products, basis.block
    n = len(v)
    width = first[degree_v + 1] - first[degree_v]
    # out_c += sum_i M_ci v_i
    for c in range(len(out)):
        for i in range(n):
            for m in range(first[degree_m], first[degree_m + 1]):
                factor = matrix[c * n + i, m]
                if factor != 0:
                    row = block[degree_m, degree_v] + (m - first[degree_m]) * width
                    for k in range(width):
                        other = v[i, first[degree_v] + k]
                        if other != 0:
                            out[c, products[row + k]] += factor * other


def jacobian_part(basis: Monomials, p: Coefficients, degree: int, out: Coefficients) -> None:
    """Write the derivatives of the part of ``degree`` of p, shape (c, N), to ``out``, (c n, N)."""
    here = np.arange(basis.first[degree], basis.first[degree + 1])
    for i in range(basis.variables):
        powers = basis.exponents[here, i]
        m = here[powers > 0]
        out[i :: basis.variables, basis.lowered[m, i]] = p[:, m] * powers[powers > 0]


def zeros(shape: tuple[int, ...], like: Coefficients) -> Coefficients:
    """An array of zeros of the same kind of numbers as ``like``."""
    array = np.zeros(shape, dtype=like.dtype)
    if array.dtype == object:
        array += Fraction(0)  # the integer 0 that stands there divides as a float does
    return array
