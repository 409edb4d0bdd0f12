"""Systems with S and T in closed form, and resonances, where there is none."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from sympy import QQ
from sympy.polys.rings import PolyElement

from reobserve.core.errors import InputError
from reobserve.polynomials.maps import PolynomialMap
from reobserve.polynomials.monomials import monomials
from reobserve.synthesis.normal_form.direct_s import solve_s
from reobserve.synthesis.normal_form.direct_t import solve_t
from reobserve.synthesis.normal_form.homological_exact import RationalSolver
from reobserve.synthesis.normal_form.solver import solver_for
from reobserve.synthesis.normal_form.transform import normal_form
from reobserve.systems.polynomial import PolynomialSystem
from tests.reobserve.synthesis.normal_form.systems import (
    Case,
    Polynomials,
    built_from,
    difference,
    fraction,
    inverted,
    monomial,
    parts,
    times,
    to_map,
    to_polynomials,
    van_der_pol,
    variables,
)

Matrix = list[list[Any]]


def solve(case: Case, degree: int) -> tuple[Polynomials, Polynomials]:
    """S and T over fractions."""
    problem = case.problem(degree)
    solver = solver_for(problem)
    tables = solve_s(problem, solver), solve_t(problem, solver)
    s, t = (to_polynomials(PolynomialMap(problem.basis, table)) for table in tables)
    return s, t


def cut(series: Polynomials, degree: int) -> Polynomials:
    return [parts(p, 0, degree) for p in series]


# ------------------------------------------------------------------------------ one state


# x' = a x + b x^2, y = x, l(y) = (lambda - a) y. With S = x (s_0 + s_1 x + ...), s_0 = 1, the
# coefficient of x^(k+1) in S' f = lambda S - (lambda - a) x is
#     (k + 1) a s_k + k b s_(k-1) = lambda s_k,  so  s_k / s_(k-1) = -(b/a) k / (k + 1 - lambda/a),
# the ratio of the terms of 2F1(1, 1; 2 - lambda/a; -b x/a), which is (1)_k (1)_k / (c)_k / k!.
SCALAR = [(1, 1, -2), (2, -3, -1), (-1, QQ(1, 2), QQ(-7, 2)), (QQ(3, 2), QQ(2, 5), QQ(-5, 3))]


def scalar(a: Any, b: Any, pole: Any) -> Case:
    (x,) = variables(1)
    return Case([a * x + b * x**2], [x], [(pole - a) * x])


@pytest.mark.parametrize(("a", "b", "pole"), SCALAR)
def test_one_state_agrees_with_the_hypergeometric_series(a: Any, b: Any, pole: Any) -> None:
    (x,) = variables(1)
    degree = 14
    (S,), (T,) = solve(scalar(a, b, pole), degree)
    a, b, pole = (sympy.Rational(str(v)) for v in (a, b, pole))
    for k in range(degree):
        c = sympy.rf(1, k) ** 2 / sympy.rf(2 - pole / a, k) / sympy.factorial(k)
        assert sympy.Rational(str(S.coeff(x ** (k + 1)))) == c * (-b / a) ** k
    assert inverted([S], degree) == [T]


@pytest.mark.parametrize(("a", "b", "pole"), SCALAR)
def test_one_state_in_floats_agrees_with_the_sum_of_the_series(a: Any, b: Any, pole: Any) -> None:
    problem = scalar(a, b, pole).problem(40, exact=False)
    form = normal_form(problem.system, 40, injection=problem.injection)
    a, b, pole = (float(fraction(QQ(v))) for v in (a, b, pole))
    for x in (0.3 * a / b, -0.3 * a / b):
        known = x * mpmath.hyp2f1(1, 1, 2 - pole / a, -b * x / a)
        assert float(form.S([x])[0]) == pytest.approx(float(known), rel=1e-13)


def test_wrong_sign_of_the_argument_gives_another_series() -> None:
    (x,) = variables(1)
    (s,), _ = solve(scalar(1, 1, -2), 4)
    # By hand, 2 s_1 + 1 = -2 s_1 and so on: -1/4, then 2/4 and 3/5 and 3/6 times the previous one.
    assert s == x - x**2 / 4 + x**3 / 10 - x**4 / 20


# ------------------------------------------------------------------------------ finite series


x1, x2 = variables(2)
(y,) = variables(1)
A2: Matrix = [[QQ(-2), QQ(1)], [QQ(-5), QQ(1)]]
PLANE = {
    "p(x1) of degree 5": (
        [x1, x2 + x1**2 - x1**3 / 3 + 2 * x1**5],
        [x1, x2 - x1**2 + x1**3 / 3 - 2 * x1**5],
        [x1],
        [-2 * y, -4 * y + y**2],
    ),
    "p(x2), two terms of output": (
        [x1 - x2**2 / 2 + x2**4, x2],
        [x1 + x2**2 / 2 - x2**4, x2],
        [x1 - 3 * x2 + x1 * x2],
        [-y + y**2 / 3, y / 2],
    ),
    "a square both ways": (
        [x1 + (x1 - x2) ** 2, x2 + (x1 - x2) ** 2],
        [x1 - (x1 - x2) ** 2, x2 - (x1 - x2) ** 2],
        [x1 + x2**2],
        [-y, y + y**2],
    ),
}


@pytest.mark.parametrize("name", PLANE)
def test_finite_series_has_no_higher_terms(name: str) -> None:
    S, T, h, l = PLANE[name]  # noqa: E741
    case = built_from(S, T, A2, h, l)
    assert not any(case.residual_of_s(S))  # the claim of the case, by independent arithmetic
    assert solve(case, 8) == (S, T)


def of_three_states() -> tuple[Case, Polynomials, Polynomials]:
    """A system of two outputs, with its S and T."""
    a, b, c = variables(3)
    u, v = variables(2)
    S = [a, b + a**2, c + a * b - b**2 / 2]
    inner = b - a**2
    T = [a, inner, c - a * inner + inner**2 / 2]
    A: Matrix = [
        [QQ(-3), QQ(1), QQ(0)],
        [QQ(-1), QQ(-2), QQ(1)],
        [QQ(1, 2), QQ(0), QQ(-4)],
    ]
    l = [-u + u * v, v - u**2, u / 2 + v / 3]  # noqa: E741
    return built_from(S, T, A, [a, b + c + a * c], l), S, T


def test_finite_series_of_three_states_and_two_outputs_is_exact() -> None:
    case, S, T = of_three_states()
    assert not any(case.residual_of_s(S))
    assert solve(case, 5) == (S, T)


# ------------------------------------------------------------------------------ Van der Pol

# The cubic term of l moves the damping of the oscillator into the output injection.
LIENARD = Case(van_der_pol().f, [x1], [-2 * y + y**3 / 3, -4 * y + y**3 / 3])


def test_van_der_pol_with_cubic_injection_ends_at_degree_3() -> None:
    found = solve(LIENARD, 9)
    assert found == ([x1, x2 + x1**3 / 3], [x1, x2 - x1**3 / 3])


def test_van_der_pol_with_cubic_injection_satisfies_the_sympy_identity() -> None:
    a, b = sympy.symbols("a b")
    third = sympy.Rational(1, 3)
    f = sympy.Matrix([b, (1 - a**2) * b - a])
    S = sympy.Matrix([a, b + third * a**3])
    w = sympy.Matrix([-2 * a + third * a**3, -4 * a + third * a**3])
    A = sympy.Matrix([[-2, 1], [-5, 1]])
    assert sympy.expand(S.jacobian([a, b]) * f - A * S + w) == sympy.zeros(2, 1)


def test_van_der_pol_with_cubic_injection_has_a_linear_error() -> None:
    problem = LIENARD.problem(3, exact=False)
    S = normal_form(problem.system, 3, injection=problem.injection).S
    f, h, l = problem.system.dynamics, problem.system.output, problem.injection  # noqa: E741

    def together(_: float, state: NDArray[np.float64]) -> NDArray[np.float64]:
        x, z = state[:2], state[2:]
        return np.concatenate([f(x), problem.A @ z - l(h(x))])

    start = np.array([2.0, 0.5])
    instants = np.linspace(0, 20, 81)
    run = solve_ivp(together, (0, 20), [*start, 0, 0], "DOP853", instants, rtol=1e-12, atol=1e-14)
    error = S(run.y[:2].T) - run.y[2:].T
    known = np.array([expm(problem.A * t) @ S(start) for t in instants])
    assert np.max(np.abs(error - known)) < 1e-10
    assert np.max(np.abs(error[-1])) < 1e-3  # exp(-10) of an error of 3
    assert np.max(np.abs(run.y[0])) > 2.0  # on the limit cycle, far from the origin


# ------------------------------------------------------------------------------ linear plants

# x' = F x with F = diag(alpha), y = x1 + x2 + q(x), q quadratic. For a monomial x^m of q the
# coefficients s of S obey (mu - A) s = -L0 q_m with mu = m.alpha and A = F + L0 (1, 1), which
# by the formula of Sherman and Morrison has the solution
#     s_i = q_m l_i prod_(j != i) (alpha_j - mu) / prod_j (lambda_j - mu).
ALPHA = (QQ(-1), QQ(-2))
POLES = (QQ(-5, 2), QQ(-7, 2))
L0 = (QQ(-15, 4), QQ(3, 4))
QUADRATIC = {(2, 0): QQ(1), (1, 1): QQ(-3), (0, 2): QQ(2, 5)}


def diagonal_answer() -> Polynomials:
    S = [x1, x2]
    for m, q in QUADRATIC.items():
        mu = sum(k * alpha for k, alpha in zip(m, ALPHA, strict=True))
        bottom = (POLES[0] - mu) * (POLES[1] - mu)
        for i in range(2):
            S[i] = S[i] + q * L0[i] * (ALPHA[1 - i] - mu) / bottom * monomial([x1, x2], m)
    return S


def quadratic_output() -> PolyElement:
    return sum((q * monomial([x1, x2], m) for m, q in QUADRATIC.items()), x1 + x2)


DIAGONAL = Case([ALPHA[0] * x1, ALPHA[1] * x2], [quadratic_output()], [c * y for c in L0])
# x = V w with w as above: f, h, l and S follow.
V, BACK = [[QQ(1), QQ(1)], [QQ(1), QQ(2)]], [[QQ(2), QQ(-1)], [QQ(-1), QQ(1)]]
AT_W = list(zip([x1, x2], times(BACK, [x1, x2]), strict=True))
TURNED = Case(
    times(V, [p.compose(AT_W) for p in DIAGONAL.f]),
    [quadratic_output().compose(AT_W)],
    times(V, DIAGONAL.l),
)


def test_linear_system_with_quadratic_output_agrees_with_closed_form() -> None:
    case = DIAGONAL
    assert sympy.Matrix(
        2, 2, [sympy.Rational(str(v)) for row in case.A for v in row]
    ).eigenvals() == {sympy.Rational(str(v)): 1 for v in POLES}
    S, T = solve(case, 8)
    assert not any(difference(S, diagonal_answer()))
    assert not any(difference(T, inverted(diagonal_answer(), 8)))
    assert S[1].coeff(x1**2) == 1  # by hand: 3/4 * 1 / ((-1/2) (-3/2))


def test_linear_system_with_quadratic_output_agrees_in_other_coordinates() -> None:
    found, _ = solve(TURNED, 6)
    assert found == times(V, [p.compose(AT_W) for p in diagonal_answer()])


def test_linear_system_of_integers_is_computed_in_floats() -> None:
    floats = DIAGONAL.problem(2, exact=False)
    system = PolynomialSystem(PolynomialMap.linear([[-1, 0], [0, -2]]), floats.system.output)
    S = normal_form(system, 2, injection=floats.injection).S
    known = to_map(diagonal_answer()).as_floats()
    np.testing.assert_allclose(S.coefficients, known.coefficients, atol=1e-12)


# ------------------------------------------------------------------------------ resonance


def backwards(*poles: int) -> Case:
    """Van der Pol in reversed time: eigenvalues (-1 +- i sqrt 3) / 2; A gets the two poles."""
    total, whole = sum(poles), poles[0] * poles[1]
    first = total + 1
    return Case([-x2, x1 - (1 - x1**2) * x2], [x1], [first * y, (whole + first - 1) * y])


# alpha1 + alpha2 = -1; of degree 4, twice both; of degree 6, three times both
RESONANT = [((-1, -4), 2), ((-2, -5), 4), ((-3, -5), 6)]


@pytest.mark.parametrize(("poles", "degree"), RESONANT)
def test_resonance_is_refused_from_its_degree_on(poles: tuple[int, int], degree: int) -> None:
    case = backwards(*poles)
    problem = case.problem(degree)
    assert [float(v) for v in np.poly(problem.A.astype(float))] == pytest.approx(
        [1, -sum(poles), poles[0] * poles[1]]
    )
    solver = solver_for(problem)
    right = np.array(problem.basis.exponents[problem.basis.part(degree)].T, dtype=object)
    with pytest.raises(InputError, match=f"an eigenvalue of A is a sum of {degree} eigenvalues"):
        solver(problem.basis, right, degree)
    for exact in (True, False):
        again = case.problem(degree, exact=exact)
        with pytest.raises(InputError, match=rf"resonance; .* a degree below {degree}$"):
            normal_form(again.system, degree, injection=again.injection)
    # f is odd, so nothing would be divided by zero but zero; S is still not unique.
    with pytest.raises(InputError, match=f"sum of {degree} eigenvalues"):
        solve(case, degree)
    S, _ = solve(case, degree - 1)
    assert max(sum(m) for p in S for m in p.monoms()) == degree - 1


@pytest.mark.parametrize(("off", "refused"), [(1e-4, False), (1e-6, False), (1e-10, True)])
def test_near_resonance_may_lose_half_of_the_digits(off: float, refused: bool) -> None:
    """x' = -x and z' = -(2 + off) z + x^2 has S = z - x^2 / off, which loses as many digits."""
    system = PolynomialSystem.from_expressions(
        ["-x", f"-(2 + {off!r})*z + x**2"], ["z"], ["x", "z"], 2
    )
    injection = PolynomialMap.linear(np.zeros((2, 1)))
    if refused:
        with pytest.raises(
            InputError, match=r"resonance; choose other poles, or a degree below 2$"
        ):
            normal_form(system, 2, injection=injection)
    else:
        S = normal_form(system, 2, injection=injection).S.coefficients
        assert S[1, 3] == pytest.approx(-1.0 / off, rel=1e-14 / off)


def test_cancelling_row_is_resonance() -> None:
    """F = A = diag(-1, -3): -3 = 3 * -1, so the coefficient of x1^3 in the second row is free."""
    matrix = np.array([[Fraction(-1), Fraction(0)], [Fraction(0), Fraction(-3)]], dtype=object)
    basis = monomials(2, 3)
    right = np.full((2, 4), Fraction(0), dtype=object)
    with pytest.raises(InputError, match="an eigenvalue of A is a sum of 3 eigenvalues"):
        RationalSolver(matrix, matrix)(basis, right, 3)
