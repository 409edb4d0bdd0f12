"""What Sections 3 and 4 say of series and of their equations, in numbers."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import factorial

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.papers.lie.lie_transform import LieTransform, lie_transform
from reobserve.polynomials.arithmetic import Coefficients, add_derivatives_along, zeros
from reobserve.polynomials.maps import PolynomialMap
from reobserve.polynomials.monomials import monomials
from reobserve.synthesis.normal_form.direct_s import solve_s
from reobserve.synthesis.normal_form.direct_t import solve_t
from reobserve.synthesis.normal_form.gain import gain_series
from reobserve.synthesis.normal_form.problem import NormalFormProblem
from reobserve.synthesis.normal_form.solver import identity, solver_for

Array = NDArray[np.float64]


def largest(values: Coefficients) -> float:
    """The largest absolute value."""
    return float(np.max(np.abs(values)))


@dataclass(frozen=True, eq=False)
class Roads:
    """What the three roads find for one problem, each gone when it is first asked for."""

    problem: NormalFormProblem

    @cached_property
    def S(self) -> Coefficients:
        """S by its own equation."""
        return solve_s(self.problem, solver_for(self.problem))

    @cached_property
    def T(self) -> Coefficients:
        """T by its own equation."""
        return solve_t(self.problem, solver_for(self.problem))

    @cached_property
    def lie(self) -> LieTransform:
        """All by the Lie transform."""
        return lie_transform(self.problem, solver_for(self.problem))

    def difference(self) -> float:
        """By how much S, T and the gain of the Lie transform differ from the direct ones."""
        gain = gain_series(PolynomialMap(self.problem.basis, self.S)).coefficients
        return max(
            largest(self.lie.S - self.S),
            largest(self.lie.T - self.T),
            largest(self.lie.L[:, : gain.shape[1]] - gain),
        )

    def residual(self) -> float:
        """The largest coefficient left of S' f = A S - l(h) and of T(S(x)) = x, to the degree."""
        problem, basis = self.problem, self.problem.basis
        left = problem.injected - problem.A @ self.S
        for d in range(1, problem.degree + 1):
            add_derivatives_along(basis, self.S, problem.dynamics, 1, d, d, 1, left)
        back = PolynomialMap(basis, self.T).after(PolynomialMap(basis, self.S), problem.degree)
        return max(largest(left), largest(back.coefficients - identity(problem)))

    def first_wrong_degree(self, *, literal: bool) -> float:
        """The lowest degree at which T by the triangle (22) is wrong; nan if it is right."""
        found = transformation_by_triangle(self.problem, self.lie.U, literal=literal)
        degree = lowest_degree(self.problem, found - self.T)
        return float(degree) if degree else float("nan")


def solvable(problem: NormalFormProblem) -> bool:
    """Whether the equation for S has one solution, and no more."""
    try:
        solve_s(problem, solver_for(problem))
    except InputError:
        return False
    return True


def ad_matrix(A: Array, degree: int) -> Array:
    """ad_Ax U = U' A x - A U on the homogeneous maps of a degree, component after component.

    Thomas, Kwatny & Chang, Lemma 4.17.
    """
    n = len(A)
    basis = monomials(n, degree)
    part, size = basis.part(degree), len(basis.exponents)
    Ax = np.zeros((n, size))
    Ax[:, basis.part(1)] = A
    columns = []
    for component, place in product(range(n), range(part.start, part.stop)):
        unit = np.zeros((n, size))
        unit[component, place] = 1.0
        image = -A @ unit
        add_derivatives_along(basis, unit, Ax, degree, degree, degree, 1.0, image)
        columns.append(image[:, part].ravel())
    return np.array(columns).T


def sums_of_eigenvalues(A: Array, degree: int) -> NDArray[np.complex128]:
    """m.lambda - lambda_j with |m| = ``degree``, the eigenvalues of ad_Ax.

    Thomas, Kwatny & Chang, Definition 3.5 and Lemma 4.17.
    """
    values = np.linalg.eigvals(A)
    basis = monomials(len(A), degree)
    found: NDArray[np.complex128] = np.subtract.outer(
        basis.exponents[basis.part(degree)] @ values, values
    )
    return found.ravel()


def spectrum_difference(A: Array, degree: int) -> float:
    """The largest distance from an eigenvalue of ad_Ax to the nearest of those of the lemma.

    Thomas, Kwatny & Chang, Lemma 4.17.
    """
    found, known = np.linalg.eigvals(ad_matrix(A, degree)), sums_of_eigenvalues(A, degree)
    distances = np.abs(found[:, None] - known)
    return float(max(distances.min(axis=0).max(), distances.min(axis=1).max()))


def transformation_by_triangle(
    problem: NormalFormProblem, U: Coefficients, *, literal: bool = False
) -> Coefficients:
    """T by the triangle from a generator U as `lie_transform` gives it.

    Thomas, Kwatny & Chang, (22), Proposition 4.20 and Remark 4.21.

    In the sum L_p U stands for the derivative of p along U, p' U; ``literal`` reads it as the Lie
    derivative of U along p, U' p. As there, p_i^(m) / i! is kept, part i + m + 2 of one series.
    """
    basis, degree = problem.basis, problem.degree
    T, generator = identity(problem), zeros(U.shape, U)
    for d in range(2, degree + 1):
        generator[:, basis.part(d)] = U[:, basis.part(d)] / factorial(d - 2)
    p = generator
    for m in range(degree - 1):
        T[:, basis.part(m + 2)] += p[:, basis.part(m + 2)] / factorial(m + 1)
        after = zeros(U.shape, U)
        for d in range(m + 3, degree + 1):
            after[:, basis.part(d)] = (d - m - 2) * p[:, basis.part(d)]
            if literal:
                add_derivatives_along(basis, generator, p, 2, d - m - 1, d, 1, after)
            else:
                add_derivatives_along(basis, p, generator, m + 2, d - 1, d, 1, after)
        p = after
    return T


def lowest_degree(problem: NormalFormProblem, series: Coefficients) -> int:
    """The lowest degree at which a series has a term; 0 for none."""
    degrees = problem.basis.exponents[np.any(series != 0, axis=0)].sum(axis=1)
    return int(degrees.min()) if degrees.size else 0
