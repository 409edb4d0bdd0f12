"""One way through the libraries below, whatever the processor: to be pinned before numpy starts.

numpy, scipy and the BLAS inside them choose machine code by the processor that they find, and
round differently in each. Where numbers are made to be kept, in the command line, the tests and
the benchmarks, `pin_code_paths` lets them choose what every x86-64 processor of their wheels has.
Importing the package pins nothing: a user's process is the user's.

What cannot be pinned from inside a running process is the C library: glibc takes its sines,
exponentials, logarithms and powers with fused multiply-adds where the processor has them, as all
have from about 2013 on, and listens to ``GLIBC_TUNABLES`` only before a program starts. To start
every stage twice would cost more than it gives; `make elsewhere` shows what it moves.
"""

from __future__ import annotations

import os
import platform
import sys

# Sums over several threads may round differently each time.
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")

# The oldest kernels that run wherever numpy's wheels do, on AMD's processors, too.
KERNEL = "OPENBLAS_CORETYPE"
_OLDEST_KERNEL = "Nehalem"

# A list without a name: nothing is enabled beyond what numpy is compiled for. To disable by name
# would be an error where numpy has no such name, and names change from version to version.
ENABLED = "NPY_ENABLE_CPU_FEATURES"
DISABLED = "NPY_DISABLE_CPU_FEATURES"
_NOTHING = " "

# Level 1 of LLVM compiles a loop in two thirds of the time of level 3. Over all figures the files
# are bitwise identical, and the loops as fast.
_OPTIMISATION = ("NUMBA_OPT", "1")


def pin_code_paths() -> bool:
    """Choose the code paths of this process and its children, and return whether they are chosen.

    What the user has set stays as it is. False if numpy is there already, since it and its BLAS
    have chosen by then (children still start as chosen here), if something is set otherwise, or
    if this is no x86-64 processor, where nothing but the number of threads is known to pin.
    """
    os.environ.setdefault(*_OPTIMISATION)
    chosen = dict.fromkeys(THREADS, "1")
    known = platform.machine().lower() in ("x86_64", "amd64")
    if known:
        chosen[KERNEL] = _OLDEST_KERNEL
        if not os.environ.get(DISABLED):  # numpy refuses to start with both
            chosen[ENABLED] = _NOTHING
    for name, value in chosen.items():
        os.environ.setdefault(name, value)
    pinned = all(os.environ[name] == value for name, value in chosen.items())
    return known and pinned and ENABLED in chosen and "numpy" not in sys.modules


def unpinned(environment: dict[str, str]) -> dict[str, str]:
    """The variables of an environment without those that choose code paths."""
    chosen = (*THREADS, KERNEL, ENABLED, DISABLED)
    return {name: value for name, value in environment.items() if name not in chosen}


def cores() -> int:
    """The number of cores that this process may use."""
    available = getattr(os, "sched_getaffinity", None)
    return len(available(0)) if available else os.cpu_count() or 1
