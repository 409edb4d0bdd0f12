"""A program as C99: a header and a source, without allocation, recursion or global variables."""

from __future__ import annotations

import re
from textwrap import wrap

import numpy as np
from numpy.typing import NDArray

from reobserve.codegen.expressions import Name, Shape
from reobserve.codegen.program import WIDTH, Block, Function, Program, margins

Array = NDArray[np.float64]

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

#ifdef __cplusplus
extern "C" {{
#endif

#define {upper}_SAMPLING_PERIOD {period}    /* [s] */

/* What the observer remembers from row to row. */
typedef struct {{
{memory}}} {name}_memory;

/* What it estimates at a row. */
typedef struct {{
{estimate}}} {name}_estimate;

void {name}_start({name}_memory *memory);

{arguments}
{missing}
 * Returns 0, or 1 if the observer has left the range of numbers: then start it again. */
int32_t {name}_step({name}_memory *memory, const double y[{p}],{u}
    {name}_estimate *estimate);

#ifdef __cplusplus
}}
#endif

#endif
"""

# What is compiled with these takes nan for a number: results are wrong, and no test can tell.
STRICT_MATH = """\
#if defined(__FAST_MATH__) || defined(_M_FP_FAST)
#error "compile without -ffast-math, -Ofast or /fp:fast: this code needs nan and infinity"
#endif
#if defined(__FINITE_MATH_ONLY__) && (__FINITE_MATH_ONLY__ + 0)
#error "compile without -ffinite-math-only: this code needs nan and infinity"
#endif
"""

_MISSING = (
    "A nan in y says that this number was not measured: the estimate goes on without it.",
    "Every number of y must be finite: after a nan or an infinity the observer has left the range "
    "of numbers.",
)

_SOURCE = """\
/* {title} */
#include "{name}.h"

#include <math.h>

{strict}
{constants}{functions}void {name}_start({name}_memory *memory)
{{
{start}}}

int32_t {name}_step({name}_memory *memory, const double y[{p}],{u}
    {name}_estimate *estimate)
{{
{step}}}
"""

_MOST_ASSIGNED = 60  # numbers of a memory; more are copied from a table


def header(
    program: Program, name: str, signals: tuple[str, str], about: str, period: float,
    missing: bool = False,
) -> str:  # fmt: skip
    """The header, in which ``signals`` say what the columns of y and u are.

    ``missing`` says whether a nan in y stands for what was not measured.
    """
    text = f"y: {signals[0]}" + (f"; u: {signals[1]}" if program.inputs else "")
    arguments = "\n".join(wrap(text, WIDTH, initial_indent="/* ", subsequent_indent=" *   "))
    return _HEADER.format(
        title=program.title, name=name, guard=f"{name.upper()}_H", upper=name.upper(),
        about="\n".join(wrap(about, WIDTH, initial_indent=" * ", subsequent_indent=" *   ")),
        and_inputs=" and inputs" if program.inputs else "", arguments=arguments,
        missing="\n".join(
            wrap(_MISSING[not missing], WIDTH, initial_indent=" * ", subsequent_indent=" * ")
        ),
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
    functions = "".join(map(_function, program.functions))
    constants = dict(program.constants)
    for each, variable in program.memory.items():
        if variable.initial.size > _MOST_ASSIGNED:
            constants[f"{each}_at_start"] = variable.initial
    return _SOURCE.format(
        title=program.title, name=name, p=program.measurements, u=_u(program), strict=STRICT_MATH,
        constants="".join(
            f"static const double {each}{_size(values.shape)} = {literal(values)};\n"
            for each, values in constants.items()
        )
        + "\n",
        functions=functions, start=_start(program), step=_step(program),
    )  # fmt: skip


def literal(values: Array) -> str:
    """A number or nested braces, with NAN of math.h for what is not a number."""
    if values.ndim == 0:
        return "NAN" if np.isnan(values) else repr(float(values))
    inner = ", ".join(map(literal, values))
    if values.ndim == 1 or len(inner) < 80:
        return f"{{{inner}}}"
    rows = ",\n    ".join(map(literal, values))
    return f"{{\n    {rows}}}"


def _u(program: Program) -> str:
    return f" const double u[{program.inputs}]," if program.inputs else ""


def _size(shape: Shape) -> str:
    return "".join(f"[{size}]" for size in shape)


def _function(function: Function) -> str:
    # C99 makes no array of arrays constant by handing it over.
    arguments = ", ".join(
        f"{'const ' if len(each.shape) < 2 else ''}double {each.name}{_size(each.shape)}"
        for each in function.arguments
    )
    result = f"double {function.result.name}{_size(function.result.shape)}"
    lines = "".join(function.block.lines)
    unread = [each.name for each in function.arguments if not re.search(rf"\b{each.name}\b", lines)]
    ignored = "".join(f"    (void){name};\n" for name in unread)
    head = wrap(f"static void {function.name}({arguments}, {result})", WIDTH, **margins(""))
    text = "\n".join(head)
    return f"{text}\n{{\n{_variables(function.block)}{ignored}{lines}}}\n\n"


def _start(program: Program) -> str:
    lines = Program("", 0, 0)
    for name, part in program.memory.items():
        whole = Name(f"memory->{name}", part.initial.shape)
        if part.initial.size > _MOST_ASSIGNED:
            lines.let(whole, Name(f"{name}_at_start", whole.shape))
            continue
        for index in np.ndindex(part.initial.shape):
            value = part.initial[index]
            lines.line(f"{whole[index]} = {int(value) if part.counter else literal(value)};")
    return "".join(lines.body.lines)


def _step(program: Program) -> str:
    lines, finite = Program("", 0, 0), Name("finite")
    for name, part in program.memory.items():
        if not part.counter:
            with lines.entries(part.initial.shape) as at:
                lines.line(f"{finite} += {Name(f'memory->{name}')[at]};")
    declared = f"{_variables(program.body)}    double {finite} = 0.0;\n\n"
    checked = f"\n{''.join(lines.body.lines)}    return isfinite({finite}) ? 0 : 1;\n"
    return declared + "".join(program.body.lines) + checked


def _variables(block: Block) -> str:
    return "".join(
        f"    double {name}{_size(shape)}{'' if shape else ' = 0.0'};\n"
        for name, shape in block.variables.items()
    )
