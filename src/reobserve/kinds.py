"""Checks of parameters that are no real arrays: objects, whole numbers, functions, poles."""

from __future__ import annotations

from operator import index
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from reobserve.errors import InputError, shown

Kind = TypeVar("Kind")


def as_kind(name: str, value: Any, kind: type[Kind]) -> Kind:
    """``value``, which must be an object of a class; `InputError` names ``name`` otherwise."""
    if not isinstance(value, kind):
        raise InputError(name, f"{shown(value)} must be a {kind.__name__}")
    return value


def as_whole(name: str, value: Any, least: int, most: int = 10**9) -> int:
    """``value`` as a whole number from ``least`` to ``most``; `InputError` otherwise."""
    try:
        number = None if isinstance(value, bool | np.bool_ | np.ndarray) else index(value)
    except TypeError:
        number = None
    if number is not None and number < least:
        raise InputError(name, f"{shown(value)} must be at least {least}")
    if number is None or number > most:
        raise InputError(name, f"{shown(value)} must be a whole number from {least} to {most}")
    return number


def as_function(name: str, value: Kind) -> Kind:
    """``value``, which must be a function or a signal; `InputError` names ``name`` otherwise."""
    if not callable(value) or isinstance(value, type):
        raise InputError(name, f"{shown(value)} must be a signal, or a function of time")
    return value


def as_poles(name: str, value: Any) -> NDArray[np.complex128]:
    """``value`` as a list of complex numbers; `InputError` names ``name`` otherwise."""
    try:
        array = np.asarray(value)
    except Exception:  # rows of different lengths, or an object that only seems to be an array
        array = np.array(None)
    if array.dtype.kind not in "iufc" or array.ndim != 1 or np.ma.is_masked(value):
        raise InputError(name, f"{shown(value)} must be a list of numbers")
    return array.astype(np.complex128)
