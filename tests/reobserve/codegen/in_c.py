"""Functions of the subset that is translated, compiled by the compiler of C and called."""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.codegen import c_code
from reobserve.codegen.program import Program, leaves
from reobserve.core.direct_call import call
from reobserve.systems.text_functions import compiled_rows

Array = NDArray[Any]


def in_c(function: Any, x: Array, out: Array, *more: Any) -> Callable[[Array], Array]:
    """``function(x, out, *more)``, which writes ``out`` and returns 0 or 1, as a function of x."""
    arguments = (x, out, *more)
    program = Program(
        "Test", function, arguments, x, np.empty(0), {}, {"out": out}, leaves(more=more)
    )
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "f.h").write_text(
            c_code.header(program, "f", ("", ""), "", 1.0), encoding="utf-8"
        )
        Path(folder, "f.c").write_text(c_code.source(program, "f"), encoding="utf-8")
        flags = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Wno-unused-parameter", "-Werror"]
        flags += ["-ffp-contract=off", "-shared", "-fPIC", "-o", "f.so"]
        subprocess.run(["cc", *flags, "f.c", "-lm"], check=True, cwd=folder)
        step = ctypes.CDLL(f"{folder}/f.so").f_step

    def called(values: Array) -> Array:
        found = np.full(out.shape, np.nan)
        given = np.ascontiguousarray(values, dtype=np.float64)
        assert step(None, *(one.ctypes.data_as(ctypes.c_void_p) for one in (given, found))) == 0
        return found

    return called


def rows_in_c(rows: Sequence[str], size: int) -> Callable[[Array], Array]:
    """The values of expressions in x[0], x[1] and functions of ``math``."""
    field = SimpleNamespace(pickled=(compiled_rows, (tuple(rows),)))
    return in_c(_values, np.empty(size), np.empty(len(rows)), field, np.empty(0))


def _values(x: Array, out: Array, field: Any, parameters: Array) -> int:
    call(field, (x, parameters, out))
    return 0
