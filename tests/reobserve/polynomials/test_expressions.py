"""Taylor polynomials of expressions against independent results."""

from __future__ import annotations

from fractions import Fraction
from math import comb, factorial, log, sqrt
from typing import Any

import flint
import mpmath
import numpy as np
import pytest
import sympy

from reobserve.core.errors import InputError
from reobserve.polynomials import univariate
from reobserve.polynomials.expressions import ANALYTIC, from_expressions
from reobserve.polynomials.maps import PolynomialMap
from reobserve.polynomials.univariate import DIGITS, FUNCTIONS

x, y = sympy.symbols("x y")


def expanded(expression: Any, degree: int, variables: Any = ("x", "y")) -> Any:
    return from_expressions("f", [expression], variables, degree)


def coefficients(series: PolynomialMap) -> dict[tuple[int, ...], Any]:
    return {powers: value for _, powers, value in series.terms()}


def known(expression: Any, degree: int) -> dict[tuple[int, ...], Fraction]:
    """Coefficients by derivatives along a line: the expression at (s x, s y), expanded in s."""
    s = sympy.Symbol("s")
    line = sympy.sympify(expression).subs({x: s * x, y: s * y}, simultaneous=True)
    taylor = sympy.series(line, s, 0, degree + 1).removeO().subs(s, 1)
    terms = sympy.Poly(sympy.expand(taylor), x, y).terms()
    return {m: Fraction(int(c.p), int(c.q)) for m, c in terms if c != 0}


RATIONAL = [
    "x*exp(x*y) - sin(x + 2*y)",
    "(x - y)**3/(1 + x*y)",
    "sqrt(1 + x)*cosh(y)",
    "log(1 + x - 3*y)/(2 - y)**2",
    "tan(x)*atan(y) + asinh(x*y)",
    "(1 + x)**y",
    "cos(sin(x*y)/(1 + x)) - 1",
]


@pytest.mark.parametrize("text", RATIONAL)
def test_coefficients_agree_with_sympy_fractions(text: str) -> None:
    series = expanded(text, 5)
    wanted = np.zeros(series.coefficients.shape)
    for powers, value in known(text, 5).items():
        wanted[0, series.basis.place(powers)] = value
    np.testing.assert_allclose(series.coefficients, wanted, rtol=1e-14, atol=1e-15)


@pytest.mark.parametrize("degree", [1, 4, 12])
def test_geometric_series_has_binomial_coefficients(degree: int) -> None:
    """1 / (1 + x + y): every coefficient is a binomial with a sign."""
    series = coefficients(expanded("1/(1 + x + y)", degree))
    wanted = {
        (i, j): (-1) ** (i + j) * comb(i + j, i)
        for i in range(degree + 1)
        for j in range(degree + 1 - i)
    }
    assert series == wanted


def test_powers_with_variable_base_and_exponent_agree_with_sympy() -> None:
    got = expanded("2**x", 9, ["x"]).coefficients[0]
    np.testing.assert_allclose(got, [log(2) ** k / factorial(k) for k in range(10)], rtol=1e-13)
    got = expanded("(1 + x)**(1/3)", 9, ["x"]).coefficients[0]
    np.testing.assert_allclose(got, [float(sympy.binomial(sympy.Rational(1, 3), k))
                                     for k in range(10)], rtol=1e-13)  # fmt: skip
    got = expanded("(4 + x)**-0.5", 3, ["x"]).coefficients[0]
    np.testing.assert_allclose(got, [0.5, -1 / 16, 3 / 256, -5 / 2048], rtol=1e-13)
    assert coefficients(expanded("x^2*(x - 2)^3", 3, ["x"])) == {(2,): -8.0, (3,): 12.0}
    assert coefficients(expanded("x**40", 9, ["x"])) == {}


def test_float_power_with_integer_value_is_an_integer_power() -> None:
    assert coefficients(expanded("x**2.0 + x", 3, ["x"])) == {(1,): 1.0, (2,): 1.0}


# Where the function is analytic. Elsewhere sympy takes minutes for gamma.
CENTRES = {
    **dict.fromkeys(ANALYTIC, ("0", "1", "-1/3")),
    **dict.fromkeys(("cot", "csc", "coth", "csch"), ("1", "-1/3")),
    **dict.fromkeys(("asin", "acos", "atanh"), ("0", "1/3")),
    "log": ("1", "3/2"),
    "acosh": ("2",),
    "gamma": ("1",),
    "sinc": ("0",),
    "LambertW": ("0", "1/3", "1"),
}


@pytest.mark.parametrize("name", ANALYTIC)
def test_functions_agree_with_mpmath(name: str) -> None:
    function = getattr(mpmath, name.lower())
    for centre in CENTRES[name]:
        got = expanded(f"{name}({centre} + x)", 6, ["x"]).coefficients[0]
        with mpmath.workdps(40):
            at = mpmath.mpf(sympy.Rational(centre).p) / sympy.Rational(centre).q
            wanted = [float(value.real) for value in mpmath.taylor(function, at, 6)]
        np.testing.assert_allclose(got, wanted, rtol=1e-12, atol=1e-13, err_msg=centre)


def test_square_root_agrees_with_60_digits_at_high_degree() -> None:
    """t^(1/2) at 2 is the sum of binom(1/2, k) 2^(1/2 - k) (t - 2)^k."""
    with flint.ctx.workdps(DIGITS + 60):
        found = univariate.coefficients(lambda t: t ** flint.arb("0.5"), flint.arb(2), 50)
    with mpmath.workdps(120):
        half = mpmath.mpf(1) / 2
        for k, value in enumerate(found):
            exact = mpmath.binomial(half, k) * mpmath.mpf(2) ** (half - k)
            assert abs(mpmath.mpf(value.str(80, radius=False)) / exact - 1) < mpmath.mpf(
                f"1e-{DIGITS}"
            )


def test_values_near_the_origin_agree_with_the_expression() -> None:
    """A model of a robot joint: the remainder falls with the degree as expected, down to
    rounding."""
    text = "sin(x)*cos(y + 1)/(2 + cos(x - y)) + exp(-x**2)*sqrt(3 + y)"
    value = sympy.lambdify((x, y), sympy.sympify(text))
    points = np.array([[0.03, -0.04], [-0.05, 0.01], [0.02, 0.06]])
    wanted = value(points[:, 0], points[:, 1])
    for degree, bound in ((2, 5e-4), (4, 1e-6), (8, 1e-11), (12, 4e-16)):
        error = np.abs(expanded(text, degree)(points)[:, 0] - wanted)
        assert np.max(error) < 2 * bound


def test_deep_composition_agrees_with_known_coefficients() -> None:
    """sin of sin of ... of x, twelve times: x - 12 x^3 / 6 + ..., and cos(1 + x) as a float."""
    text = "x"
    for _ in range(12):
        text = f"sin({text})"
    series = coefficients(expanded(text, 3, ["x"]))
    assert series == {(1,): 1.0, (3,): pytest.approx(-2.0, rel=1e-15)}
    mixed = expanded("exp(sin(log(1 + atanh(x + y))))", 7).coefficients[
        0, [1, 3, 6, 10, 15, 21, 28]
    ]
    with mpmath.workdps(30):
        wanted = mpmath.taylor(
            lambda t: mpmath.exp(mpmath.sin(mpmath.log(1 + mpmath.atanh(t)))), 0, 7
        )
    np.testing.assert_allclose(mixed, [float(c) for c in wanted[1:]], rtol=1e-13, atol=1e-15)
    got = expanded("cos(1 + x) + pi - sqrt(2)*x", 1, ["x"]).coefficients[0]
    np.testing.assert_allclose(got, [np.cos(1) + np.pi, -np.sin(1) - sqrt(2)], rtol=1e-15)


def test_symbols_text_and_numbers_are_accepted() -> None:
    p, v = sympy.symbols("p v", real=True)
    for given in (p * v + 2 * v, "p*v + 2*v", sympy.sympify("p*v + 2*v", locals={"p": p, "v": v})):
        got = expanded(given, 2, [p, v])
        assert coefficients(got) == {(0, 1): 2.0, (1, 1): 1.0}
    assert coefficients(expanded(3, 2, ["x"])) == {(0,): 3.0}
    assert coefficients(expanded(np.float64(0.5), 2, ["x"])) == {(0,): 0.5}
    # Names with a meaning in sympy are the user's own.
    assert coefficients(expanded("beta*E + I", 2, ["beta", "E", "I"])) == {
        (0, 0, 1): 1.0, (1, 1, 0): 1.0,
    }  # fmt: skip
    assert coefficients(expanded("x/3 + 0.1*x**2", 2, ["x"])) == {(1,): 1 / 3, (2,): 0.1}


LISTED = r"is not expanded; what can be are sums, products, powers and exp, log, sin"
BAD = {
    "1/x": r"1/x has no Taylor series at the origin",
    "sqrt(x)": r"sqrt\(x\) has no Taylor series at the origin",
    "x**(1/3)*y": r"x\*\*\(1/3\) has no Taylor series at the origin",
    "log(x)": r"log\(x\) has no Taylor series at the origin",
    "y + log(x - 1)": r"log\(x - 1\) has no Taylor series at the origin",
    "exp(1/x)": r"1/x has no Taylor series at the origin",
    "acosh(x)": r"acosh\(x\) has no Taylor series at the origin",
    "asin(1 + x)": r"asin\(x \+ 1\) has no Taylor series at the origin",
    "x**x": r"log\(x\) has no Taylor series at the origin",
    "I*x": r"holds I, which has no value",
    "x/0": r"zoo has no Taylor series at the origin",
    "Abs(x)": rf"'Abs' {LISTED}",
    "sign(x)*y": rf"'sign' {LISTED}",
    "Max(x, 0)": rf"'Max' {LISTED}",
    "Piecewise((x, x > 0), (0, True))": rf"'Piecewise' {LISTED}",
    "besselj(0, x)": rf"'besselj' {LISTED}",
    "rate(x)": rf"'rate' {LISTED}",
    "k*x": r"holds k, which has no value",
    "(1 + x)**k": r"holds k, which has no value",
    "(1 + x)**t": r"holds t, which has no value",
    "sin(x + t)": r"holds t, which has no value",
    "x + * y": r"'x \+ \* y' is no expression",
    "x +": r"'x \+' is no expression",
    "": r"'' is no expression",
    "S*x": r"holds S, which has no value",
    "sin": r"'sin' is no expression",
    "[x, y]": r"'\[x, y\]' is no expression",
    "x, y": r"'x, y' is no expression",
    "Matrix([x])": rf"'Matrix' {LISTED}",
    "LambertW(x, -1)": rf"'LambertW' {LISTED}",
    "exp(1000 + x)": r"exp\(x \+ 1000\) has a coefficient beyond floating-point numbers",
}


@pytest.mark.parametrize("text", BAD)
def test_non_expandable_expression_is_named_in_one_sentence(text: str) -> None:
    with pytest.raises(InputError, match=rf"^f\[1\]: {BAD[text]}") as caught:
        from_expressions("f", ["x", text], ["x", "y"], 3)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("given", [sympy.Abs(x), sympy.Max(x, 0), sympy.besselj(0, x)])
def test_unsupported_sympy_functions_are_refused(given: Any) -> None:
    with pytest.raises(InputError, match=rf"^f\[0\]: .*\) {LISTED}"):
        expanded(given, 3)


def test_none_is_refused_as_expression() -> None:
    with pytest.raises(InputError, match=r"^f\[0\]: None is no expression"):
        expanded(None, 2)


@pytest.mark.parametrize("centre", ["1e-8", "-1e-30", "0.7", "3"])
def test_sinc_near_zero_agrees_with_its_integral(centre: str) -> None:
    """sinc(t) is the integral of cos(s t) over 0 < s < 1, and so are its derivatives."""
    with flint.ctx.workdps(DIGITS):
        found = univariate.coefficients(FUNCTIONS["sinc"], flint.arb(centre), 6)
    with mpmath.workdps(60):
        c = mpmath.mpf(centre)
        for k in range(7):
            slope = mpmath.quad(lambda s, k=k: s**k * mpmath.cos(s * c + k * mpmath.pi / 2), [0, 1])
            wanted = float(slope / mpmath.factorial(k))
            assert float(found[k]) == pytest.approx(wanted, rel=1e-15)


@pytest.mark.parametrize("text", ["csch(1e308)", "tanh(exp(-1e308))", "sinh(1e-300) + x"])
def test_values_near_overflow_and_underflow_agree_with_the_expression(text: str) -> None:
    assert coefficients(expanded(text, 3, ["x"])).keys() <= {(0,), (1,)}
