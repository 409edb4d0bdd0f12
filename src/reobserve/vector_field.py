"""Functions of a user's own that compiled loops call: the right-hand sides of models."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from reobserve.kernel import compiled_with_signature

# (point, parameters, out): write the value at a point to out; all are arrays of floats.
_SIGNATURE = "void(float64[::1], float64[::1], float64[::1])"


def vector_field(function: Callable[..., None]) -> Any:
    """Compile ``function(x, parameters, out)``, so that compiled loops can be handed it.

    Unlike a kernel it has one fixed signature and is called through a pointer: a loop is
    compiled once for all fields, and its machine code is kept on disk.
    """
    return compiled_with_signature(_SIGNATURE, function)
