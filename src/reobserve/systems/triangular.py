"""Chains of integrators with a delayed input, as models (Lechappe et al. 2018, (1))."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.arguments import as_whole
from reobserve.core.errors import InputError, shown
from reobserve.core.matrices import as_floats
from reobserve.core.value import Value, converter
from reobserve.core.vector_field import is_vector_field

Array = NDArray[np.float64]


def _as_vector_field(name: str, value: Any) -> Any:
    if not is_vector_field(value):
        raise InputError(
            name, f"{shown(value)} must be compiled by reobserve.core.vector_field.vector_field"
        )
    return value


def _as_parameters(name: str, value: Any) -> Array:
    parameters = as_floats(name, value)
    if parameters.ndim != 1:
        raise InputError(name, f"has shape {parameters.shape}, must be a list of numbers")
    return parameters


@dataclass(frozen=True, eq=False, repr=False)
class TriangularModel(Value):
    """x' = Lambda x + f(x) + (0, ..., 0, G(y))^T u(t - tau(t)), y = x1, Lambda the shift upwards.

    Lechappe et al. 2018, (1) and after (1).

    Parameters
    ----------
    states
        n.
    drift
        f, made by `vector_field`: writes f(x), shape (n,); f_i may depend on x1 to x_i only.
    input_gain
        G, made by `vector_field`: called with (y,), writes one number.
    parameters
        What both are handed, a vector of any length.

    Raises
    ------
    InputError
        If there are no states, a function was not compiled, or a parameter is not finite.
    """

    states: int = field(metadata=converter(as_whole, 1))
    drift: Any = field(metadata=converter(_as_vector_field))
    input_gain: Any = field(metadata=converter(_as_vector_field))
    parameters: Array = field(metadata=converter(_as_parameters))
