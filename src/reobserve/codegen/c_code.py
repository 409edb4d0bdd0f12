"""A program as C99: a header and a source, without allocation, recursion or global variables."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from textwrap import wrap
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.codegen.expressions import Shape
from reobserve.codegen.lowering import Block, Branch, Line, Loop, Lowered, nest
from reobserve.codegen.naming import function_block, places, replaced, step_block
from reobserve.codegen.statements import Function, Program

Array = NDArray[np.float64]

_WIDTH = 100

_HEADER = """\
/* {title}
 *
{about}
 *
 * Call {name}_start once, then {name}_step for each row of measurements{and_inputs}.
 * No memory is allocated; loops have fixed bounds; numbers are doubles.
 */
#ifndef {guard}
#define {guard}

#include <stdint.h>

#define {upper}_SAMPLING_PERIOD {period}    /* [s] */

/* What the observer remembers from row to row. */
typedef struct {{
{memory}}} {name}_memory;

/* What it estimates at a row. */
typedef struct {{
{estimate}}} {name}_estimate;

void {name}_start({name}_memory *memory);

{arguments}
 * Returns 0, or 1 if the observer has left the range of numbers: then start it anew. */
int32_t {name}_step({name}_memory *memory, const double y[{p}],{u}
    {name}_estimate *estimate);

#endif
"""

_SOURCE = """\
/* {title} */
#include "{name}.h"

#include <math.h>

{constants}{functions}void {name}_start({name}_memory *memory)
{{
{start}}}

int32_t {name}_step({name}_memory *memory, const double y[{p}],{u}
    {name}_estimate *estimate)
{{
{step}}}
"""

_MOST_ASSIGNED = 60  # numbers of a memory; more are copied from a table
_WHOLE = """\
static int32_t whole(const double value)
{
    return (int32_t)value;
}

"""


def header(program: Program, name: str, signals: tuple[str, str], about: str, period: float) -> str:
    """The header; ``signals`` say what the columns of y and u are."""
    told = f"y: {signals[0]}" + (f"; u: {signals[1]}" if program.inputs else "")
    arguments = "\n".join(wrap(told, _WIDTH, initial_indent="/* ", subsequent_indent=" *   "))
    return _HEADER.format(
        title=program.title, name=name, guard=f"{name.upper()}_H", upper=name.upper(),
        about="\n".join(wrap(about, _WIDTH, initial_indent=" * ", subsequent_indent=" *   ")),
        and_inputs=" and inputs" if program.inputs else "", arguments=arguments,
        period=repr(period), p=program.measurements, u=_u(program),
        memory="".join(
            f"    {'int32_t' if part.counter else 'double'} {each}{_size(part.initial.shape)};\n"
            for each, part in program.memory.items()
        ),
        estimate="".join(
            f"    double {each}{_size(part.initial.shape)};\n"
            for each, part in program.estimates.items()
        ),
    )  # fmt: skip


def source(program: Program, name: str) -> str:
    """The source that goes with the header."""
    used = [function_block(program, function) for function in program.functions]
    functions = "".join(map(_function, program.functions, used))
    step = "".join(_step(program))
    constants = {each: part.values for each, part in program.constants.items()}
    for each, kept in program.memory.items():
        if kept.initial.size > _MOST_ASSIGNED:
            constants[f"{each}_at_start"] = kept.initial
    return _SOURCE.format(
        title=program.title, name=name, p=program.measurements, u=_u(program),
        constants="".join(
            f"static const double {each}{_size(values.shape)} = {literal(values)};\n"
            for each, values in constants.items()
        )
        + "\n",
        functions=(_WHOLE if "whole(" in functions + step else "") + functions,
        start="".join(_starts(program)), step=step,
    )  # fmt: skip


def literal(values: Array) -> str:
    """A number or nested braces; not a number is NAN, which math.h defines."""
    if values.ndim == 0:
        return "NAN" if np.isnan(values) else repr(float(values))
    inner = ", ".join(map(literal, values))
    return f"{{{inner}}}" if values.ndim == 1 or len(inner) < 80 else _broken(values)


def _broken(values: Array) -> str:
    rows = ",\n    ".join(map(literal, values))
    return f"{{\n    {rows}}}"


def _u(program: Program) -> str:
    return f" const double u[{program.inputs}]," if program.inputs else ""


def _size(shape: Shape) -> str:
    return "".join(f"[{size}]" for size in shape)


def _function(function: Function, block: Block) -> str:
    # C99 makes no array of arrays constant by handing it over.
    given = ", ".join(
        f"{'const ' if len(one.shape) < 2 else ''}double {one.name}{_size(one.shape)}"
        for one in function.arguments
    )
    result = f"double {function.result.name}{_size(function.result.shape)}"
    lines = list(_printed(block.lines, {}, 1))
    unread = [one.name for one in function.arguments if not _is_read(one.name, lines)]
    body = "".join((*_variables(block), *(f"    (void){name};\n" for name in unread), *lines))
    head = wrap(f"static void {function.name}({given}, {result})", _WIDTH, **_margins(""))
    told = "\n".join(head)
    return f"{told}\n{{\n{body}}}\n\n"


def _is_read(name: str, lines: list[str]) -> bool:
    return any(re.search(rf"\b{name}\b", line) for line in lines)


def _starts(program: Program) -> Iterator[str]:
    for name, part in program.memory.items():
        if part.initial.size > _MOST_ASSIGNED:
            copy = f"memory->{name}{{at}} = {name}_at_start{{at}}"
            yield from _printed(_each(copy, part.initial.shape), {}, 1)
            continue
        for index in np.ndindex(part.initial.shape):
            place, value = "".join(f"[{one}]" for one in index), part.initial[index]
            begun = str(int(value)) if part.counter else literal(value)
            yield f"    memory->{name}{place} = {begun};\n"


def _step(program: Program) -> Iterator[str]:
    block, named = step_block(program), places(program, "memory->", "estimate->")
    yield from _variables(block)
    yield "    double finite = 0.0;\n\n"
    yield from _printed(block.lines, named, 1)
    yield "\n"
    for name, part in program.memory.items():
        if not part.counter:
            yield from _printed(_each(f"finite += memory->{name}{{at}}", part.initial.shape), {}, 1)
    yield "    return isfinite(finite) ? 0 : 1;\n"


def _each(line: str, shape: Shape) -> list[Lowered]:
    return list(nest(shape, lambda at: [Line(line.format(at=at))]))


def _variables(block: Block) -> Iterator[str]:
    for name, shape in block.variables.items():
        yield f"    double {name}{_size(shape)}{'' if shape else ' = 0.0'};\n"


def _margins(space: str) -> dict[str, Any]:
    return {
        "initial_indent": space, "subsequent_indent": f"{space}    ", "break_long_words": False,
        "break_on_hyphens": False,
    }  # fmt: skip


def _printed(lines: Iterable[Lowered], named: dict[str, str], depth: int) -> Iterator[str]:
    space = "    " * depth
    for line in lines:
        if isinstance(line, Line):
            told = f"{'double ' if line.declares else ''}{replaced(line.text, named)};"
            yield from (f"{part}\n" for part in wrap(told, _WIDTH, **_margins(space)))
        elif isinstance(line, Loop):
            v = line.variable
            yield f"{space}for (int32_t {v} = {line.first}; {v} < {line.end}; ++{v}) {{\n"
            yield from _printed(line.body, named, depth + 1)
            yield f"{space}}}\n"
        elif isinstance(line, Branch):
            yield f"{space}if ({replaced(line.condition, named)}) {{\n"
            yield from _printed(line.then, named, depth + 1)
            if line.otherwise:
                yield f"{space}}} else {{\n"
                yield from _printed(line.otherwise, named, depth + 1)
            yield f"{space}}}\n"
