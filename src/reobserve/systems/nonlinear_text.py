"""Expressions of nonlinear models, and their derivatives, as code to compile."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

from reobserve.core.errors import InputError, shown
from reobserve.core.extras import package
from reobserve.polynomials.grammar import functions, parse
from reobserve.systems.text_functions import python_code, read_expression

_MOST_OPERATIONS = 4000  # of a function or its Jacobian: compiling takes some milliseconds for each
_MOST_KEPT = 256  # functions and Jacobians whose code is kept


class Names(NamedTuple):
    """Names that texts are written in, with parameters behind the inputs in code."""

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    parameters: tuple[str, ...]


def text_rows(name: str, texts: Any, shape: tuple[int, ...], names: Names) -> tuple[str, ...]:
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
    if not good or not all(isinstance(text, str) for row in rows for text in row):
        wanted = " rows of ".join(map(str, shape))
        raise InputError(name, f"{shown(texts)} must be a function, or {wanted} texts")
    places = tuple(
        f"{name}[{i}]" if len(shape) == 1 else f"{name}[{i}][{j}]"
        for i in range(count if len(shape) > 1 else shape[0])
        for j in range(shape[-1] if len(shape) > 1 else 1)
    )
    package("sympy", "read expressions")
    return _rows(places, tuple(text for row in rows for text in row), names)


@lru_cache(maxsize=_MOST_KEPT)
def _rows(places: tuple[str, ...], texts: tuple[str, ...], names: Names) -> tuple[str, ...]:
    symbols, written = _symbols(names)
    expressions = [
        read_expression(place, text, symbols, list(symbols))
        for place, text in zip(places, texts, strict=True)
    ]
    return _codes(places, expressions, written, texts)


@lru_cache(maxsize=_MOST_KEPT)
def text_jacobian(name: str, texts: tuple[str, ...], names: Names) -> tuple[str, ...]:
    """The code of the derivatives of each text by each state, row by row.

    Raises
    ------
    InputError
        If they have more operations than can be compiled in some seconds.
    """
    symbols, written = _symbols(names)
    derivatives, places = [], []
    for i, text in enumerate(texts):
        expression = read_expression(f"{name}[{i}]", text, symbols, list(symbols))
        for state in names.states:
            places.append(f"d {name}[{i}] / d {state}")
            derivatives.append(_derivative(places[-1], expression, symbols[state]))
    return _codes(places, derivatives, written)


# The derivatives by the arguments u and v of functions; that of abs is 0 at 0, that of atan2 nan
# where both are 0.
_DERIVATIVES = {
    "exp": ["exp(u)"], "log": ["1/u"], "erf": ["2*exp(-u**2)/sqrt(pi)"],
    "sin": ["cos(u)"], "cos": ["-sin(u)"], "tan": ["tan(u)**2 + 1"],
    "cot": ["-cot(u)**2 - 1"], "sec": ["tan(u)*sec(u)"], "csc": ["-cot(u)*csc(u)"],
    "asin": ["1/sqrt(1 - u**2)"], "acos": ["-1/sqrt(1 - u**2)"], "atan": ["1/(u**2 + 1)"],
    "sinh": ["cosh(u)"], "cosh": ["sinh(u)"], "tanh": ["1 - tanh(u)**2"],
    "coth": ["-csch(u)**2"], "sech": ["-tanh(u)*sech(u)"], "csch": ["-coth(u)*csch(u)"],
    "asinh": ["1/sqrt(u**2 + 1)"], "acosh": ["1/(sqrt(u - 1)*sqrt(u + 1))"],
    "atanh": ["1/(1 - u**2)"], "sinc": ["sinc_slope"], "Abs": ["sign"],
    "atan2": ["v/(u**2 + v**2)", "-u/(u**2 + v**2)"],
}  # fmt: skip


def _derivative(place: str, expression: Any, x: Any) -> Any:
    """The derivative by a symbol."""
    import sympy

    if not expression.args or x not in expression.free_symbols:
        return sympy.Integer(expression == x)
    parts = expression.args
    slopes = [_derivative(place, part, x) for part in parts]
    if expression.is_Add:
        return sympy.Add(*slopes)
    if expression.is_Mul:
        terms = (sympy.Mul(*parts[:i], s, *parts[i + 1 :]) for i, s in enumerate(slopes))
        return sympy.Add(*terms)
    if expression.is_Pow:
        b, e = parts
        if slopes[1] != 0:  # (e' log(b) + e b' / b) b**e
            return (slopes[1] * functions()["log"](b) + e * slopes[0] / b) * expression
        return e * slopes[0] * b ** (e - 1)  # as e b' b**e / b is nan at b = 0
    texts = _DERIVATIVES[expression.func.__name__]
    names = dict(zip("uv", parts, strict=False))
    names |= {text: functions()[text](*parts) for text in texts if text in functions()}
    outer = [parse(place, text, names) for text in texts]
    return sympy.Add(*(f * u for f, u in zip(outer, slopes, strict=True) if u != 0))


def _symbols(names: Names) -> tuple[dict[str, Any], dict[Any, str]]:
    """Symbols by name, and how the code writes them."""
    import sympy

    behind = (*names.inputs, *names.parameters)
    symbols = {name: sympy.Symbol(name, real=True) for name in (*names.states, *behind)}
    written = {symbols[name]: f"x[{i}]" for i, name in enumerate(names.states)}
    written |= {symbols[name]: f"parameters[{i}]" for i, name in enumerate(behind)}
    return symbols, written


def _codes(
    places: Sequence[str], expressions: Sequence[Any], written: Mapping[Any, str],
    texts: Sequence[str] | None = None,
) -> tuple[str, ...]:  # fmt: skip
    codes, operations = [], 0
    for i, (place, expression) in enumerate(zip(places, expressions, strict=True)):
        code, more = python_code(place, expression, written, texts[i] if texts else "")
        operations += more
        if operations > _MOST_OPERATIONS:
            problem = f"has {more} operations, in all there must be {_MOST_OPERATIONS} or fewer"
            raise InputError(place, problem)
        codes.append(code)
    return tuple(codes)
