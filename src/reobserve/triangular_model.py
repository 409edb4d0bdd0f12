"""Models of the class (1) of Lechappe et al.: a chain of integrators with a delayed input."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TriangularModel:
    """x' = Lambda x + f(x) + (0, ..., 0, G(y))^T u(t - tau(t)), y = x1, Lambda the shift upwards.

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
        If there are no states or a parameter is not finite.
    """

    states: int
    drift: Any
    input_gain: Any
    parameters: Array

    def __post_init__(self) -> None:
        if self.states < 1:
            raise InputError("states", f"{self.states} must be 1 or more")
        if self.parameters.ndim != 1 or not np.all(np.isfinite(self.parameters)):
            raise InputError("parameters", f"{self.parameters} must be a vector of finite numbers")
