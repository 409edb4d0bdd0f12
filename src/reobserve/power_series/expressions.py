"""Taylor series at the origin of expressions in sympy.

The expression is walked through once, with the arithmetic of truncated series. Only functions of
one argument are expanded by sympy, about the value that their argument has at the origin.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import reduce
from typing import Any

import numpy as np

from reobserve.errors import InputError
from reobserve.power_series.arithmetic import Coefficients, add_applied, zeros
from reobserve.power_series.maps import PolynomialMap
from reobserve.power_series.monomials import Monomials, monomials

# Functions of one argument that are analytic wherever sympy finds a series for them.
ANALYTIC = (
    *("exp", "log", "sin", "cos", "tan", "cot", "sec", "csc", "asin", "acos", "atan"),
    *("sinh", "cosh", "tanh", "coth", "sech", "csch", "asinh", "acosh", "atanh"),
    *("erf", "sinc"),
)


def from_expressions(
    name: str, expressions: Sequence[Any], variables: Sequence[Any], degree: int, *,
    exact: bool = False,
) -> PolynomialMap:  # fmt: skip
    """The Taylor polynomials of ``expressions`` in the symbols ``variables`` up to a degree.

    Expressions may be of sympy or text that sympy reads. With ``exact`` coefficients are kept
    as fractions.

    Raises
    ------
    InputError
        That names the component of ``name`` and the part of it that has no Taylor series at the
        origin, is no known function, holds an unknown symbol or (if exact) is not rational.
    """
    import sympy

    symbols = [sympy.Symbol(v) if isinstance(v, str) else v for v in variables]
    names = {getattr(symbol, "name", str(symbol)): symbol for symbol in symbols}
    if len(names) < len(symbols) or not all(isinstance(v, sympy.Symbol) for v in symbols):
        listed = ", ".join(map(str, variables))
        raise InputError("variables", f"{listed} must be different symbols, or names")
    if not len(expressions):
        raise InputError(name, "is empty, must hold at least one expression")
    basis = monomials(len(symbols), degree)
    rows = []
    for k, expression in enumerate(expressions):
        walk = _Walk(f"{name}[{k}]", basis, symbols, exact)
        try:
            read = sympy.sympify(expression, locals=names)
        except Exception:  # sympy evaluates text as Python, which may fail in any way
            read = None
        if not isinstance(read, sympy.Expr):
            raise InputError(walk.place, f"{expression!r} is no expression")
        rows.append(walk.series(read))
    return PolynomialMap(basis, np.array(rows, dtype=object if exact else np.float64))


class _Walk:
    """The series of one expression and, on the way, of all its parts."""

    def __init__(self, place: str, basis: Monomials, symbols: Sequence[Any], exact: bool) -> None:
        self.place, self.basis, self.symbols, self.exact = place, basis, symbols, exact

    def series(self, expression: Any) -> Coefficients:
        """The coefficients of an expression, shape (N,)."""
        import sympy

        if expression in self.symbols:
            return self._constant(0, self.symbols.index(expression))
        if not expression.free_symbols & set(self.symbols):
            return self._constant(self._number(expression, expression))
        if isinstance(expression, sympy.Add):
            return reduce(np.add, map(self.series, expression.args))
        if isinstance(expression, sympy.Mul):
            return reduce(self._times, map(self.series, expression.args))
        if isinstance(expression, sympy.Pow):
            return self._power(expression)
        known = expression.is_Function and expression.func.__name__ in ANALYTIC
        if known and len(expression.args) == 1:
            return self._composed(expression.func, expression.args[0], expression)
        raise InputError(
            self.place,
            f"{expression} is not expanded; what can be are sums, products, powers and "
            + ", ".join(ANALYTIC),
        )

    def _power(self, expression: Any) -> Coefficients:
        import sympy

        base, exponent = expression.args
        if exponent.is_Float and float(exponent).is_integer():
            exponent = sympy.Integer(int(exponent))
            expression = base**exponent
        if exponent.is_Integer and exponent >= 0:
            return reduce(self._times, [self.series(base)] * int(exponent), self._constant(1))
        if not exponent.free_symbols & set(self.symbols):
            return self._composed(lambda t: t**exponent, base, expression)
        return self.series(sympy.exp(exponent * sympy.log(base), evaluate=False))

    def _composed(self, function: Any, argument: Any, expression: Any) -> Coefficients:
        """g(u) by Horner's rule in u - u(0), with the Taylor coefficients of g at u(0)."""
        import sympy

        t = sympy.Dummy("t")  # no symbol of the user's
        centre = argument.subs(dict.fromkeys(self.symbols, 0))
        degree = len(self.basis.first) - 2
        try:
            taylor = sympy.series(function(centre + t), t, 0, degree + 1).removeO()
            found = sympy.Poly(taylor, t).all_coeffs()[::-1]
        except (
            sympy.PolynomialError,
            ValueError,
            NotImplementedError,
            TypeError,
            ZeroDivisionError,
        ):
            raise self._no_series(expression) from None
        numbers = [self._number(value, expression) for value in found[: degree + 1]]
        inner = self.series(argument)
        inner[0] = 0 * inner[0]
        total = self._constant(numbers[-1])
        for number in numbers[-2::-1]:
            total = self._times(total, inner)
            total[0] += number
        return total

    def _times(self, a: Coefficients, b: Coefficients) -> Coefficients:
        out = zeros((1, len(a)), a)
        for d in range(self.basis.degree + 1):
            for r in range(d + 1):
                add_applied(self.basis, a[None], b[None], r, d - r, out)
        product: Coefficients = out[0]
        return product

    def _constant(self, value: Any, variable: int | None = None) -> Coefficients:
        """A constant, or one of the variables."""
        row = np.zeros(len(self.basis.exponents), dtype=object if self.exact else np.float64)
        if self.exact:
            row += Fraction(0)
        if variable is None:
            row[0] = value
        else:
            row[1 + variable] = Fraction(1) if self.exact else 1.0
        return row

    def _number(self, value: Any, expression: Any) -> Any:
        unknown = sorted(map(str, value.free_symbols))
        if unknown:
            raise InputError(
                self.place, f"{expression} holds {', '.join(unknown)}, which has no value"
            )
        if not value.is_finite or not value.is_real:
            raise self._no_series(expression)
        if not self.exact:
            number = float(value)
            if not np.isfinite(number):
                raise InputError(self.place, f"{expression} has a coefficient of {number:g}")
            return number
        if value.is_Float:
            return Fraction(str(value))
        if not value.is_Rational:
            raise InputError(self.place, f"{expression} has the coefficient {value}, not rational")
        return Fraction(int(value.p), int(value.q))

    def _no_series(self, expression: Any) -> InputError:
        return InputError(self.place, f"{expression} has no Taylor series at the origin")
