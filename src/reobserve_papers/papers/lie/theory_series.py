"""Series by three methods, the operator ad_Ax, and random rational systems to test them."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.polynomials.arithmetic import Coefficients, add_derivatives_along
from reobserve.polynomials.maps import PolynomialMap
from reobserve.polynomials.monomials import Monomials, monomials
from reobserve.synthesis.normal_form.direct_s import solve_s
from reobserve.synthesis.normal_form.direct_t import solve_t
from reobserve.synthesis.normal_form.identity_gain import gain_series
from reobserve.synthesis.normal_form.problem import NormalFormProblem
from reobserve.synthesis.normal_form.resonance import check_nonresonant
from reobserve.synthesis.normal_form.solver import identity, solver_for
from reobserve.systems.polynomial import PolynomialSystem
from reobserve_papers.papers.lie.lie_transform import LieTransform, lie_transform

Array = NDArray[np.float64]


def largest(values: Coefficients) -> float:
    """The largest absolute value."""
    return float(np.max(np.abs(values)))


@dataclass(frozen=True, eq=False)
class Solutions:
    """Solutions of one problem by the three methods, computed on first use."""

    problem: NormalFormProblem

    @cached_property
    def S(self) -> Coefficients:
        """S from its own equation."""
        return solve_s(self.problem, solver_for(self.problem))

    @cached_property
    def T(self) -> Coefficients:
        """T from its own equation."""
        return solve_t(self.problem, solver_for(self.problem))

    @cached_property
    def lie(self) -> LieTransform:
        """U, T, S and the gain from the Lie transform."""
        return lie_transform(self.problem, solver_for(self.problem))

    def difference(self) -> float:
        """Maximum difference of S, T and the gain between the Lie transform and direct methods."""
        gain = gain_series(PolynomialMap(self.problem.basis, self.S)).coefficients
        return max(
            largest(self.lie.S - self.S),
            largest(self.lie.T - self.T),
            largest(self.lie.L[:, : gain.shape[1]] - gain),
        )

    def residual(self) -> float:
        """Maximum residual of S' f = A S - l(h) and of T(S(x)) = x, up to the degree."""
        problem, basis = self.problem, self.problem.basis
        back = PolynomialMap(basis, self.T).after(PolynomialMap(basis, self.S), problem.degree)
        return max(residual_of_s(problem, self.S), largest(back.coefficients - identity(problem)))


def residual_of_s(problem: NormalFormProblem, S: Coefficients) -> float:
    """Maximum residual of S' f = A S - l(h) up to the degree."""
    left = problem.injected - problem.A @ S
    for d in range(1, problem.degree + 1):
        add_derivatives_along(problem.basis, S, problem.dynamics, 1, d, d, 1, left)
    return largest(left)


def ad_matrix(A: Array, degree: int) -> Array:
    """ad_Ax U = U' A x - A U on the homogeneous maps of a degree, component by component.

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
    sums: NDArray[np.complex128] = np.subtract.outer(
        basis.exponents[basis.part(degree)] @ values, values
    )
    return sums.ravel()


def spectrum_difference(A: Array, degree: int) -> float:
    """Maximum distance from an eigenvalue of ad_Ax to the nearest one of the lemma.

    Thomas, Kwatny & Chang, Lemma 4.17.
    """
    computed, known = np.linalg.eigvals(ad_matrix(A, degree)), sums_of_eigenvalues(A, degree)
    distances = np.abs(computed[:, None] - known)
    return float(max(distances.min(axis=0).max(), distances.min(axis=1).max()))


def series_exists() -> bool:
    """True if S exists for x' = -x + x^2, y = x and A = -2, which is no sum of itself (Remark 3.7).

    Of S = x + s x^2 the terms of degree 2 are 1 + (2 F - A) s = 1, whatever s is.
    """
    f = PolynomialMap(monomials(1, 2), np.array([[Fraction(0), Fraction(-1), Fraction(1)]]))
    unit = np.array([[Fraction(1)]])
    system = PolynomialSystem(f, PolynomialMap.linear(unit))
    problem = NormalFormProblem(system, PolynomialMap.linear(-unit), 2)
    try:
        solve_s(problem, solver_for(problem))
    except InputError:
        return False
    return True


def with_singular_ad(system: PolynomialSystem) -> tuple[float, float]:
    """Smallest eigenvalue of ad_Ax of degree 3 with L0 = (-5, -7), and the residual of S.

    A of the example has the poles -1 and -3 = 3 (-1) then (Remark 4.19).
    """
    injection = PolynomialMap.linear(np.array([[Fraction(-5)], [Fraction(-7)]]))
    problem = NormalFormProblem(system, injection, 7)
    smallest = np.abs(sums_of_eigenvalues(problem.A.astype(np.float64), 3)).min()
    return float(smallest), residual_of_s(problem, solve_s(problem, solver_for(problem)))


def random_problem(
    stream: np.random.Generator, states: int, degree: int, terms: int, *, unobservable: bool = False
) -> NormalFormProblem:
    """A nonresonant problem with one output and the linear injection of the paper.

    f and h have terms of even and odd degrees up to ``terms``. A has negative diagonals that
    dominate their rows, and F = A - L0 H. With ``unobservable`` the output does not show the last
    mode, which then belongs to F and to A alike.
    """
    while True:
        A = _fractions(stream, (states, states), 4)
        for i in range(states):
            A[i, i] = -2 - i + A[i, i] / 2
        H, L0 = _fractions(stream, (1, states), 2), _fractions(stream, (states, 1), 2)
        if unobservable:
            A[:-1, -1] = Fraction(0)
            H[0, -1] = Fraction(0)
        basis = monomials(states, terms)
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
    coefficients: Coefficients = drawn.astype(object) * Fraction(1, below)
    return coefficients


def _higher(stream: np.random.Generator, rows: int, basis: Monomials) -> Coefficients:
    """Coefficients of degree 2 and above: each with probability 0.4, that of x1^2 always."""
    shape = rows, len(basis.exponents)
    chosen = stream.random(shape) < 0.4
    chosen[:, : basis.first[2]] = False
    chosen[:, basis.first[2]] = True
    coefficients = _fractions(stream, shape, 4)
    coefficients[~chosen] = Fraction(0)
    return coefficients
