"""Other processors, emulated on this one: which code paths the libraries are told to take.

numpy, its BLAS, the compiler of the loops and the C library each choose machine code by what the
processor can do, and each can be told to do with less before it starts. So one machine stands in
for all that are older. What no setting reaches, the next unit in the last place of what is
measured, stands in for those that none of this emulates.
"""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping
from dataclasses import dataclass, field

from reobserve.evidence.golden.digests import processor_flags
from reobserve.numerics.code_paths import ENABLED, KERNEL, THREADS, unpinned


@dataclass(frozen=True)
class Condition:
    """A way to evaluate everything: environment variables, and what is changed before it starts.

    ``one_ulp`` moves what the plants' records hold by one unit in the last place, ``refined``
    halves every numerical step.
    """

    name: str
    variables: Mapping[str, str] = field(default_factory=dict)
    one_ulp: bool = False
    refined: bool = False

    def environment(self) -> dict[str, str]:
        """The variables of a process that evaluates under this condition."""
        chosen = {"PYTHONHASHSEED": "0", **dict.fromkeys(THREADS, "1"), **self.variables}
        return unpinned(dict(os.environ)) | chosen


_X86 = platform.machine().lower() in ("x86_64", "amd64")
_PINNED = {KERNEL: "Nehalem", ENABLED: " "} if _X86 else {}

PINNED = Condition("pinned code paths", _PINNED)
ONE_ULP = Condition("one unit in the last place", _PINNED, one_ulp=True)
REFINED = Condition("steps halved", _PINNED, refined=True)

_NO_FMA = {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-FMA,-FMA4,-AVX2"}  # sines of before 2013
_OTHER_HASHES = {"PYTHONHASHSEED": "1"}

# A BLAS kernel, what the processor must have for it, and what else is told to fit. AMD's Zen takes
# Haswell's kernel.
_KERNELS: tuple[tuple[str, set[str], dict[str, str]], ...] = (
    ("Haswell", {"avx2", "fma"}, _OTHER_HASHES),
    ("Nehalem", set(), {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": "", **_NO_FMA}),
    ("SkylakeX", {"avx512f", "avx512dq", "avx512bw", "avx512vl"}, {}),
    ("Sandybridge", {"avx"}, _NO_FMA),
    ("Prescott", set(), {}),
)


def processors() -> list[Condition]:
    """Those that can be emulated here, the most telling first."""
    found = [Condition("this processor, nothing pinned", _OTHER_HASHES)]
    if _X86:
        flags = processor_flags()
        for kernel, needed, variables in _KERNELS:
            if needed <= flags:
                found.append(Condition(kernel, {KERNEL: kernel, ENABLED: " ", **variables}))
    return [*found, ONE_ULP]
