"""Checks of arguments that are no numbers with a unit: kinds, whole numbers, words, packages."""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError, shown

Kind = TypeVar("Kind")

MOST_COUNTED = 2**31  # what is counted, which compiled loops add to without a check
MOST_STATES = 1000  # or outputs, inputs, axes and derivatives: a matrix of 8 MB
MOST_STEPS = 10**7  # of a simulation or a drawn record: some hundred megabytes


def as_kind(name: str, value: Any, kind: type[Kind]) -> Kind:
    """``value``, which must be a ``kind``. `InputError` names ``name`` otherwise."""
    if not isinstance(value, kind):
        raise InputError(name, f"{shown(value)} must be of type {kind.__name__}")
    return value


def as_whole(name: str, value: Any, least: int, most: int = MOST_COUNTED) -> int:
    """``value`` as a whole number in a range. `InputError` names ``name`` otherwise."""
    wrong = isinstance(value, bool) or not isinstance(value, int | np.integer)
    if wrong or not least <= value <= most:
        low = most == MOST_COUNTED and (wrong or value < least)
        wanted = f"{least} or more" if low else f"from {least} to {most}"
        raise InputError(name, f"{shown(value)} must be a whole number, {wanted}")
    return int(value)


def as_word(name: str, value: Any, words: Sequence[str]) -> str:
    """``value``, which must be one of ``words``. `InputError` names ``name`` otherwise."""
    if not isinstance(value, str) or value not in words:
        raise InputError(name, f"{shown(value)} must be one of {', '.join(words)}")
    return value


def as_flag(name: str, value: Any) -> bool:
    """``value``, which must be True or False. `InputError` names ``name`` otherwise."""
    if not isinstance(value, bool | np.bool_):
        raise InputError(name, f"{shown(value)} must be True or False")
    return bool(value)


def as_function(name: str, value: Kind) -> Kind:
    """``value``, a signal or a function that is called like one, else `InputError`."""
    try:
        if not callable(value) or isinstance(value, type):
            raise TypeError
        inspect.signature(value).bind(0.0, before=False)
    except (TypeError, ValueError):
        raise InputError(
            name, f"{shown(value)} must be a signal, or a function of time and ``before``"
        ) from None
    return value


def as_poles(name: str, value: Any) -> NDArray[np.complex128]:
    """``value`` as a list of complex numbers. `InputError` names ``name`` otherwise."""
    if isinstance(value, range) and len(value) > MOST_STATES:
        value = value[: MOST_STATES + 1]  # is refused, and needs no memory before
    try:
        array = np.asarray(value)
    except Exception:  # rows of different lengths, or an object that only seems to be an array
        array = np.array(None)
    if array.dtype.kind not in "iufc" or array.ndim != 1 or np.ma.is_masked(value):
        raise InputError(name, f"{shown(value)} must be a list of numbers")
    if len(array) > MOST_STATES:
        raise InputError(name, f"must have {MOST_STATES} numbers or fewer")
    return array.astype(np.complex128)
