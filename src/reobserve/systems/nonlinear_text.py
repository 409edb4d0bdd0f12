"""Expressions of nonlinear models, and their derivatives, as code to compile."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache, lru_cache
from typing import Any, NamedTuple

from reobserve.core.errors import InputError, shown
from reobserve.core.extras import package
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
            derivatives.append(_derivative(expression, symbols[state]))
            places.append(f"d {name}[{i}] / d {state}")
    return _codes(places, derivatives, written)


def _derivative(expression: Any, x: Any) -> Any:
    """The derivative by x, with e b' b**(e - 1) for that of b**e where e is not of x.

    sympy writes e b' b**e / b, which is nan at b = 0, and a derivative of sinc that is nan at 0.
    That of abs is the sign, 0 at 0; that of atan2 is nan where both arguments are 0.
    """
    import sympy

    power, sinc, absolute = _own()
    pairs = expression.replace(
        lambda term: term.is_Pow and not term.exp.is_number and not term.exp.has(x),
        lambda term: power(*term.args),
    )
    slope = pairs.replace(sympy.sinc, sinc).replace(sympy.Abs, absolute).diff(x)
    slope = slope.replace(power, sympy.Pow).replace(sinc, sympy.sinc)
    return slope.replace(absolute, sympy.Abs)


@cache
def _own() -> tuple[Any, Any, Any]:
    """Powers, sinc and abs as real functions with other derivatives than those of sympy."""
    import sympy

    class Real(sympy.Function):  # type: ignore[misc]
        is_real = True

    class Power(Real):
        def fdiff(self, argindex: int = 1) -> Any:
            base, exponent = self.args
            return exponent * Power(base, exponent - 1)

    class Sinc(Real):
        def fdiff(self, argindex: int = 1) -> Any:
            (x,) = self.args
            slope = (sympy.cos(x) - sympy.sin(x) / x) / x
            return sympy.Piecewise((slope, sympy.Ne(x, 0)), (0, True))

    class Absolute(Real):
        def fdiff(self, argindex: int = 1) -> Any:
            return sympy.sign(self.args[0])

    return Power, Sinc, Absolute


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
