"""Expressions of nonlinear models, and their derivatives, as code to compile."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from reobserve.core.errors import InputError, shown
from reobserve.core.extras import package
from reobserve.systems.text_functions import python_code, read_expression

_MOST_OPERATIONS = 4000  # of a function or its Jacobian: compiling takes some milliseconds for each


def text_rows(
    name: str, texts: Any, shape: tuple[int, ...], states: Sequence[str], inputs: Sequence[str],
    parameters: Mapping[str, float],
) -> list[str]:  # fmt: skip
    """The code of each text in n texts, or in m rows of n texts, row by row.

    Raises
    ------
    InputError
        If they are not that, or one cannot be read; it names the place.
    """
    rows = [texts] if len(shape) == 1 else texts
    count = 1 if len(shape) == 1 else shape[0]
    good = isinstance(rows, list | tuple) and len(rows) == count
    good = good and all(isinstance(row, list | tuple) and len(row) == shape[-1] for row in rows)
    if not good or not all(isinstance(one, str) for row in rows for one in row):
        wanted = " rows of ".join(map(str, shape))
        raise InputError(name, f"{shown(texts)} must be a function, or {wanted} texts")
    places = [
        f"{name}[{i}]" if len(shape) == 1 else f"{name}[{i}][{j}]"
        for i in range(count if len(shape) > 1 else shape[0])
        for j in range(shape[-1] if len(shape) > 1 else 1)
    ]
    flat = [one for row in rows for one in row]
    symbols, written, values = _symbols(states, inputs, parameters)
    found = [
        read_expression(place, text, symbols, list(symbols))
        for place, text in zip(places, flat, strict=True)
    ]
    return _codes(places, [one.xreplace(values) for one in found], written, flat)


def text_jacobian(
    name: str, texts: Sequence[str], states: Sequence[str], inputs: Sequence[str],
    parameters: Mapping[str, float],
) -> list[str]:  # fmt: skip
    """The code of the derivatives of each text by each state, row by row.

    Raises
    ------
    InputError
        If they have more operations than can be compiled in some seconds.
    """
    symbols, written, values = _symbols(states, inputs, parameters)
    found, places = [], []
    for i, text in enumerate(texts):
        expression = read_expression(f"{name}[{i}]", text, symbols, list(symbols))
        for state in states:
            found.append(expression.diff(symbols[state]).xreplace(values))
            places.append(f"d {name}[{i}] / d {state}")
    return _codes(places, found, written)


def _symbols(
    states: Sequence[str], inputs: Sequence[str], parameters: Mapping[str, float]
) -> tuple[dict[str, Any], dict[Any, str], dict[Any, Any]]:
    """Symbols by name, how the code writes those of states and inputs, and the others' values."""
    sympy = package("sympy", "read expressions")
    symbols = {name: sympy.Symbol(name, real=True) for name in (*states, *inputs, *parameters)}
    written = {symbols[name]: f"x[{i}]" for i, name in enumerate(states)}
    written |= {symbols[name]: f"parameters[{i}]" for i, name in enumerate(inputs)}
    values = {symbols[name]: sympy.Float(value, 17) for name, value in parameters.items()}
    return symbols, written, values


def _codes(
    places: Sequence[str], expressions: Sequence[Any], written: Mapping[Any, str],
    texts: Sequence[str] | None = None,
) -> list[str]:  # fmt: skip
    codes, operations = [], 0
    for i, (place, expression) in enumerate(zip(places, expressions, strict=True)):
        code, more = python_code(place, expression, written, texts[i] if texts else "")
        operations += more
        if operations > _MOST_OPERATIONS:
            problem = f"has {more} operations, in all there must be {_MOST_OPERATIONS} or fewer"
            raise InputError(place, problem)
        codes.append(code)
    return codes
