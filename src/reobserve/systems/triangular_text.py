"""Triangular models from text: the right-hand sides as one would write them down."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from reobserve.core.errors import InputError, shown
from reobserve.core.extras import package
from reobserve.systems.text_functions import compiled_rows, python_code, read_expression
from reobserve.systems.triangular import TriangularModel

_MOST_OPERATIONS = 1000  # of all right-hand sides: compiling takes some milliseconds for each


def triangular_model(
    variables: Sequence[str], drift: Sequence[str], input_gain: str
) -> TriangularModel:
    """The model x' = Lambda x + f(x) + (0, ..., 0, G(y))^T u, in the grammar of power series.

    Parameters
    ----------
    variables
        Names of the n states; the first one is the output.
    drift
        f, n texts; that of state i may name the first i variables.
    input_gain
        G, a text that may name the first variable.

    Examples
    --------
    >>> from reobserve.systems.triangular_text import triangular_model
    >>> pendulum = triangular_model(["a", "w"], drift=["0", "-20*sin(a) - w/2"], input_gain="20")
    >>> print(pendulum.states)
    2
    """
    sympy = package("sympy", "read expressions")
    for name, given in (("variables", variables), ("drift", drift)):
        good = isinstance(given, list | tuple) and all(isinstance(each, str) for each in given)
        if not good or not given:
            raise InputError(name, f"{shown(given)} must be a list of texts")
    if not all(each.isidentifier() for each in variables) or len(set(variables)) < len(variables):
        raise InputError("variables", f"{shown(list(variables))} must be different names")
    if len(drift) != len(variables):
        problem = f"has {len(drift)} texts, must have {len(variables)}, one a variable"
        raise InputError("drift", problem)
    if not isinstance(input_gain, str):
        raise InputError("input_gain", f"{shown(input_gain)} must be a text")
    symbols = {name: sympy.Symbol(name, real=True) for name in variables}
    written = {symbol: f"x[{i}]" for i, symbol in enumerate(symbols.values())}
    rows, operations = [], 0
    places = [f"drift[{i}]" for i in range(len(drift))] + ["input_gain"]
    for i, (place, text) in enumerate(zip(places, [*drift, input_gain], strict=True)):
        allowed = variables[: i + 1 if i < len(drift) else 1]
        expression = read_expression(place, text, symbols, allowed)
        code, more = python_code(place, expression, written, text)
        operations += more
        if operations > _MOST_OPERATIONS:
            problem = f"has {more} operations, in all there must be {_MOST_OPERATIONS} or fewer"
            raise InputError(place, problem)
        rows.append(code)
    *rows, gain = rows
    f, G = compiled_rows(tuple(rows)), compiled_rows((gain,))
    return TriangularModel(len(variables), f, G, np.zeros(0))
