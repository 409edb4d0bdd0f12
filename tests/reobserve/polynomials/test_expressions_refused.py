"""User text is read by a grammar: nothing else is executed, and large expressions are refused."""

from __future__ import annotations

import math
from fractions import Fraction
from functools import reduce
from operator import add, mul, sub, truediv
from pathlib import Path
from typing import Any

import flint
import mpmath
import numpy as np
import pytest
import sympy

from reobserve.core.errors import InputError
from reobserve.observers.normal_form import normal_form_observer
from reobserve.polynomials.expressions import from_expressions
from reobserve.polynomials.grammar import parse
from reobserve.polynomials.maps import PolynomialMap
from reobserve.polynomials.univariate import DIGITS, FUNCTIONS, coefficients
from reobserve.systems.triangular_text import triangular_model

a, b = sympy.symbols("a b")


def expanded(expression: Any, degree: int = 5) -> Any:
    return from_expressions("f", [expression], ["a", "b"], degree)


CODE = [
    "__import__('os').system('touch {}')",
    "().__class__.__bases__[0].__subclasses__()",
    "open('{}', 'w')",
    'exec(\'open("{}", "w")\')',
    "[open('{}', 'w') for _ in (1,)]",
    "lambda: 0",
    "a.__class__",
    "a if a else b",
    "f'{{a}}'",
    "a; b",
    "a\n__import__('os')",
    "(a := 1)",
    "a == b",
    "a // b",
    "a % b",
    "a @ b",
    "~a",
    "a[0]",
    "a, b",
    "1_000*a",
    "0x10*a",
    "2j*a",
    "'a'",
    "a b",
    "2a",
    "sin a",
    "sin(a, b)",
    "sin()",
    "a**",
    "**a",
    "((a)",
    "a)",
    "\u0430\u0435 $ a",
    "Symbol('a')",
    "S('a')",
    "sympify('a')",
    "\x00",
]


@pytest.mark.parametrize("text", CODE)
def test_code_is_refused_as_expression(tmp_path: Path, text: str) -> None:
    target = tmp_path / "ran"
    text = text.format(target) if "{}" in text else text
    with pytest.raises(
        InputError, match=r"^f\[0\]: .*(is no expression|is not expanded)"
    ) as reported:
        expanded(text)
    assert not target.exists()
    assert len(str(reported.value)) < 400
    assert "\n" not in str(reported.value)


def test_code_in_a_right_hand_side_does_not_run(tmp_path: Path) -> None:
    target = tmp_path / "ran"
    text = f"__import__('os').system('touch {target}')"
    for dynamics, output, variables in (
        (["b", text], ["a"], ["a", "b"]),
        (["b", "-a - b"], [text], ["a", "b"]),
        (["b", "-a - b"], ["a"], ["a", text]),
    ):
        with pytest.raises(InputError, match=r"^(dynamics|output|variables)"):
            normal_form_observer(
                dynamics, output, variables, order=1, sampling_period=0.1, poles=[-1.3, -2.1]
            )
    assert not target.exists()


def tower(function: str, levels: int, inner: str) -> str:
    return f"{function}(" * levels + inner + ")" * levels


LARGE: dict[str, Any] = {
    "a power": ("a**100000000", "has the power 100000000, must have 1000 or lower"),
    "a power of a power": ("(a**1000)**1000", "has the power 1000000"),
    "a negative power": ("(1 + a)**-100000000", "has the power -100000000"),
    "a power of a number": ("10**10**10*a", "beyond numbers|has the power"),
    "a number of a power": ("2**2**2**2**2**2*a", "beyond numbers|has the power"),
    "a root of a power": ("7**(10**200/3)*a", "beyond numbers|has the power"),
    "a tower": (tower("exp", 8, "a"), "beyond floating-point numbers"),
    "a tower of a number": (tower("exp", 6, "10") + "*a", "beyond floating-point numbers"),
    "a tower of a float": (tower("exp", 6, "10.0") + "*a", "beyond floating-point numbers"),
    "a large float": ("1e400*a", "beyond floating-point numbers"),
    "a long number": ("9" * 5000 + "*a", "beyond floating-point numbers"),
    "a product of numbers": ("*".join(["1e300"] * 3) + "*a", "beyond floating-point numbers"),
    "parentheses": ("(" * 5000 + "a" + ")" * 5000, "has 10001 char|nested deeper than 60"),
    "fewer parentheses": ("(" * 100 + "a" + ")" * 100, "nested deeper than 60 levels"),
    "powers of powers": ("a" + "**a" * 100, "nested deeper than 60 levels"),
    "a long text": ("a + " * 5000 + "a", "has 20001 characters, must have 10000 or fewer"),
    "a power of sympy": (a**100000000, "has the power 100000000"),
    "a number of sympy": (sympy.Integer(10) ** 400 * a, "beyond floating-point numbers"),
    "a float of sympy": (sympy.Float("1e400") * a, "beyond floating-point numbers"),
    "an infinite float": (math.inf, "has no Taylor|beyond|coefficient"),
    "no number": (math.nan, "has no Taylor|beyond|coefficient"),
    "a long whole number": (10**5000, "is no expression"),
    "a boolean": (True, "is no expression"),
    "a complex number": (1j, "is no expression"),
    "a list": ([1], "is no expression"),
    "an array": (np.ones(3), "is no expression"),
    "bytes": (b"a", "is no expression"),
}


deep = a
for _ in range(300):
    deep = sympy.sin(deep, evaluate=False)
turned = sympy.I * sympy.exp(400)  # its square is real, but not a float
LARGE |= {
    "a coefficient of a small number": (
        "1/(1e-200 + a)", r"1/\(a \+ 1.0e-200\) has a coefficient beyond floating-point numbers$"),
    "a coefficient of complex numbers": (
        sympy.Mul(turned, turned, evaluate=False) + b, "has no Taylor series at the origin$"),
    "functions of functions": (deep, "is nested deeper than 240 levels$"),
}  # fmt: skip


@pytest.mark.parametrize("name", LARGE)
def test_too_large_expression_is_refused_in_one_short_sentence(name: str) -> None:
    given, said = LARGE[name]
    with pytest.raises(InputError, match=rf"^f\[0\]: .*({said})") as reported:
        expanded(given)
    assert len(str(reported.value)) < 400


def test_coefficients_do_not_use_numpy_integers() -> None:
    basis = expanded("a").basis
    with pytest.raises(InputError, match=r"^coefficients: are of type int64, must be floats, comp"):
        PolynomialMap(basis, np.ones((1, len(basis.exponents)), dtype=np.int64))


def test_shared_subexpressions_stay_within_the_size_limit() -> None:
    expression: Any = a
    for k in range(40):
        expression = sympy.sin(expression * (expression + k + 1), evaluate=False)
    with pytest.raises(InputError, match=r"^f\[0\]: (has more than 10000 parts|is nested deeper)"):
        expanded(expression)


@pytest.mark.parametrize(
    "how", [{"order": 200}, {"order": 10**9}, {"expanded": 500}, {"order": 1, "degree": 10**30}]
)
def test_too_large_orders_and_degrees_are_refused(how: dict[str, Any]) -> None:
    given = {"order": 3, "sampling_period": 0.1, "poles": [-1.3, -2.1], **how}
    with pytest.raises(InputError, match=r"^(degree|order|expanded): .*(100|too high)"):
        normal_form_observer(["b", "-sin(a) - b"], ["a"], ["a", "b"], **given)


@pytest.mark.nightly_cases("(a + b)**1000")
@pytest.mark.parametrize(
    "text", ["+".join(f"sin({k}*a*b)" for k in range(1, 400)), "(a + b)**1000"]
)
def test_expression_that_takes_minutes_is_refused(text: str) -> None:
    with pytest.raises(InputError, match=r"^f\[0\]: takes too many products of series up to deg"):
        expanded(text, 60)


def test_right_hand_side_that_compiles_for_minutes_is_refused() -> None:
    long = "+".join(f"sin({k}*b)" for k in range(1, 780))
    with pytest.raises(InputError, match=r"^drift\[1\]: has \d{4} operations, in all .* 1000 or f"):
        triangular_model(["a", "b"], ["0", long], "1")
    with pytest.raises(InputError, match=r"^input_gain: has \d+ operations, in all .* 1000 or f"):
        triangular_model(["b", "a"], ["0", "-a"], long)


def test_arguments_of_wrong_type_are_refused() -> None:
    for dynamics, output, variables in (
        ("a", ["a"], ["a"]), (["-a"], "a", ["a"]), (["-a"], ["a"], "a"), (None, ["a"], ["a"]),
        ({"a": 1}, ["a"], ["a"]), (["-a"], ["a"], [3]), (["-a"], ["a"], []), (["-a"], ["a"], None),
        (["-a"], ["a"], ["a b"]), (["-a"], ["a"], ["a", "a"]),
    ):  # fmt: skip
        with pytest.raises(InputError, match=r"^(dynamics|output|variables): "):
            normal_form_observer(
                dynamics,
                output,
                variables,
                order=1,
                sampling_period=0.1,
                poles=[-2.0],  # type: ignore[arg-type]
            )


def test_grammar_agrees_with_python() -> None:
    """Precedence, associativity and signs agree with Python's reading of the same text."""
    x, y = Fraction(3, 7), Fraction(-2, 5)
    for text in (
        "-a**2", "(-a)**2", "2**-a*0 + a", "a - b - a", "a/2/3", "a*b**2*3", "--a", "-+-a",
        "a - -b", "+a*-b", "2**3**2*a", "(a + b)*(a - b)", "a**2*b/4 - b**3",
        "1.5*a + .5*b - 2.*a*b + 1e-1",
    ):  # fmt: skip
        series = expanded(text, 6)
        value = sum(
            Fraction(c) * x ** int(m[0]) * y ** int(m[1])
            for m, c in zip(series.basis.exponents, series.coefficients[0], strict=True)
        )
        assert float(value) == pytest.approx(eval(text, {"a": float(x), "b": float(y)}), rel=1e-14)


def taylor(function: Any, centre: str, degree: int) -> list[Any]:
    with flint.ctx.workdps(DIGITS + degree):
        return coefficients(function, flint.arb(centre), degree) or []


@pytest.mark.parametrize("degree", [1, 12, 25])
def test_taylor_coefficients_at_high_degrees_agree_with_mpmath(degree: int) -> None:
    with mpmath.workdps(60):
        third = mpmath.mpf(1) / 3
        for name in ("tan", "asin", "tanh", "sec", "erf", "sinc"):
            wanted = mpmath.taylor(getattr(mpmath, name), third, degree)
            got = taylor(FUNCTIONS[name], str(third), degree)
            assert [float(c) for c in got] == pytest.approx(
                [float(c) for c in wanted], rel=1e-13, abs=1e-300
            ), name
        wanted = [mpmath.binomial(mpmath.mpf("0.3"), k) for k in range(degree + 1)]
        got = taylor(lambda t: t ** flint.arb("0.3"), "1", degree)
        assert [float(c) for c in got] == pytest.approx([float(c) for c in wanted], rel=1e-13)


@pytest.mark.parametrize("name", ["sympy", "flint"])
def test_missing_package_is_named(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, name, None)
    with pytest.raises(
        InputError, match=rf'^{name}: .*`pip install "reobserve\[symbolic\]"` brings it$'
    ):
        expanded("a")


ENDLESS = {
    "a power of a power of a product": "(((2*a)**1000)**1000)**1000",
    "a root to a power": "sqrt(2)**(10**9/7)",
    "a function of a constant beyond floats": "a + sin(exp(10**9))",
    "a power of such a constant": "a**sin(1) + 2**exp(1000)",
    "fractions without a common part": "+".join(f"a/(9**300 + {i})" for i in range(9))
    + "".join(f"+1/(9**300 + {i})" for i in range(9)),
}


@pytest.mark.parametrize("text", ENDLESS.values(), ids=list(ENDLESS))
def test_text_that_would_take_for_ever_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="beyond"):
        expanded(text)


@pytest.mark.parametrize(("sign", "join"), [("+", add), ("-", sub), ("*", mul), ("/", truediv)])
def test_long_sums_and_products_are_those_of_their_parts(sign: str, join: Any) -> None:
    text = f" {sign} ".join(f"(a + {k})" for k in range(1, 100))
    found = parse("f", text, {"a": a}).subs(a, sympy.Rational(1, 2))
    expected = reduce(join, [0.5 + k for k in range(1, 100)])
    assert float(found) == pytest.approx(expected, rel=1e-12)
