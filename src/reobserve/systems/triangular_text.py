"""Triangular models from text: the right-hand sides as one would write them down."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from reobserve.core.errors import InputError, shown
from reobserve.core.extras import package
from reobserve.core.vector_field import vector_field
from reobserve.polynomials.grammar import check_size, parse
from reobserve.systems.triangular import TriangularModel

_MOST_OPERATIONS = 1000  # of all right-hand sides: compiling takes some milliseconds for each


@dataclass(frozen=True, eq=False, repr=False)
class TextModel(TriangularModel):
    """A triangular model that keeps what its functions were compiled from.

    ``drift_code``, n texts, and ``gain_code`` are expressions of Python in ``x[0]``, ``x[1]`` and
    functions of ``math``.
    """

    drift_code: tuple[str, ...]
    gain_code: str


def triangular_model(variables: Sequence[str], drift: Sequence[str], input_gain: str) -> TextModel:
    """The model x' = Lambda x + f(x) + (0, ..., 0, G(y))^T u, in the grammar of power series.

    Parameters
    ----------
    variables
        Names of the n states; the first one is the output.
    drift
        f, n texts; that of state i may name the first i variables.
    input_gain
        G, a text that may name the first variable.

    Raises
    ------
    InputError
        If one of them cannot be read or names another variable, if there are not n of them, or if
        they have more operations than can be compiled in some seconds.
    """
    sympy = package("sympy", "read expressions")
    for name, given in (("variables", variables), ("drift", drift)):
        good = isinstance(given, list | tuple) and all(isinstance(one, str) for one in given)
        if not good or not given:
            raise InputError(name, f"{shown(given)} must be a list of texts")
    if not all(one.isidentifier() for one in variables) or len(set(variables)) < len(variables):
        raise InputError("variables", f"{shown(list(variables))} must be different names")
    if len(drift) != len(variables):
        problem = f"has {len(drift)} texts, must have {len(variables)}, one a variable"
        raise InputError("drift", problem)
    if not isinstance(input_gain, str):
        raise InputError("input_gain", f"{shown(input_gain)} must be a text")
    symbols = {name: sympy.Symbol(name, real=True) for name in variables}
    rows, operations = [], 0
    places = [f"drift[{i}]" for i in range(len(drift))] + ["input_gain"]
    for i, (place, text) in enumerate(zip(places, [*drift, input_gain], strict=True)):
        code, more = _code(place, text, symbols, variables[: i + 1 if i < len(drift) else 1])
        operations += more
        if operations > _MOST_OPERATIONS:
            problem = f"has {more} operations, in all there must be {_MOST_OPERATIONS} or fewer"
            raise InputError(place, problem)
        rows.append(code)
    *rows, gain = rows
    return TextModel(
        len(variables), _compiled(rows), _compiled([gain]), np.zeros(0),
        tuple(rows), gain,
    )  # fmt: skip


def _code(
    place: str, text: str, symbols: dict[str, Any], allowed: Sequence[str]
) -> tuple[str, int]:
    """An expression as Python writes it, of the numbers ``x[i]``, and its number of operations."""
    import sympy

    expression = parse(place, text, symbols)
    check_size(place, expression)
    for symbol in sorted(map(str, expression.free_symbols)):
        if symbol not in allowed:
            raise InputError(
                place, f"{shown(text)} names {symbol}, must name nothing but {', '.join(allowed)}"
            )
    places = {symbols[name]: sympy.Symbol(f"x[{i}]") for i, name in enumerate(symbols)}
    # Integers that 64 bits do not hold would not compile.
    large = [one for one in expression.atoms(sympy.Rational) if max(abs(one.p), one.q) >= 2**63]
    places |= {one: sympy.Float(float(one), 17) for one in large}
    numbers = (part for part in sympy.preorder_traversal(expression) if part.is_number)
    if expression.has(sympy.nan) or any(number.is_real is False for number in numbers):
        raise InputError(place, f"{shown(text)} is no finite real number anywhere")
    try:
        code = str(sympy.pycode(expression.xreplace(places), fully_qualified_modules=True))
    except (ValueError, TypeError, NotImplementedError, RecursionError):
        code = "Not supported"
    if "Not supported" in code or "mpmath" in code:
        raise InputError(place, f"{shown(text)} has no form that can be compiled")
    return code, int(expression.count_ops())


def _compiled(rows: list[str]) -> Any:
    body = "".join(f"    out[{i}] = {row}\n" for i, row in enumerate(rows))
    namespace: dict[str, Any] = {"math": math}
    # Of the grammar's own expressions, which hold numbers, variables and functions of math alone.
    exec(f"def field(x, parameters, out):\n{body}", namespace)
    return vector_field(namespace["field"])
