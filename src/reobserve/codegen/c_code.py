"""A program as C99: a header and a source, without allocation, recursion or global variables."""

from __future__ import annotations

from collections.abc import Iterable
from textwrap import wrap

import numpy as np
from numpy.typing import NDArray

from reobserve.codegen.program import Program
from reobserve.codegen.statements import WIDTH
from reobserve.codegen.values import Storage, literal

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

{step}"""

_STEP = """\
int32_t {name}_step({name}_memory *memory, const double y[{p}],{u}
    {name}_estimate *estimate)
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
        memory=_fields(program.code.storages["memory"]),
        estimate=_fields(program.code.storages["estimate"]),
    )  # fmt: skip


def source(program: Program, name: str) -> str:
    """The source that goes with the header."""
    code, (start, tables) = program.code, _start(program)
    work = _fields(code.storages["work"])
    structures = {
        "memory": f"{name}_memory", "work": f"{name}_work", "estimate": f"{name}_estimate",
        "y": "const double", "u": "const double",
    }  # fmt: skip
    head = _STEP.format(name=name, p=program.measurements, u=_u(program))
    functions, step = code.functions(structures, head)
    if work:
        functions = f"typedef struct {{\n{work}}} {name}_work;\n\n{functions}"
    for one in code.storages["constant"]:
        assert one.data is not None
        tables += _table(one.name, one.data, one.kind)
    return _SOURCE.format(
        title=program.title, name=name, strict=STRICT_MATH,
        constants=f"{tables}\n", functions=functions, start=start,
        step=step.rstrip("\n") + "\n",
    )  # fmt: skip


def initialiser(values: Array) -> str:
    """Numbers in nested braces, or one."""
    if values.ndim == 0:
        return literal(values.item())
    inner = ", ".join(map(initialiser, values))
    if values.ndim == 1 or len(inner) < 80:
        return f"{{{inner}}}"
    rows = ",\n    ".join(map(initialiser, values))
    return f"{{\n    {rows}}}"


def _table(name: str, values: Array, kind: str = "double") -> str:
    return f"static const {kind} {name}{_size(values.shape)} = {initialiser(values)};\n"


def _fields(storages: list[Storage]) -> str:
    return "".join(
        f"    {one.kind} {one.name}{'' if one.scalar else _size(one.shape)};\n" for one in storages
    )


def _u(program: Program) -> str:
    return f" const double u[{program.inputs}]," if program.inputs else ""


def _size(shape: Iterable[int | str]) -> str:
    return "".join(f"[{size}]" for size in shape)


def _start(program: Program) -> tuple[str, str]:
    """The statements that assign the memory its start, and tables of what is large."""
    lines, tables = "", ""
    for storage in program.code.storages["memory"]:
        values = np.asarray(program.memory[storage.name]).reshape(storage.shape)
        if values.size <= _MOST_ASSIGNED:
            for place in np.ndindex(values.shape):
                entry = storage.path + ("" if storage.scalar else _size(place))
                lines += f"    {entry} = {literal(values[place].item())};\n"
            continue
        table, index = f"{storage.name}_at_start", "ijkl"[: values.ndim]
        tables += _table(table, values)
        pairs = zip(index, values.shape, strict=True)
        rows = [f"for (int32_t {i} = 0; {i} < {size}; ++{i}) {{" for i, size in pairs]
        rows += [f"{storage.path}{_size(index)} = {table}{_size(index)};", *["}"] * len(index)]
        depths = (*range(len(index) + 1), *reversed(range(len(index))))
        lines += "".join(f"    {'    ' * d}{row}\n" for d, row in zip(depths, rows, strict=True))
    return lines, tables
