"""Chains of integrators with a delayed input, as models (Lechappe et al. 2018, (1))."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.arguments import MOST_STATES, as_whole
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
    """Chain of integrators with a delayed input (Lechappe et al. 2018, (1) and after (1)).

        x' = Lambda x + f(x) + (0, ..., 0, G(y))^T u(t - tau(t)),    y = x1

    Lambda is the shift upwards: x1' = x2 + f1(x1), and so on.

    `reobserve.systems.triangular_text.triangular_model` makes one from text.

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

    Examples
    --------
    >>> from reobserve.systems.triangular_text import triangular_model
    >>> pendulum = triangular_model(["a", "w"], drift=["0", "-20*sin(a) - w/2"], input_gain="20")
    >>> print(pendulum.states)
    2
    """

    states: int = field(metadata=converter(as_whole, 1, MOST_STATES))
    drift: Any = field(metadata=converter(_as_vector_field))
    input_gain: Any = field(metadata=converter(_as_vector_field))
    parameters: Array = field(metadata=converter(_as_parameters))
