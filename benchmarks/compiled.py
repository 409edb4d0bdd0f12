"""The C peer: compiled when needed, by the compiler of this machine, and called directly."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# The compiled library knows the processor it runs on, so C may know it, too. Contraction would
# round differently from the library, whose rules exclude it.
STRICT = ("-O3", "-std=c11", "-ffp-contract=off")
TUNED = "-march=native"
_SHARED = ("-shared", "-fPIC")

_Doubles = ctypes.POINTER(ctypes.c_double)


class _Constants(ctypes.Structure):
    _fields_ = [
        *((name, ctypes.c_double * 9) for name in ("J", "inverse", "L", "B", "Bf", "K1", "K2")),
        ("step", ctypes.c_double),
    ]


class _Record(ctypes.Structure):
    _fields_ = [(name, _Doubles) for name in ("rate", "rate_before", "control", "control_before")]


@dataclass(frozen=True)
class Compiled:
    """The C library and how it was made."""

    library: ctypes.CDLL
    command: str

    def function(self, law: str) -> Any:
        """The loop of a law: ``continuous``, ``sampled`` or ``adaptive``."""
        function = self.library[law]
        function.restype = ctypes.c_long
        function.argtypes = [
            ctypes.POINTER(_Constants),
            _Record,
            ctypes.c_long,
            ctypes.c_long,
            *(_Doubles,) * 5,
        ]
        return function


def compile_c(
    source: str = "ilo.c", choices: Sequence[tuple[str, ...]] = ((*STRICT, TUNED), STRICT)
) -> Compiled | None:
    """The C peer from a source file beside this one, or None where there is no compiler.

    Of the choices of flags, the first that the compiler takes counts.
    """
    with tempfile.TemporaryDirectory() as folder:
        built = Path(folder) / "peer.so"
        for flags in choices:
            command = build_c(source, flags, built)
            if command is not None:
                # The loaded library outlives its file.
                return Compiled(ctypes.CDLL(str(built)), command)
    return None


def build_c(source: str, flags: Sequence[str], built: Path) -> str | None:
    """Compile a source file beside this one to a file; the command, or None if that fails."""
    compiler = shutil.which(os.environ.get("CC", "cc")) or shutil.which("gcc")
    if compiler is None:
        return None
    where = str(Path(__file__).with_name(source))
    command = [compiler, *flags, *_SHARED, where, "-o", str(built), "-lm"]
    if subprocess.run(command, capture_output=True, check=False).returncode:
        return None
    return " ".join((Path(compiler).name, *flags))


def constants(parts: tuple[Any, ...]) -> _Constants:
    """The library's constants (seven matrices and the step) as C reads them."""
    matrices = [(ctypes.c_double * 9)(*np.asarray(part).ravel()) for part in parts[:-1]]
    return _Constants(*matrices, parts[-1])


def pointer(array: Array) -> Any:
    """Where the numbers of a contiguous array are."""
    assert array.flags.c_contiguous
    return array.ctypes.data_as(_Doubles)


def record(rate: Array, control: Array) -> _Record:
    """A record without jumps: the limits from the left are the samples themselves."""
    return _Record(pointer(rate), pointer(rate), pointer(control), pointer(control))
