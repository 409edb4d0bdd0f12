"""Right-hand sides of a model of text in a program: from the code that was compiled of them."""

from __future__ import annotations

import ast
import math
import operator
from typing import Any

from reobserve.codegen.expressions import Expression, Name, Number, call, times
from reobserve.codegen.program import Program
from reobserve.core.errors import InputError
from reobserve.systems.triangular import TriangularModel
from reobserve.systems.triangular_text import TextModel

_WRITTEN_OUT = 4  # powers up to this one are products
_SIGNS: dict[type, Any] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
}  # fmt: skip


def right_hand_sides(program: Program, model: TriangularModel) -> None:
    """The functions ``drift``, of the state, and ``input_gain``, of the output, of a program.

    Raises
    ------
    InputError
        If the model holds compiled functions alone, or text with cases.
    """
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


def expression(code: str, x: Name) -> Expression:
    """An expression of Python in ``x[0]``, ``x[1]`` and functions of ``math``, for a vector.

    Raises
    ------
    InputError
        If it has cases, as ``sinc`` has.
    """
    return _made(ast.parse(code, mode="eval").body, x)


def _made(part: ast.expr, x: Name) -> Expression:
    if isinstance(part, ast.Constant):
        return Number(float(part.value))  # type: ignore[arg-type]
    if isinstance(part, ast.Attribute):
        return Number(float(getattr(math, part.attr)))
    if isinstance(part, ast.Subscript):
        return x[int(ast.literal_eval(part.slice))]
    if isinstance(part, ast.UnaryOp):
        inner = _made(part.operand, x)
        return Number(-inner.value) if isinstance(inner, Number) else -inner
    if isinstance(part, ast.Call):
        assert isinstance(part.func, ast.Attribute)
        return call(part.func.attr, *(_made(one, x) for one in part.args))
    if isinstance(part, ast.BinOp):
        return _joined(part.op, _made(part.left, x), _made(part.right, x))
    raise InputError("observer", "of a model with sinc cannot be exported: write sin(x)/x")


def _joined(sign: ast.operator, left: Expression, right: Expression) -> Expression:
    if isinstance(sign, ast.Pow):
        power = right.value if isinstance(right, Number) else 0.0
        if isinstance(left, Name) and power in range(2, _WRITTEN_OUT + 1):
            written: Expression = left
            for _ in range(int(power) - 1):
                written = times(written, left)
            return written
        return call("pow", left, right)
    if isinstance(left, Number) and isinstance(right, Number):
        return Number(_SIGNS[type(sign)](left.value, right.value))
    if isinstance(sign, ast.Mult):  # in the order in which it is written
        negative = isinstance(left, Number) and left.value < 0
        product = times(Number(abs(left.value)) if isinstance(left, Number) else left, right)
        return -product if negative else product
    joined: Expression = _SIGNS[type(sign)](left, right)
    return joined
