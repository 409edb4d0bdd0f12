"""Arguments of a nonlinear model: its functions, parameters and scales, checked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.errors import InputError, nearest, shown
from reobserve.core.matrices import as_floats, as_numbers, as_scalar
from reobserve.systems.signal_names import as_names

Array = NDArray[np.float64]


def as_texts(name: str, given: Any) -> Any:
    """A function as it is, texts as a tuple."""
    if isinstance(given, str):
        return (given,)
    if isinstance(given, list | tuple) and given and all(isinstance(text, str) for text in given):
        return tuple(given)
    if callable(given) and not isinstance(given, type):
        return given
    raise InputError(name, f"{shown(given)} must be a function of x and u, or a list of texts")


def as_parameters(given: Any, taken: Sequence[str]) -> dict[str, float] | None:
    """Values by name, different from the names that are ``taken``, or None."""
    if given is None:
        return None
    if not isinstance(given, Mapping):
        raise InputError("parameters", f"{shown(given)} must be numbers by name")
    as_names("parameters", [*taken, *given])
    return {name: as_scalar(f"parameters.{name}", value) for name, value in given.items()}


def as_scale(given: ArrayLike, states: int) -> Array:
    """Sizes of the states, shape (n,), from one number or n."""
    scale = as_floats("scale", given)
    if scale.shape not in ((), (states,)) or scale.min() <= 0:
        raise InputError("scale", f"{shown(given)} must be one positive number, or {states}")
    return np.full(states, float(scale)) if scale.ndim == 0 else scale


def values_by_row(
    known: Mapping[str, float] | None, given: Mapping[str, ArrayLike], rows: int
) -> Array:
    """Parameters of a run: shape (1, q) if they are the same in all rows, else (rows, q).

    ``known`` are those of the model, ``given`` by name a number or an array of shape (rows,).
    """
    if not isinstance(given, Mapping):
        raise InputError("parameters", f"{shown(given)} must be numbers by name")
    columns: dict[str, Any] = dict(known or {})
    for name, value in given.items():
        place = f"parameters.{name}"
        if name not in columns:
            raise InputError(place, f"is no parameter of the model{nearest(name, columns)}")
        columns[name] = column = as_numbers(place, value)
        if column.shape not in ((), (rows,)):
            problem = f"has shape {column.shape}, must be one number or ({rows},)"
            raise InputError(place, problem)
        for row in np.flatnonzero(~np.isfinite(column)):
            where = f"{place}[{row}]" if column.ndim else place
            raise InputError(where, f"{column.flat[row]:g} must be a finite number")
    varying = any(np.ndim(column) for column in columns.values())
    values = np.empty((rows if varying else 1, len(columns)))
    for i, column in enumerate(columns.values()):
        values[:, i] = column
    return values
