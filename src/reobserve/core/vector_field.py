"""Functions of a user's own that compiled loops call: the right-hand sides of models."""

from __future__ import annotations

import copyreg
import inspect
from collections.abc import Callable
from functools import reduce
from importlib import import_module
from pickle import PicklingError
from typing import Any

from numba import NumbaError

from reobserve.core.errors import InputError, shown
from reobserve.core.kernel import compiled_with_signature

# (point, parameters, out): write the value at a point to out; all are arrays of floats.
_SIGNATURE = "void(float64[::1], float64[::1], float64[::1])"


def vector_field(function: Callable[..., None]) -> Any:
    """Compile ``function(x, parameters, out)``, so that compiled loops can be handed it.

    Unlike a kernel it has one fixed signature and is called through a pointer: a loop is
    compiled once for all fields, and its machine code is kept on disk.

    Raises
    ------
    InputError
        If it is no function, or does what cannot be compiled.
    """
    if not inspect.isfunction(function):
        raise InputError("function", f"{shown(function)} must be a function of Python")
    try:
        field = compiled_with_signature(_SIGNATURE, function)
    except NumbaError as error:
        said = str(error).strip().partition("\n")[0]
        raise InputError("function", f"{function.__name__} cannot be compiled: {said}") from None
    copyreg.pickle(type(field), _place)
    return field


def is_vector_field(value: Any) -> bool:
    """True if a value is a callback of numba's, as `vector_field` makes them."""
    return hasattr(value, "native_name") and hasattr(value, "address")


def _at(module: str, name: str) -> Any:
    """The object at a place in a module."""
    return reduce(getattr, name.split("."), import_module(module))


def _place(field: Any) -> tuple[Any, tuple[str, str]]:
    """Pickle a vector field by its place, as functions are."""
    function = field.__wrapped__
    module, name = function.__module__, function.__qualname__
    if "<locals>" in name or _at(module, name) is not field:
        raise PicklingError(f"the vector field {name} stands nowhere in the module {module}")
    return _at, (module, name)
