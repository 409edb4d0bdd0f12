"""Compilation of hot loops: one decorator, so that every kernel has the same rules."""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Callable
from functools import cache, cached_property
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core.ccallback import CFunc
from numba.core.errors import NumbaExperimentalFeatureWarning
from numba.core.sigutils import normalize_signature

from reobserve.numerics.kernel_cache import cache_for, usable_folder

_MARKS = (b"@kernel", b"@inlined_kernel", b"intrinsic(_")  # of what is compiled

Function = TypeVar("Function", bound=Callable[..., object])

# Functions as arguments are what numba calls experimental, each time that it compiles with them.
warnings.simplefilter("ignore", NumbaExperimentalFeatureWarning)


def kernel(function: Function) -> Function:
    """Compile a function of scalars and arrays; the machine code is cached on disk.

    Division by zero gives inf or nan, as in numpy. Sums are never reordered and
    products never fused (no ``fastmath``), so that stepping and batch runs agree to
    the last bit.
    """
    # nogil: a kernel touches arrays only, so two of them can run in two threads of one process.
    compiled: Any = numba.njit(error_model="numpy", fastmath=False, nogil=True)(function)
    compiled._cache = cache_for(function, _cache_folder())
    return cast(Function, compiled)


def inlined_kernel(function: Function) -> Function:
    """Compile as `kernel` does, into whatever kernel calls it.

    For short functions of many arrays: to hand an array over costs as much as a few products.
    """
    compiler = numba.njit(error_model="numpy", fastmath=False, nogil=True, forceinline=True)
    compiled: Any = compiler(function)
    compiled._cache = cache_for(function, _cache_folder())
    return cast(Function, compiled)


def compiled_with_signature(signature: str, function: Callable[..., Any]) -> Any:
    """Compile a function that kernels can be handed: with one signature, called by its address."""
    options = {"error_model": "numpy"}
    parsed: Any = normalize_signature(signature)  # type: ignore[no-untyped-call]
    compiled: Any = CFunc(function, parsed, locals={}, options=options)
    compiled._cache = cache_for(function, _cache_folder())
    compiled.compile()
    return compiled


class Law:
    """A function that kernels are handed, compiled when it is first asked for and not on import."""

    def __init__(self, signature: str, function: Callable[..., Any]) -> None:
        self._signature, self._function = signature, function

    @cached_property
    def compiled(self) -> Any:
        """As `compiled_with_signature`."""
        return compiled_with_signature(self._signature, self._function)


@cache
def _cache_folder() -> Path | None:
    """Where the machine code of exactly these sources is kept; None if it can be kept nowhere.

    numba keys its cache by the file that defines a function and would run old code after an
    edit of a kernel that is called from another file. So the folder is named after the source
    of all kernels.
    """
    package = Path(__file__).parents[1]
    whole = hashlib.sha256(numba.__version__.encode())
    for path in sorted(package.rglob("*.py")):
        source = path.read_bytes()
        if any(mark in source for mark in _MARKS):
            whole.update(source)
    return usable_folder(package, f"kernels-{whole.hexdigest()[:16]}")
