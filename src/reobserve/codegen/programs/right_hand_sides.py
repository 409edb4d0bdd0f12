"""Right-hand sides of a model of text in a program: from the code that was compiled of them."""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable
from typing import Any

from reobserve.codegen.expressions import Elementwise, Expression, Name, Number, call
from reobserve.codegen.program import Program
from reobserve.core.errors import InputError
from reobserve.systems.triangular import TriangularModel
from reobserve.systems.triangular_text import TextModel

_WRITTEN_OUT = 16  # powers up to this one are products

# What stands at an index of an array of the code, by its name.
Entry = Callable[[str, int], Expression]
_SIGNS: dict[type, Any] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.Gt: lambda *sides: Elementwise("({} > {})", sides),
    ast.Lt: lambda *sides: Elementwise("({} < {})", sides),
    ast.NotEq: lambda *sides: Elementwise("({} != {})", sides),
}  # fmt: skip


def right_hand_sides(program: Program, model: TriangularModel) -> None:
    """The functions ``drift``, of the state, and ``input_gain``, of the output, of a program."""
    if not isinstance(model, TextModel):
        raise InputError(
            "observer",
            "of a model of compiled functions cannot be exported, as no text is left of them; "
            "reobserve.systems.triangular_text.triangular_model keeps its text",
        )
    x, f = program.local("at", (model.states,)), program.local("drift_out", (model.states,))
    with program.function("drift", (x,), f):
        for i, code in enumerate(model.drift_code):
            program.let(f[i], expression(code, x))
    y, gain = program.local("output", (1,)), program.local("gain_out", (1,))
    with program.function("input_gain", (y,), gain):
        program.let(gain[0], expression(model.gain_code, y))


def expression(code: str, x: Name | Entry) -> Expression:
    """An expression of Python in arrays and functions of ``math``, for a vector or by `Entry`."""
    entry = (lambda _, index: x[index]) if isinstance(x, Name) else x
    return _made(ast.parse(code, mode="eval").body, entry)


def _made(part: ast.expr, entry: Entry) -> Expression:
    if isinstance(part, ast.Constant | ast.Attribute):
        value: Any = part.value if isinstance(part, ast.Constant) else getattr(math, part.attr)
        return Number(float(value))
    if isinstance(part, ast.Subscript):
        assert isinstance(part.value, ast.Name)
        return entry(part.value.id, int(ast.literal_eval(part.slice)))
    if isinstance(part, ast.UnaryOp):
        inner = _made(part.operand, entry)
        return Number(-inner.value) if isinstance(inner, Number) else -inner
    if isinstance(part, ast.Call):
        name = part.func.attr if isinstance(part.func, ast.Attribute) else "fabs"
        return call(name, *(_made(argument, entry) for argument in part.args))
    if isinstance(part, ast.IfExp):  # of sinc
        three = (part.test, part.body, part.orelse)
        return Elementwise("({} ? {} : {})", tuple(_made(one, entry) for one in three))
    if isinstance(part, ast.Compare):
        part = ast.BinOp(part.left, part.ops[0], part.comparators[0])  # type: ignore[arg-type]
    assert isinstance(part, ast.BinOp)
    return _joined(part.op, _made(part.left, entry), _made(part.right, entry))


def _joined(sign: ast.operator, left: Expression, right: Expression) -> Expression:
    if isinstance(sign, ast.Pow):
        power = right.value if isinstance(right, Number) else 0.0
        if isinstance(left, Name) and power in range(2, _WRITTEN_OUT + 1):
            return _power(left, int(power))
        return call("pow", left, right)
    compared = isinstance(sign, ast.cmpop)
    if isinstance(left, Number) and isinstance(right, Number) and not compared:
        return Number(_SIGNS[type(sign)](left.value, right.value))
    if isinstance(sign, ast.Mult):  # in the order in which it is written
        negative = isinstance(left, Number) and left.value < 0
        product = _product(Number(abs(left.value)) if isinstance(left, Number) else left, right)
        return -product if negative else product
    joined: Expression = _SIGNS[type(sign)](left, right)
    return joined


def _power(base: Expression, power: int) -> Expression:
    """A product by squares, as numba compiles it."""
    product: Expression | None = None
    while power:
        if power & 1:
            product = base if product is None else _product(base, product)
        base, power = _product(base, base), power >> 1
    assert product is not None
    return product


def _product(left: Expression, right: Expression) -> Expression:
    whole = isinstance(right, Elementwise) and not right.call  # a product or a quotient
    return Elementwise("{} * ({})" if whole else "{} * {}", (left, right))
