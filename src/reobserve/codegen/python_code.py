"""A program as Python that imports nothing but ``math``."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator
from pprint import pformat
from textwrap import wrap

import numpy as np
from numpy.typing import NDArray

from reobserve.codegen.expressions import Shape
from reobserve.codegen.lowering import Block, Branch, Line, Loop, Lowered
from reobserve.codegen.naming import function_block, places, replaced, step_block
from reobserve.codegen.statements import Function, Program

Array = NDArray[np.float64]

_WIDTH = 100

_MODULE = '''\
"""{title}.

{about}

    observer = Observer()
    estimate = observer.step(y{and_u})     # for each row
    estimate["{first}"]
"""

{imported}SAMPLING_PERIOD = {period}  # [s]

{constants}

{helpers}{functions}class Observer:
    """All that is remembered from row to row."""

    def __init__(self):
{start}
    def step(self, y{and_u}):
        """The estimates at a row, by name.

        {arguments}
        """
        estimate = {{}}
{step}        return estimate
'''

# What C has and Python lacks, or has otherwise.
_HELPERS = {
    "log": '''\
def log(x):
    """The logarithm, which of zero is minus infinity."""
    return math.log(x) if x > 0.0 else (-math.inf if x == 0.0 else math.nan)


''',
    "whole": '''\
def whole(value):
    """A whole number as an index."""
    return int(value)


''',
    "fmax": '''\
def fmax(a, b):
    """The larger of two."""
    return a if a > b else b


''',
}
_CALLED = re.compile(r"\b([a-z]\w*)\(|\bNAN\b")
_DEFINED = re.compile(r"^def (\w+)", re.MULTILINE)


def module(program: Program, signals: tuple[str, str], about: str, period: float) -> str:
    """The text of the module; ``signals`` say what the columns of y and u are."""
    told = f"y: {signals[0]}" + (f"; u: {signals[1]}" if program.inputs else "")
    functions = "".join(
        _function(function, function_block(program, function)) for function in program.functions
    )
    start = "".join(
        f"        self.{name} = {_literal(part.initial, part.counter)}\n"
        for name, part in program.memory.items()
    )
    step = "".join(_step(program))
    imported, helpers = _provided(functions + start + step)
    return _MODULE.format(
        title=program.title, about="\n".join(wrap(about, _WIDTH)),
        and_u=", u" if program.inputs else "", first=next(iter(program.estimates)),
        period=repr(period), arguments="\n        ".join(wrap(told, _WIDTH - 8)),
        constants="".join(
            f"{name} = {pformat(part.values.tolist(), width=96)}\n"
            for name, part in program.constants.items()
        ),
        imported=imported, helpers=helpers, functions=functions, start=start, step=step,
    )  # fmt: skip


def _provided(code: str) -> tuple[str, str]:
    """The imports of what the code calls, and the helpers among it."""
    called = {found[1] or "NAN" for found in _CALLED.finditer(code)}
    helpers = "".join(text for name, text in _HELPERS.items() if name in called)
    own = {*_HELPERS, *_DEFINED.findall(code)}
    names = [name for name in sorted(called - own) if hasattr(math, name)]
    names += ["nan as NAN"] if "NAN" in called else []
    imported = "import math\n" if "math." in helpers else ""
    imported += f"from math import {', '.join(names)}\n" if names else ""
    return f"{imported}\n" if imported else "", helpers


def _literal(values: Array, counter: bool) -> str:
    if counter:
        return repr(int(values))
    told = pformat(values.tolist(), width=80).replace("\n", "\n" + 12 * " ")
    return told.replace("nan", "NAN")


def _empty(shape: Shape) -> str:
    if not shape:
        return "0.0"
    inner = _empty(shape[1:])
    return f"[0.0] * {shape[0]}" if len(shape) == 1 else f"[{inner} for _ in range({shape[0]})]"


def _function(function: Function, block: Block) -> str:
    given = ", ".join(one.name for one in (*function.arguments, function.result))
    body = "".join((*_variables(block, 1), *_printed(block.lines, {}, 1)))
    return f"def {function.name}({given}):\n{body}\n\n"


def _step(program: Program) -> Iterator[str]:
    named = places(program, "self.", "")
    for name, part in program.estimates.items():
        named[f"estimate_{name}"] = f'estimate["{name}"]'
        yield f'        estimate["{name}"] = {_empty(part.initial.shape)}\n'
    block = step_block(program)
    yield from _variables(block, 2)
    yield from _printed(block.lines, named, 2)


def _variables(block: Block, depth: int) -> Iterator[str]:
    for name, shape in block.variables.items():
        yield f"{'    ' * depth}{name} = {_empty(shape)}\n"


def _printed(lines: Iterable[Lowered], named: dict[str, str], depth: int) -> Iterator[str]:
    space = "    " * depth
    for line in lines:
        if isinstance(line, Line):
            yield from _line(replaced(line.text, named), space)
        elif isinstance(line, Loop):
            span = line.end if line.first == "0" else f"{line.first}, {line.end}"
            yield f"{space}for {line.variable} in range({span}):\n"
            yield from _printed(line.body, named, depth + 1)
        elif isinstance(line, Branch):
            yield f"{space}if {replaced(line.condition, named)}:\n"
            yield from _printed(line.then, named, depth + 1)
            if line.otherwise:
                yield f"{space}else:\n"
                yield from _printed(line.otherwise, named, depth + 1)


def _line(told: str, space: str) -> Iterator[str]:
    """A line, in parentheses on several if it is long."""
    if len(told) + len(space) <= _WIDTH:
        yield f"{space}{told}\n"
        return
    target, equals, value = told.partition(" = ")
    yield f"{space}{target}{equals}(\n"
    for part in wrap(
        value, _WIDTH - len(space) - 4, break_long_words=False, break_on_hyphens=False
    ):
        yield f"{space}    {part}\n"
    yield f"{space})\n"
