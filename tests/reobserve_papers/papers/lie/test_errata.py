"""Printed definitions, conditions and references that are wrong.

The printed recursion of Section 4 is tested in `test_errata_series`.
"""

from __future__ import annotations

from math import factorial
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from sympy import QQ

from reobserve.core.errors import InputError
from reobserve.polynomials.maps import PolynomialMap
from reobserve.synthesis.normal_form.direct_s import solve_s
from reobserve.synthesis.normal_form.direct_t import solve_t
from reobserve.synthesis.normal_form.solver import solver_for
from reobserve_papers.papers.lie.lie_transform import lie_transform
from tests.reobserve.synthesis.normal_form.systems import (
    Case,
    Polynomials,
    bracket,
    composed,
    difference,
    fraction,
    inverted,
    largest,
    lowest_degree,
    parts,
    random_case,
    times,
    to_polynomials,
    van_der_pol,
    variables,
)

Array = NDArray[np.float64]

x1, x2 = variables(2)
(y,) = variables(1)


def transformation(case: Case, degree: int) -> Polynomials:
    problem = case.problem(degree)
    return to_polynomials(PolynomialMap(problem.basis, solve_t(problem, solver_for(problem))))


def numbers(matrix: list[list[Any]]) -> Array:
    return np.array([[float(fraction(v)) for v in row] for row in matrix])


def test_definition_2_1_needs_a_derivative() -> None:
    """xi = gamma(xi, 0) without the dot is no differential equation, at most an iteration."""
    A = numbers(van_der_pol().A)  # gamma(xi, 0) = f + L0 h for the constant gain, at the origin
    flow = solve_ivp(lambda _, e: A @ e, (0, 20), [1.0, 1.0], rtol=1e-9, atol=1e-12)
    assert np.linalg.norm(flow.y[:, -1]) < 1e-3
    assert np.linalg.norm(np.linalg.matrix_power(A, 20) @ [1.0, 1.0]) > 1e4
    np.testing.assert_allclose(np.abs(np.linalg.eigvals(A)), np.sqrt(3.0))  # det A = 3


def scalar(pole: Any) -> Case:
    """x' = -x + x^2, y = x with A = ``pole``."""
    return Case([-y + y**2], [y], [(pole + 1) * y])


def test_nonresonance_of_a_alone_is_not_sufficient() -> None:
    """Definition 3.5 concerns A only; the condition compares A with F, as in Proposition 3.10."""
    case, degree = scalar(-2), 6
    assert all(m * -2 - -2 != 0 for m in range(2, degree + 1))
    problem = case.problem(degree)
    with pytest.raises(InputError, match="sum of 2 eigenvalues of F"):
        solve_s(problem, solver_for(problem))
    # By hand: with S = x + s x^2 + ..., the terms of degree 2 of S' f - A S + L0 x are 1.
    for s in (QQ(0), QQ(1), QQ(-7, 3)):
        left = parts(case.residual_of_s([y + s * y**2])[0], 2, 2)
        assert left == y**2
    other = scalar(QQ(-5, 2))
    problem = other.problem(degree)
    S = to_polynomials(PolynomialMap(problem.basis, solve_s(problem, solver_for(problem))))
    assert lowest_degree(other.residual_of_s([y.ring(p) for p in S])) > degree


def test_sums_of_eigenvalues_have_integer_coefficients() -> None:
    """With F = -1, A = -5/2 is 5/2 of F's eigenvalue, but no sum with integers: S exists."""
    case, degree = scalar(QQ(-5, 2)), 6
    assert QQ(5, 2) * -1 == QQ(-5, 2)
    assert all(m * -1 != QQ(-5, 2) for m in range(2, degree + 1))
    problem = case.problem(degree)
    S = to_polynomials(PolynomialMap(problem.basis, solve_s(problem, solver_for(problem))))
    assert lowest_degree(case.residual_of_s([y.ring(p) for p in S])) > degree


def in_poincare_domain(eigenvalues: Any) -> bool:
    """True if zero lies outside the convex hull of the eigenvalues (Definition 3.4)."""
    angles = np.sort(np.angle(eigenvalues))
    return bool(np.diff([*angles, angles[0] + 2 * np.pi]).max() > np.pi)


def test_poincare_domain_of_a_excludes_nothing() -> None:
    """Every stable A has its eigenvalues there; for F, as in Section 1, it is a condition."""
    draw = np.random.default_rng(3)
    for _ in range(50):
        A = draw.standard_normal((3, 3))
        A -= (0.1 + np.max(np.linalg.eigvals(A).real)) * np.eye(3)
        assert in_poincare_domain(np.linalg.eigvals(A))
    saddle = Case([x1 + x2**2, -x2 + x1**2], [x1 + x2], [-4 * y, QQ(-1, 2) * y])
    assert in_poincare_domain(np.linalg.eigvals(numbers(saddle.A)))
    assert np.max(np.linalg.eigvals(numbers(saddle.A)).real) < 0
    assert not in_poincare_domain(np.linalg.eigvals(numbers(saddle.F)))


def test_definition_3_8_is_sufficient_but_not_necessary() -> None:
    """An unobservable mode is never of type (C, nu), yet has a series.

    With |m| = 1 among the sums, the eigenvalue of such a mode is one of them.
    """
    alpha = (QQ(-1), QQ(-5, 2))
    case = Case([alpha[0] * x1 + x1**2, alpha[1] * x2 + x1**2], [x1], [QQ(-7, 3) * y, 0 * y])
    hidden = case.A[1][1]
    assert hidden == alpha[1]  # m = (0, 1), |m| = 1: the distance is zero, and so is C
    degree = 7
    assert all(
        m1 * alpha[0] + m2 * alpha[1] not in (hidden, case.A[0][0])
        for m1 in range(degree + 1)
        for m2 in range(degree + 1)
        if m1 + m2 > 1
    )
    problem = case.problem(degree)
    S = to_polynomials(PolynomialMap(problem.basis, solve_s(problem, solver_for(problem))))
    assert lowest_degree(case.residual_of_s(S)) > degree
    # S2 = x2 + s x1^2 + ...: (2 alpha1 - alpha2) s = -1, and all above are in x1 alone.
    assert S[1].coeff(x1**2) == -1 / (2 * alpha[0] - alpha[1])
    assert set(parts(S[1], 2, degree).monoms()) == {(d, 0) for d in range(2, degree + 1)}


def slopes(p: Polynomials) -> list[Polynomials]:
    return [[c.diff(v) for v in p[0].ring.gens] for c in p]


def test_new_coordinates_multiply_the_output_by_the_inverse_jacobian() -> None:
    """In the equation after (14) the gain at T(z) stands alone; z' then contains terms in y."""
    T = transformation(van_der_pol(), 5)
    gain = slopes(T)  # I + L_1 + L_2 + ... at T(z)
    fed = times(gain, [-2 + 0 * x1, -4 + 0 * x1])
    extra = difference(fed, [-2 + 0 * x1, -4 + 0 * x1])  # in y, beyond L0
    assert lowest_degree(extra) == 2
    assert largest(extra) > 0.5
    # With the inverse of dT/dz before it the terms in y are L0 y, as (9) requires.
    adjoint = [[gain[1][1], -gain[0][1]], [-gain[1][0], gain[0][0]]]
    determinant = gain[0][0] * gain[1][1] - gain[0][1] * gain[1][0]
    assert times(adjoint, fed) == [-2 * determinant, -4 * determinant]


def test_gain_of_remark_4_23_lacks_l0() -> None:
    """dT/dz is n by n and I at the origin; L(x) of Section 2.2 is n by p and L0 there."""
    problem = van_der_pol().problem(5)
    L = PolynomialMap(problem.basis, lie_transform(problem, solver_for(problem)).L)
    at_zero = L(np.zeros(2, dtype=object)).reshape(2, 2)
    assert np.array_equal(at_zero, np.eye(2, dtype=int))
    assert problem.injection.matrix.shape == (2, 1)
    assert np.array_equal(at_zero @ problem.injection.matrix, [[-2], [-4]])
    with pytest.raises(ValueError, match="mismatch"):
        at_zero @ np.array([1.0])  # times y - h, which has p entries


def test_printed_t_has_one_monomial_twice() -> None:
    """0.0277778 z1 z2^2 appears twice; the first of them belongs to z1^2 z2."""
    first = transformation(van_der_pol(), 5)[0]
    half = 0.5e-7
    assert float(first.coeff(x1 * x2**2)) == pytest.approx(0.0277778, abs=half)
    assert float(first.coeff(x1**2 * x2)) == pytest.approx(0.0277778, abs=half)
    # Taken as printed, they add up to twice the coefficient and leave one out.
    assert abs(2 * 0.0277778 - float(first.coeff(x1 * x2**2))) > 0.02


def test_single_printed_row_has_no_inverse() -> None:
    """T(z) "and its inverse" are printed as one row, which is the first of two."""
    T = transformation(van_der_pol(), 5)
    S = inverted(T, 5)
    assert [parts(p, 1, 5) for p in composed(S, T, 5)] == [x1, x2]
    # The inverse needs the second row, which is not x2; with x2 it is not an inverse.
    wrong = composed(inverted([T[0], x2], 5), T, 5)
    assert lowest_degree(difference([parts(p, 1, 5) for p in wrong], [x1, x2])) == 3


def test_bar_is_printed_for_a_tilde() -> None:
    """T_k = T_1 / 1! + ... cannot be z plus the same sum: it starts with terms of degree 2."""
    case = random_case(1, 2, 1)
    T = transformation(case, 4)
    z = list(T[0].ring.gens)
    higher = difference(T, z)
    assert lowest_degree(higher) == 2
    problem = case.problem(4)
    U = to_polynomials(PolynomialMap(problem.basis, lie_transform(problem, solver_for(problem)).U))
    first = [parts(p, 2, 2) for p in U]  # T_1 = p_0^(0) = U_0
    assert [parts(p, 2, 2) for p in higher] == [p / factorial(1) for p in first]
    assert [parts(p, 1, 1) for p in higher] == [0 * x1, 0 * x1] != z


def test_equation_references_are_wrong() -> None:
    """The text before the display of Remark 4.22 names (7); what is transformed is (8)."""
    case = van_der_pol()
    z = list(variables(2))
    # (7), x^ = T(z), holds for any T by definition; (8) is transformed, and distinguishes the
    # correct T from others.
    assert lowest_degree(case.residual_of_t(transformation(case, 5), 5)) > 5
    assert lowest_degree(case.residual_of_t(z, 5)) == 3


@pytest.mark.parametrize(("case", "degree"), [(van_der_pol(), 5), (random_case(1, 2, 1), 3)])
def test_terms_are_evaluated_at_the_transformed_state(case: Case, degree: int) -> None:
    """ad_Az T~ = f(T) + L(T) L0 h(T) - A T; with z for T on the right the equation differs."""
    T = transformation(case, degree)
    z = list(T[0].ring.gens)
    left = [parts(p, 2, degree) for p in bracket(times(case.A, z), difference(T, z))]
    gain = slopes(T)  # L at T(z)

    def terms(at: Polynomials, gain: list[Polynomials]) -> Polynomials:
        fed = times(gain, composed(case.w, at, degree))
        return [
            parts(f + w - linear, 2, degree)
            for f, w, linear in zip(
                composed(case.f, at, degree), fed, times(case.A, at), strict=True
            )
        ]

    assert left == terms(T, gain)
    flat = composed([entry for row in gain for entry in row], inverted(T, degree), degree)
    at_z = [flat[:2], flat[2:]]  # L with argument z
    assert lowest_degree(difference(terms(z, at_z), left)) == degree
