"""Compiled functions from text: the right-hand sides of models as one would write them down."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache, lru_cache
from typing import Any

import numpy as np

from reobserve.core.errors import InputError, shown
from reobserve.core.kernel import cached_inner
from reobserve.core.loop_function import loop_pointer
from reobserve.core.vector_field import VECTOR_FIELD
from reobserve.polynomials.grammar import check_size, parse


def read_expression(
    place: str, text: str, symbols: Mapping[str, Any], allowed: Sequence[str]
) -> Any:
    """The expression of sympy that a text writes, of the allowed names alone."""
    import sympy

    expression = parse(place, text, symbols)
    check_size(place, expression)
    for symbol in sorted(map(str, expression.free_symbols)):
        if symbol not in allowed:
            listed = ", ".join(allowed) or "numbers"
            raise InputError(place, f"{shown(text)} names {symbol}, must name nothing but {listed}")
    numbers = (part for part in sympy.preorder_traversal(expression) if part.is_number)
    if expression.has(sympy.nan) or any(number.is_real is False for number in numbers):
        raise InputError(place, f"{shown(text)} is no finite real number anywhere")
    return expression


def python_code(
    place: str, expression: Any, places: Mapping[Any, str], text: str = ""
) -> tuple[str, int]:
    """An expression as Python writes it, and its number of operations.

    ``places`` says how each symbol is written, ``text`` what a message repeats.
    """
    import sympy

    written = {symbol: sympy.Symbol(text, real=True) for symbol, text in places.items()}
    # Integers that 64 bits do not hold would not compile.
    large = [one for one in expression.atoms(sympy.Rational) if max(abs(one.p), one.q) >= 2**63]
    written |= {number: sympy.Float(float(number), 17) for number in large}
    try:
        code = str(_printer().doprint(expression.xreplace(written)))
    except (ValueError, TypeError, NotImplementedError, RecursionError):
        code = "Not supported"
    no_number = expression.has(sympy.nan, sympy.zoo, sympy.oo, -sympy.oo, sympy.I)
    if no_number or "Not supported" in code or "mpmath" in code:
        raise InputError(
            place, f"{shown(text or str(expression))} has no form that can be compiled"
        )
    return code, int(expression.count_ops())


@lru_cache(maxsize=256)
def compiled_rows(rows: tuple[str, ...]) -> Any:
    """Compile ``field(x, parameters, out)``, which writes the values of n expressions.

    The same rows are compiled once a process.
    Rows must come from `python_code`: they hold numbers, variables and functions of math alone.
    """
    body = "".join(f"    out[{i}] = {row}\n" for i, row in enumerate(rows))
    namespace: dict[str, Any] = {"math": math}
    exec(f"def field(x, parameters, out):\n{body}", namespace)
    field = namespace["field"]

    def again(x: Any, parameters: Any, out: Any) -> None:
        out[:] = np.nan
        with np.errstate(all="ignore"), suppress(ArithmeticError, ValueError):
            field(x, parameters, out)

    inner = cached_inner(VECTOR_FIELD, field)
    # It writes to nothing but its output, so that it needs no copies of what it reads.
    return loop_pointer(VECTOR_FIELD, inner, again, copies=False, pickled=(compiled_rows, (rows,)))


# Functions that math has not; each stands where it is a factor.
_WRITTEN = {
    "cot": "(1.0/math.tan({0}))", "sec": "(1.0/math.cos({0}))", "csc": "(1.0/math.sin({0}))",
    "coth": "(1.0/math.tanh({0}))", "sech": "(1.0/math.cosh({0}))", "csch": "(1.0/math.sinh({0}))",
    "sign": "(1.0*({0} > 0.0) - 1.0*({0} < 0.0))",
    "sinc": "(math.sin({0})/({0}) if {0} != 0.0 else 1.0)",
    # (cos(u) - sin(u) / u) / u = -u / 3 + u^3 / 30 - ..., as the difference cancels
    "sinc_slope": "((math.cos({0}) - math.sin({0})/({0}))/({0}) if abs({0}) > 1e-4 "
    "else ({0})/-3.0)",
}  # fmt: skip


@cache
def _printer() -> Any:
    """sympy's printer of Python, but for some functions, and whole powers, which raise at zero."""
    from sympy.printing.precedence import PRECEDENCE
    from sympy.printing.pycode import PythonCodePrinter

    class Printer(PythonCodePrinter):  # type: ignore[misc]
        def _print_Pow(self, expr: Any, rational: bool = False) -> str:
            if expr.exp.is_Integer and expr.exp < -1:
                base = self.parenthesize(expr.base, PRECEDENCE["Pow"], strict=False)
                return f"(1.0/{base}**{-int(expr.exp)})"
            return str(super()._print_Pow(expr, rational=rational))

    def printed(form: str) -> Any:
        return lambda printer, expr: form.format(printer._print(expr.args[0]))

    for name, form in _WRITTEN.items():
        setattr(Printer, f"_print_{name}", printed(form))
    return Printer({"fully_qualified_modules": True})
