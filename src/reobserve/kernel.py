"""Compilation of hot loops: one decorator, so that every kernel has the same rules."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., object])


def kernel(function: Function) -> Function:
    """Compile a function of scalars and arrays; the machine code is cached on disk.

    Division by zero gives inf or nan, as in numpy. Sums are never reordered and
    products never fused (no ``fastmath``), so that stepping and batch runs agree to
    the last bit.
    """
    return cast(Function, numba.njit(cache=True, error_model="numpy", fastmath=False)(function))
