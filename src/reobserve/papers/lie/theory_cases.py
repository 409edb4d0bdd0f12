"""Random systems over fractions, on which statements about all systems are tried."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from reobserve.core.errors import InputError
from reobserve.polynomials.arithmetic import Coefficients
from reobserve.polynomials.maps import PolynomialMap
from reobserve.polynomials.monomials import Monomials, monomials
from reobserve.synthesis.normal_form.problem import NormalFormProblem
from reobserve.synthesis.normal_form.resonance import check_nonresonant
from reobserve.systems.polynomial import PolynomialSystem

_HIGHEST = 3  # degree of f and h


def random_problem(
    stream: np.random.Generator, states: int, degree: int, *, hidden: bool = False
) -> NormalFormProblem:
    """A nonresonant problem with one output and the linear injection of the paper.

    f and h have terms of even and odd degrees. A has negative diagonals that dominate their rows,
    and F = A - L0 H. With ``hidden`` the output does not show the last mode, which then belongs
    to F and to A alike.
    """
    while True:
        A = _fractions(stream, (states, states), 4)
        for i in range(states):
            A[i, i] = -2 - i + A[i, i] / 2
        H, L0 = _fractions(stream, (1, states), 2), _fractions(stream, (states, 1), 2)
        if hidden:
            A[:-1, -1] = Fraction(0)
            H[0, -1] = Fraction(0)
        basis = monomials(states, _HIGHEST)
        f, h = (_higher(stream, size, basis) for size in (states, 1))
        f[:, basis.part(1)] = A - L0 @ H
        h[:, basis.part(1)] = H
        system = PolynomialSystem(PolynomialMap(basis, f), PolynomialMap(basis, h))
        problem = NormalFormProblem(system, PolynomialMap.linear(L0), degree)
        try:
            check_nonresonant(problem)
        except InputError:
            continue
        return problem


def _fractions(stream: np.random.Generator, shape: tuple[int, ...], below: int) -> Coefficients:
    """One, two or three times 1 / ``below``, of either sign."""
    drawn = stream.integers(1, 4, shape) * stream.choice([-1, 1], shape)
    found: Coefficients = drawn.astype(object) * Fraction(1, below)
    return found


def _higher(stream: np.random.Generator, rows: int, basis: Monomials) -> Coefficients:
    """Coefficients of degree 2 and above: two of five are drawn, and always that of x1^2."""
    shape = rows, len(basis.exponents)
    kept = stream.random(shape) < 0.4
    kept[:, : basis.first[2]] = False
    kept[:, basis.first[2]] = True
    found = _fractions(stream, shape, 4)
    found[~kept] = Fraction(0)
    return found
