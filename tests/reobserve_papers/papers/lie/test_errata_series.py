"""Printed formulas of the series, taken literally, and their corrections.

`recursion` is Section 4 as printed, with three switches between the printed and the correct form.
It uses no elimination: the step for U_(k-1) runs the printed formulas with unit vectors in place of
the unknown coefficients. It shares no code with the package.
"""

from __future__ import annotations

import re
from functools import cache
from math import comb, factorial
from typing import Any, NamedTuple

import numpy as np
import pytest
import sympy

from reobserve.polynomials.maps import PolynomialMap
from reobserve.synthesis.normal_form.direct_s import solve_s
from reobserve.synthesis.normal_form.direct_t import solve_t
from reobserve.synthesis.normal_form.solver import solver_for
from reobserve.synthesis.normal_form.transform import normal_form
from reobserve_papers.papers.lie.lie_transform import lie_transform
from tests.reobserve.synthesis.normal_form.systems import (
    Case,
    Polynomials,
    along,
    bracket,
    composed,
    difference,
    increments,
    inverted,
    largest,
    lowest_degree,
    monomial,
    parts,
    powers_of,
    random_case,
    solved,
    times,
    to_polynomials,
    van_der_pol,
    variables,
)


class Found(NamedTuple):
    U: list[Polynomials]
    T: Polynomials


def plus(*terms: Polynomials) -> Polynomials:
    return [sum(components[1:], components[0]) for components in zip(*terms, strict=True)]


def scaled(factor: Any, p: Polynomials) -> Polynomials:
    return [factor * c for c in p]


def triangle(U: list[Polynomials], *, literal: bool) -> list[Polynomials]:
    """T_1, T_2, ... by (22): p_i^(m) = p_(i+1)^(m-1) + sum of C(i, j) L_p U_j, p = p_(i-j)^(m-1).

    As a Lie derivative along p, ``literal``, L_p U is U' p; correct is p' U.
    """
    column, first = list(U), [U[0]]
    while len(column) > 1:
        column = [
            plus(
                column[i + 1],
                *(
                    scaled(comb(i, j), along(U[j], p) if literal else along(p, U[j]))
                    for j in range(i + 1)
                    for p in [column[i - j]]
                ),
            )
            for i in range(len(column) - 1)
        ]
        first.append(column[0])
    return first


def recursion(
    case: Case, degree: int, *, literal: bool = False, sign: int = -1, at_s: bool = True
) -> Found:
    """U and T up to a degree of T by (20), (21), (22) and the sum for the gain.

    ``sign`` is that of the sum of brackets in (20). With ``at_s`` the gain is dT/dz at z = S(x),
    otherwise dT/dz with x written for z.
    """
    n = len(case.f)
    x = list(case.f[0].ring.gens)
    w, A = case.w, case.A
    Ax = times(A, x)
    f: list[Polynomials] = [Ax]

    def step(k: int, U: list[Polynomials]) -> tuple[Polynomials, Polynomials, Polynomials]:
        """The remainder of (20) for this U_(k-1), with its f_k and T."""
        T = plus(
            x,
            *(
                scaled(1 / _rational(factorial(m + 1)), part)
                for m, part in enumerate(triangle(U, literal=literal))
            ),
        )
        jacobian = [c.diff(v) for c in T for v in x]
        if at_s:
            jacobian = composed(jacobian, inverted(T, k + 1), k)
        new = [parts(p, k + 1, k + 1) for p in case.f]
        for j in range(k + 1):
            L = [parts(p, j, j) for p in jacobian]
            fed = [parts(p, k + 1 - j, k + 1 - j) for p in w]
            rows = [
                sum((a * b for a, b in zip(L[n * c : n * c + n], fed, strict=True)), 0 * x[0])
                for c in range(n)
            ]
            new = plus(new, rows)
        new = scaled(factorial(k), new)
        brackets = [
            scaled(sign * comb(k - 1, j), bracket(f[k - 1 - j], U[j])) for j in range(k - 1)
        ]
        return difference(bracket(Ax, U[k - 1]), plus(new, *brackets)), new, T

    U: list[Polynomials] = []
    T = x
    for k in range(1, degree):
        units = [
            [monomial(x, m) if c == i else x[0] * 0 for i in range(n)]
            for c, m in increments(n, k + 1)
        ]

        def residual(trial: Polynomials, k: int = k) -> list[Any]:
            left = step(k, [*U, trial])[0]
            return [p.coeff(monomial(x, m)) for p in left for m in powers_of(n, k + 1)]

        none = residual([x[0] * 0] * n)
        columns = [[a - b for a, b in zip(residual(u), none, strict=True)] for u in units]
        matrix = [list(row) for row in zip(*columns, strict=True)]
        weights = solved(matrix, [-value for value in none])
        U.append(plus(*(scaled(c, u) for c, u in zip(weights, units, strict=True))))
        left, new, T = step(k, U)
        assert not any(left)
        f.append(new)
    return Found(U, T)


def _rational(value: int) -> Any:
    return sympy.QQ(value)


GENERIC = random_case(1, 2, 1)


@cache
def right(case: str, degree: int) -> Polynomials:
    """T from its own equation, without Lie transforms."""
    problem = CASES[case].problem(degree)
    return to_polynomials(PolynomialMap(problem.basis, solve_t(problem, solver_for(problem))))


CASES = {"van der pol": van_der_pol(), "generic": GENERIC}

VARIANTS: dict[str, dict[str, Any]] = {
    "(22) with U' p": {"literal": True},
    "(20) with the other sign": {"sign": 1},
    "gain not taken at S": {"at_s": False},
}
# The degree of the first wrong terms of T, and the largest error among their coefficients.
MISMATCH = {
    ("(22) with U' p", "van der pol"): (7, 0.0721),
    ("(20) with the other sign", "van der pol"): (5, 0.6805),
    ("gain not taken at S", "van der pol"): (5, 0.3017),
    ("(22) with U' p", "generic"): (4, 1.0144),
    ("(20) with the other sign", "generic"): (3, 0.03299),
    ("gain not taken at S", "generic"): (3, 0.1076),
}


@pytest.mark.parametrize(("case", "degree"), [("van der pol", 7), ("generic", 5)])
def test_corrected_recursion_gives_t_and_the_generator(case: str, degree: int) -> None:
    found = recursion(CASES[case], degree)
    assert not any(difference(found.T, right(case, degree)))
    problem = CASES[case].problem(degree)
    U = to_polynomials(PolynomialMap(problem.basis, lie_transform(problem, solver_for(problem)).U))
    for i, part in enumerate(found.U):
        assert part == [parts(p, i + 2, i + 2) for p in U]


@pytest.mark.parametrize(("variant", "case"), MISMATCH)
def test_literal_recursions_give_a_wrong_t_from_a_known_degree_on(variant: str, case: str) -> None:
    degree, size = MISMATCH[variant, case]
    found = recursion(CASES[case], degree, **VARIANTS[variant]).T
    wrong = difference(found, right(case, degree))
    assert lowest_degree(wrong) == degree
    assert largest(wrong) == pytest.approx(size, rel=1e-3)


# ------------------------------------------------------------------------------ printed T

PRINTED = """z1 -0.101852 z1^3 + 0.0277778 z1^2 z2 + 0.0277778 z1 z2^2 - 0.0185185 z2^3
+ 0.017789 z1^5 - 0.0132345 z1^4 z2 - 0.00547641 z1^3 z2^2 + 0.0102185 z1^2 z2^3
- 0.00366901 z1 z2^4 + 0.00030489 z2^5"""


def printed_terms() -> dict[tuple[int, int], tuple[float, float]]:
    """Exponents -> the coefficient and half a unit of its last printed digit."""
    found = {}
    for sign, digits, factors in re.findall(r"([+-])\s*([\d.]+)((?: z\d(?:\^\d)?)+)", PRINTED):
        m = [0, 0]
        for variable, power in re.findall(r"z(\d)(?:\^(\d))?", factors):
            m[int(variable) - 1] += int(power or 1)
        unit = 10.0 ** -len(digits.split(".")[1])
        found[m[0], m[1]] = float(sign + digits), unit / 2
    return found


def missed(T: Polynomials) -> set[tuple[int, int]]:
    """The printed coefficients that differ from the first component."""
    x = T[0].ring.gens
    return {
        m
        for m, (value, half) in printed_terms().items()
        if abs(float(T[0].coeff(monomial(list(x), m))) - value) > half
    }


def test_printed_transformation_agrees_with_t_to_all_digits() -> None:
    assert len(printed_terms()) == 10
    T = right("van der pol", 5)
    assert missed(T) == set()
    assert {m for m in T[0].monoms() if sum(m) > 1} == set(printed_terms())
    assert len(missed(T[::-1])) == 10  # it is the first component
    assert len(missed(inverted(T, 5))) == 10  # and not that of S


def test_printed_digits_distinguish_the_variants() -> None:
    fifth = {m for m in printed_terms() if sum(m) == 5}
    for variant, switches in VARIANTS.items():
        wrong = missed(recursion(van_der_pol(), 5, **switches).T)
        if "22" in variant:
            assert wrong == set()  # U_0 = U_2 = 0: the order of the factors matters at degree 7
        else:
            assert wrong
            assert wrong <= fifth


# ------------------------------------------------------------------------------ other formulas


def test_injection_is_subtracted_in_the_transformed_equation() -> None:
    # {I + dT/dz} (A z + L0 y): with y = h(x) and the plus sign not even the linear terms agree.
    case, T = van_der_pol(), right("van der pol", 5)
    x = list(T[0].ring.gens)
    assert lowest_degree(case.residual_of_t(T, 5)) > 5
    Az, fed = times(case.A, x), composed(case.w, T, 5)
    printed = difference(along(T, plus(Az, fed)), composed(case.f, T, 5))
    assert [parts(p, 1, 1) for p in printed] == [-4 * x[0], -8 * x[0]]  # 2 L0 H x


def test_identity_observer_adds_the_gain_times_h_minus_y() -> None:
    system = van_der_pol().problem(5, exact=False).system
    injection = van_der_pol().problem(5, exact=False).injection
    gain = normal_form(system, 5, injection=injection).gain
    f, h = system.dynamics, system.output
    slopes = {}
    for name, sign in (("printed", 1), ("corrected", -1)):
        # The error of (11) near zero, by differences: y = 0 and x^ small.
        columns = []
        for e in 1e-6 * np.eye(2):
            change = [
                f(s * e) + sign * gain(s * e).reshape(2, 2) @ injection(-h(s * e)) for s in (1, -1)
            ]
            columns.append((change[0] - change[1]) / 2e-6)
        slopes[name] = np.sort_complex(np.linalg.eigvals(np.array(columns).T))
    root = np.sqrt(13)
    np.testing.assert_allclose(slopes["printed"], [(3 - root) / 2, (3 + root) / 2], atol=1e-8)
    assert slopes["printed"].real[1] == pytest.approx(3.303, abs=5e-4)
    assert slopes["printed"].real[0] == pytest.approx(-0.303, abs=5e-4)
    half = -0.5 + np.array([-1, 1]) * 1.65831j
    np.testing.assert_allclose(slopes["corrected"], half, atol=1e-5)


def test_sum_for_the_gain_must_end_at_k() -> None:
    # T of order k has degree k + 1: its derivative has a part of degree k, which L_k must match.
    k = 4
    jacobian = [c.diff(v) for c in right("van der pol", k + 1) for v in variables(2)]
    gain = composed(jacobian, inverted(right("van der pol", k + 1), k + 1), k)
    assert largest(parts(p, k, k) for p in gain) > 0.1
    problem = van_der_pol().problem(k + 1)
    L = lie_transform(problem, solver_for(problem)).L
    assert to_polynomials(PolynomialMap(problem.basis, L)) == gain


def matrix_of_ad(A: list[list[Any]], degree: int) -> sympy.Matrix:
    """The matrix of ad_Ax on the homogeneous maps of a degree."""
    n = len(A)
    x = variables(n)
    columns = []
    for c, m in increments(n, degree):
        image = bracket(times(A, x), [monomial(x, m) * int(c == i) for i in range(n)])
        columns.append([image[i].coeff(monomial(x, k)) for i, k in increments(n, degree)])
    return sympy.Matrix(columns).T.applyfunc(lambda v: sympy.Rational(str(v)))


def sums(eigenvalues: list[Any], degree: int) -> list[Any]:
    n = len(eigenvalues)
    return [
        sum(k * v for k, v in zip(m, eigenvalues, strict=True)) - eigenvalues[j]
        for m in powers_of(n, degree)
        for j in range(n)
    ]


@pytest.mark.parametrize(
    ("A", "eigenvalues", "degree"),
    [
        ([[-5, 1], [-8, 1]], [-1, -3], 2),
        ([[-5, 1], [-8, 1]], [-1, -3], 3),
        ([[-2, 1, 0], [0, -3, 1], [0, 0, -5]], [-2, -3, -5], 2),
    ],
)
def test_eigenvalues_agree_with_lemma_4_17(A: Any, eigenvalues: list[int], degree: int) -> None:
    t = sympy.Symbol("t")
    known = sympy.prod([t - value for value in sums(eigenvalues, degree)])
    assert sympy.expand(matrix_of_ad(A, degree).charpoly(t).as_expr() - known) == 0
    D = [[value * (i == j) for j in range(len(A))] for i, value in enumerate(eigenvalues)]
    assert matrix_of_ad(D, degree).is_diagonal()
    assert not matrix_of_ad(A, degree).is_diagonal()


def test_complex_eigenvalues_agree_with_lemma_4_17() -> None:
    found = np.linalg.eigvals(np.array(matrix_of_ad([[-2, 1], [-5, 1]], 3), dtype=float))
    half = np.sqrt(11) / 2 * 1j
    wanted = np.array(sums([-0.5 + half, -0.5 - half], 3))
    distances = np.abs(found[:, None] - wanted)
    assert max(distances.min(axis=0).max(), distances.min(axis=1).max()) < 1e-6


def test_singular_ad_is_harmless_if_the_gain_is_unknown() -> None:
    """Remark 4.19 concerns a given gain; its elimination replaces one A by F."""
    case = van_der_pol((-5, -7))
    ad = matrix_of_ad(case.A, 3)
    assert ad.rank() == ad.rows - 1  # 3 (-1) - (-3) = 0
    problem = case.problem(7)
    solver = solver_for(problem)
    S, T = solve_s(problem, solver), solve_t(problem, solver)
    lie = lie_transform(problem, solver)
    assert np.array_equal(lie.S, S)
    assert np.array_equal(lie.T, T)
    s = to_polynomials(PolynomialMap(problem.basis, S))
    assert lowest_degree(case.residual_of_s(s)) > 7
    # The printed recursion also gets there, once the gain is among the unknowns of its equation.
    assert not any(difference(recursion(case, 5).T, inverted(s, 5)))
    floats = case.problem(7, exact=False)
    form = normal_form(floats.system, 7, injection=floats.injection)
    assert form.resonance is not None
    # The nearest resonance is alpha1 + alpha2 = 1 against -1, and at degree 3 it is farther away.
    assert form.resonance.powers == (1, 1)
    assert form.resonance.distance == pytest.approx(2, abs=1e-12)
    np.testing.assert_allclose(form.T.coefficients, T.astype(float), atol=1e-12)


def test_generator_degree_is_one_above_remark_4_22() -> None:
    for m, U in enumerate(recursion(GENERIC, 5).U):
        assert {sum(powers) for p in U for powers in p.monoms()} == {m + 2}
    # As ad_Ax keeps the degree, (21) could not hold otherwise: f_1 is quadratic.
    assert lowest_degree(parts(p, 2, 2) for p in GENERIC.f) == 2


def test_second_row_of_the_triangle_ends_with_f_0_1() -> None:
    # (15) for some f and U: f_i^(m) has degree i + m + 1, and so one degree in each row.
    x = variables(2)
    f = [
        [sum((monomial(x, m) for m in powers_of(2, k + 1)), 0 * x[0]), x[k % 2] ** (k + 1)]
        for k in range(4)
    ]
    U = [[x[0] ** (k + 2), x[0] * x[1] ** (k + 1)] for k in range(3)]
    columns = [f]
    for m in range(1, 4):
        before = columns[-1]
        columns.append(
            [
                difference(
                    before[i + 1],
                    plus(*(scaled(comb(i, j), bracket(before[i - j], U[j])) for j in range(i + 1))),
                )
                for i in range(4 - m)
            ]
        )

    def degrees(row: list[tuple[int, int]]) -> set[int]:
        return {sum(k) for i, m in row for p in columns[m][i] for k in p.monoms()}

    for k in range(4):
        assert degrees([(k - m, m) for m in range(k + 1)]) == {k + 1}
    assert degrees([(1, 0), (1, 1)]) == {2, 3}  # as printed
