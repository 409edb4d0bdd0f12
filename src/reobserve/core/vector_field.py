"""Functions of a user's own that compiled loops call: the right-hand sides of models."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import partial, reduce
from importlib import import_module
from pickle import PicklingError
from typing import Any

import numpy as np
from numba import NumbaError, types

from reobserve.core.errors import InputError, shown
from reobserve.core.kernel import cached_inner
from reobserve.core.loop_function import in_its_words, loop_pointer

_VECTOR = types.Array(types.float64, 1, "C")

VECTOR_FIELD = types.void(_VECTOR, _VECTOR, _VECTOR)
"""(point, parameters, out): write the value at a point to out; all are arrays of floats."""


def vector_field(function: Callable[..., None]) -> Any:
    """Compile ``function(x, parameters, out)``, so that compiled loops can be handed it.

    Unlike a kernel it has one fixed signature and is called through a pointer: a loop is
    compiled once for all fields. Its machine code is kept on disk. What it raises in a loop, an
    index beyond an array as well, is raised after the loop.

    Raises
    ------
    InputError
        If it is no function, or does what cannot be compiled.
    """
    if not inspect.isfunction(function):
        raise InputError("function", f"{shown(function)} must be a function of Python")
    try:
        inner = cached_inner(VECTOR_FIELD, function, boundscheck=True)
    except NumbaError as error:
        said = str(error).strip().partition("\n")[0]
        raise InputError("function", f"{function.__name__} cannot be compiled: {said}") from None

    def again(x: Any, parameters: Any, out: Any) -> None:
        try:
            with np.errstate(all="ignore"):
                function(x, parameters, out)
        except Exception as error:
            out[:] = np.nan
            problem = in_its_words(function.__name__, error, x)
            if problem is not None:
                raise problem from None

    field = loop_pointer(VECTOR_FIELD, inner, again)
    field.pickled = partial(_place, field, function)
    return field


def is_vector_field(value: Any) -> bool:
    """True if a value is a callback of numba's, as `vector_field` makes them."""
    return hasattr(value, "native_name") and hasattr(value, "address")


def _at(module: str, name: str) -> Any:
    """The object at a place in a module."""
    return reduce(getattr, name.split("."), import_module(module))


def _place(field: Any, function: Any) -> tuple[Any, tuple[str, str]]:
    """Pickle a vector field by its place, as functions are."""
    module, name = function.__module__, function.__qualname__
    if "<locals>" in name or _at(module, name) is not field:
        raise PicklingError(f"the vector field {name} stands nowhere in the module {module}")
    return _at, (module, name)
