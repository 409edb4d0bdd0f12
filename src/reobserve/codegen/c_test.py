"""A program in C that steps exported code through a record and compares it with the library."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from reobserve.codegen.c_code import STRICT_MATH, initialiser
from reobserve.codegen.program import Program

Array = NDArray[np.float64]

_TOLERANCE = 1e-12
COMPILE = "cc -std=c99 -Wall -Wextra -Wpedantic -Werror {name}.c {name}_test.c -lm"

_TEST = """\
/* Steps {name} through {rows} rows and compares its estimates with those of the library,
 * to {tolerance} of the largest of each. Returns 0 if they agree.
 *
 *     {compile}
 */
#include "{name}.h"

#include <float.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

{strict}
#define ROWS {rows}

{data}
/* 0 of a finite number, 1 of an infinity, 2 of nan: by the bits, whatever the flags. */
static int32_t kind(double number)
{{
    const uint64_t exponent = UINT64_C(0x7ff0000000000000);
    uint64_t bits;
    memcpy(&bits, &number, sizeof bits);
    bits &= ~(UINT64_C(1) << 63);
    return (bits > exponent) + (bits >= exponent);
}}

static double off(const double *found, const double *expected, int32_t size)
{{
    double most = 0.0;
    for (int32_t i = 0; i < size; ++i) {{
        if (kind(found[i]) != kind(expected[i])) {{
            return DBL_MAX;
        }}
        if (kind(found[i]) == 0) {{
            const double apart = fabs(found[i] - expected[i]);
            most = (apart > most) ? apart : most;
        }}
    }}
    return most;
}}

int main(void)
{{
    {name}_memory memory;
    {name}_estimate estimate;
    double worst[{count}] = {{0.0}};
    int32_t wrong = 0;

    {name}_start(&memory);
    for (int32_t k = 0; k < ROWS; ++k) {{
        double apart;
        if ({name}_step(&memory, y[k],{u} &estimate) != 0) {{
            printf("row %d: out of the range of numbers\\n", (int)k);
            return 2;
        }}
{compared}    }}
{reported}    return (int)wrong;
}}
"""


def test_source(
    program: Program, name: str, y: Array, u: Array, expected: Mapping[str, Array]
) -> str:
    """The text of the test: a record, shapes (k, p) and (k, m), and the estimates of its rows."""
    rows = len(y)
    data = [_array("y", y)]
    if program.inputs:
        data.append(_array("u", u))
    compared, reported = [], []
    for place, each in enumerate(program.estimates):
        values = np.asarray(expected[each], dtype=np.float64).reshape(rows, -1)
        data.append(_array(f"expected_{each}", values))
        shape = program.estimates[each].shape
        pointer = f"&estimate.{each}" + "[0]" * len(shape)
        compared.append(
            f"        apart = off({pointer}, expected_{each}[k], {values.shape[1]});\n"
            f"        worst[{place}] = (apart > worst[{place}]) ? apart : worst[{place}];\n"
        )
        least = program.least.get(each, 0.0)
        size = float(np.nanmax(np.abs(values), initial=least)) or 1.0
        reported.append(
            f'    printf("{each}: off by %.3g of at most {size:.3g}\\n", worst[{place}]);\n'
            f"    wrong |= !(worst[{place}] <= {_TOLERANCE} * {size!r});\n"
        )
    return _TEST.format(
        name=name, compile=COMPILE.format(name=name), rows=rows, tolerance=_TOLERANCE,
        strict=STRICT_MATH,
        data="\n".join(data), count=len(compared), u=" u[k]," if program.inputs else "",
        compared="".join(compared), reported="".join(reported),
    )  # fmt: skip


def _array(name: str, values: Array) -> str:
    rows = ",\n    ".join(map(initialiser, values))
    return f"static const double {name}[ROWS][{values.shape[1]}] = {{\n    {rows}\n}};\n"
