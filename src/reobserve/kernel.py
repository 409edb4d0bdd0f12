"""Compilation of hot loops: one decorator, so that every kernel has the same rules."""

from __future__ import annotations

import fcntl
import hashlib
import os
import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core.errors import NumbaExperimentalFeatureWarning

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
    compiler = numba.njit(cache=True, error_model="numpy", fastmath=False, nogil=True)
    return cast(Function, _compiled(compiler, function))


def inlined_kernel(function: Function) -> Function:
    """Compile as `kernel` does, into whatever kernel calls it.

    For short functions of many arrays: to hand an array over costs as much as a few products.
    """
    compiler = numba.njit(
        cache=True, error_model="numpy", fastmath=False, nogil=True, forceinline=True
    )
    return cast(Function, _compiled(compiler, function))


def compiled_with_signature(signature: str, function: Callable[..., Any]) -> Any:
    """Compile a function that kernels can be handed: with one signature, called by its address."""
    return _compiled(numba.cfunc(signature, cache=True, error_model="numpy"), function)


def _compiled(compiler: Any, function: Any) -> Any:
    """The compiled function, its machine code in the folder for the sources as they are."""
    config: Any = numba.config
    before = config.CACHE_DIR
    config.CACHE_DIR = _cache_folder()
    try:
        compiled = compiler(function)
    finally:
        config.CACHE_DIR = before
    _save_alone(compiled._cache)
    return compiled


def _save_alone(cache: Any) -> None:
    """Let one process at a time save machine code of a kernel.

    numba reads the index of a kernel, adds a name to it and writes the code under that name. Each
    file is replaced whole, but two processes with two signatures can choose one name, and then
    one signature runs the code of the other.
    """
    save = cache.save_overload

    def save_alone(signature: Any, compiled: Any) -> None:
        with (Path(cache.cache_path) / "lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            save(signature, compiled)

    cache.save_overload = save_alone


@cache
def _cache_folder() -> str:
    """Where the machine code of exactly these sources is kept.

    numba keys its cache by the file that defines a function and would run old code after an
    edit of a kernel that is called from another file. So the folder is named after the source
    of all kernels.
    """
    package = Path(__file__).parent
    whole = hashlib.sha256(numba.__version__.encode())
    for path in sorted(package.rglob("*.py")):
        source = path.read_bytes()
        if b"@kernel" in source or b"@inlined_kernel" in source:
            whole.update(source)
    chosen: Any = numba.config
    if chosen.CACHE_DIR:
        base = Path(chosen.CACHE_DIR)
    elif os.access(package, os.W_OK):
        base = package / "__pycache__"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "reobserve"
    return str(base / f"kernels-{whole.hexdigest()[:16]}")
