"""Chains of integrators with a delayed input, as models (Lechappe et al. 2018, (1))."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.arguments import as_whole
from reobserve.core.errors import InputError, shown
from reobserve.core.matrices import as_floats
from reobserve.core.vector_field import is_vector_field

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TriangularModel:
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

    states: int
    drift: Any
    input_gain: Any
    parameters: Array

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "states", as_whole("states", self.states, 1))
        for name in ("drift", "input_gain"):
            field = getattr(self, name)
            if not is_vector_field(field):
                raise InputError(
                    name,
                    f"{shown(field)} must be compiled by reobserve.core.vector_field.vector_field",
                )
        parameters = as_floats("parameters", self.parameters)
        if parameters.ndim != 1:
            raise InputError(
                "parameters", f"has shape {parameters.shape}, must be a list of numbers"
            )
        put(self, "parameters", parameters)
