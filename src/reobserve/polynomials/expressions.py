"""Taylor series at the origin of expressions, as text or of sympy.

The expression is walked through once, with the arithmetic of truncated series. Functions of one
argument are expanded about the value that their argument has at the origin, a ball of so many
digits that what is left after rounding to floats is right.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import reduce
from math import comb
from operator import add, mul
from typing import Any

import numpy as np

from reobserve.core.arguments import as_whole
from reobserve.core.errors import InputError, one_line, shown
from reobserve.core.extras import package
from reobserve.polynomials.arithmetic import Coefficients, add_applied, zeros
from reobserve.polynomials.grammar import ANALYTIC, NOT_EXPANDED, check_size, parse
from reobserve.polynomials.maps import PolynomialMap
from reobserve.polynomials.monomials import Monomials, monomials
from reobserve.polynomials.univariate import DIGITS, FUNCTIONS, LARGEST, coefficients

# A product of two series takes as many steps as there are products of their monomials, and a system
# some thousand products: above this they take minutes.
_MOST_PRODUCTS = 2_000_000
# Of all series of a call, some seconds.
_MOST_STEPS = 200_000_000
_HIGHEST_DEGREE = 100
_LONGEST_WHOLE = 1024  # bits


def from_expressions(
    name: str, expressions: Sequence[Any], variables: Sequence[Any], degree: int
) -> PolynomialMap:
    """The Taylor polynomials of ``expressions`` in the symbols ``variables`` up to a degree.

    Expressions may be of sympy or text in the grammar of `reobserve.polynomials.grammar`.

    Raises
    ------
    InputError
        That names the component of ``name`` and the part of it that has no Taylor series at the
        origin, is no known function or holds an unknown symbol; or what is too long, too deep, too
        high or too large to be worked with.
    """
    package("mpmath", "expand expressions")  # first, as sympy does not load without it
    sympy = package("sympy", "expand expressions")
    flint = package("flint", "expand expressions", "symbolic")
    for what, given in ((name, expressions), ("variables", variables)):
        if not isinstance(given, list | tuple):
            raise InputError(what, f"{shown(given)} must be a list")
    symbols = [sympy.Symbol(v) if isinstance(v, str) and v.isidentifier() else v for v in variables]
    if len({str(v) for v in symbols if isinstance(v, sympy.Symbol)}) < len(symbols) or not symbols:
        listed = ", ".join(v if isinstance(v, str) else shown(v) for v in variables)
        raise InputError("variables", f"{listed} must be different symbols, or names")
    names = {symbol.name: symbol for symbol in symbols}
    if not expressions:
        raise InputError(name, "is empty, must hold at least one expression")
    as_whole("degree", degree, 1, _HIGHEST_DEGREE)
    if comb(2 * len(symbols) + degree, degree) > _MOST_PRODUCTS:
        raise InputError("degree", f"{degree} is too high for series in {len(symbols)} variables")
    basis = monomials(len(symbols), degree)
    rows = []
    left = iter(range(_MOST_STEPS // comb(2 * len(symbols) + degree, degree)))
    for k, expression in enumerate(expressions):
        walk = _Walk(f"{name}[{k}]", basis, symbols, left)
        read = _read(walk.place, expression, names)
        check_size(walk.place, read)
        with flint.ctx.workdps(DIGITS + degree + 10):
            rows.append(walk.series(read))
    return PolynomialMap(basis, np.array(rows))


def _read(place: str, expression: Any, names: Mapping[str, Any]) -> Any:
    """Text, a number or an expression of sympy, as the last of these."""
    import sympy

    if isinstance(expression, str):
        return parse(place, expression, names)
    if isinstance(expression, int | np.integer) and not isinstance(expression, bool):
        if abs(int(expression)).bit_length() <= _LONGEST_WHOLE:
            return sympy.Integer(int(expression))
    elif isinstance(expression, float | np.floating):
        return sympy.Float(float(expression))
    elif isinstance(expression, Fraction):
        return sympy.Rational(expression.numerator, expression.denominator)
    elif isinstance(expression, sympy.Expr):
        return expression
    raise InputError(place, f"{shown(expression)} is no expression")


def _text(expression: Any) -> str:
    return one_line(str(expression), 100)


class _Walk:
    """The series of one expression and, on the way, of all its parts.

    Each product of two series takes a number from ``left``, as long as there are any.
    """

    def __init__(
        self, place: str, basis: Monomials, symbols: Sequence[Any], left: Iterator[int]
    ) -> None:
        self.place, self.basis, self.symbols, self.left = place, basis, symbols, left
        self.values: dict[Any, Any] = {}

    def series(self, expression: Any) -> Coefficients:
        """The coefficients of an expression, shape (N,)."""
        import sympy

        if expression in self.symbols:
            return self._constant(0.0, self.symbols.index(expression))
        if not expression.free_symbols & set(self.symbols):
            return self._constant(float(self._value(expression)))
        if isinstance(expression, sympy.Add):
            return reduce(np.add, map(self.series, expression.args))
        if isinstance(expression, sympy.Mul):
            return reduce(self._times, map(self.series, expression.args))
        if isinstance(expression, sympy.Pow):
            return self._power(expression)
        return self._composed(expression, self._function(expression))

    def _function(self, expression: Any) -> Callable[[Any], Any]:
        """The function that makes a series of one variable of the argument's series."""
        name = expression.func.__name__
        if not expression.is_Function or name not in ANALYTIC or len(expression.args) != 1:
            raise InputError(self.place, f"{_text(expression)} {NOT_EXPANDED}")
        return FUNCTIONS[name]

    def _power(self, expression: Any) -> Coefficients:
        import sympy

        base, exponent = expression.args
        if exponent.is_Float and float(exponent).is_integer():
            exponent = sympy.Integer(int(exponent))
            expression = base**exponent
        if exponent.is_Integer and exponent >= 0:
            return reduce(self._times, [self.series(base)] * int(exponent), self._constant(1.0))
        if not exponent.free_symbols & set(self.symbols):
            value = self._value(exponent)
            return self._composed(expression, lambda t: t**value)
        return self.series(sympy.exp(exponent * sympy.log(base), evaluate=False))

    def _composed(self, expression: Any, function: Callable[[Any], Any]) -> Coefficients:
        """g(u) by Horner's rule in u - u(0), with the Taylor coefficients of g at u(0)."""
        argument = expression.args[0]
        taylor = coefficients(function, self._value(argument), self.basis.degree)
        if taylor is None:
            raise self._no_series(expression)
        numbers = [float(number) for number in taylor]
        if not np.isfinite(numbers).all():
            raise self._beyond(expression)
        inner = self.series(argument)
        inner[0] = 0.0
        total = self._constant(numbers[-1])
        for number in numbers[-2::-1]:
            total = self._times(total, inner)
            total[0] += number
        return total

    def _value(self, expression: Any) -> Any:
        """The value at the origin, a ball, from the inside, as a tower of powers has none."""
        if expression not in self.values:
            value = self._of_parts(expression) if expression.args else self._of_leaf(expression)
            if value is None or not value.is_finite():
                raise self._no_series(expression)
            if not abs(value) < LARGEST:
                raise self._beyond(expression)
            self.values[expression] = value
        return self.values[expression]

    def _of_leaf(self, expression: Any) -> Any:
        from flint import arb, ctx, fmpq

        value = None
        if expression in self.symbols:
            value = arb(0)
        elif expression.is_Symbol:
            raise InputError(self.place, f"holds {_text(expression)}, which has no value")
        elif expression.is_Rational:
            value = arb(fmpq(int(expression.p), int(expression.q)))
        elif expression.is_Float:
            value = arb(float(expression))
        elif expression.is_NumberSymbol:  # pi and E
            value = arb(str(expression.evalf(ctx.dps)))
        return value

    def _of_parts(self, expression: Any) -> Any:
        value = None
        if expression.is_Add or expression.is_Mul:
            value = reduce(add if expression.is_Add else mul, map(self._value, expression.args))
        elif expression.is_Pow:
            base, exponent = map(self._value, expression.args)
            value = base**exponent
        elif expression.is_Function:
            function = self._function(expression)
            row = coefficients(function, self._value(expression.args[0]), 0)
            value = None if row is None else row[0]
        return value

    def _times(self, a: Coefficients, b: Coefficients) -> Coefficients:
        if next(self.left, None) is None:
            raise InputError(
                self.place,
                f"takes too many products of series up to degree {self.basis.degree}; a shorter "
                "expression or a lower degree may do",
            )
        out = zeros((1, len(a)), a)
        for d in range(self.basis.degree + 1):
            for r in range(d + 1):
                add_applied(self.basis, a[None], b[None], r, d - r, out)
        product: Coefficients = out[0]
        return product

    def _constant(self, value: Any, variable: int | None = None) -> Coefficients:
        """A constant, or one of the variables."""
        row = np.zeros(len(self.basis.exponents))
        if variable is None:
            row[0] = value
        else:
            row[1 + variable] = 1.0
        return row

    def _no_series(self, expression: Any) -> InputError:
        return InputError(self.place, f"{_text(expression)} has no Taylor series at the origin")

    def _beyond(self, expression: Any) -> InputError:
        said = f"{_text(expression)} has a coefficient beyond floating-point numbers"
        return InputError(self.place, said)
