"""Linear plant with one state and a delayed input (Lechappe et al. 2018, (39))."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.core.matrices import as_positive, as_scalar
from reobserve.core.vector_field import vector_field
from reobserve.systems.triangular import TriangularModel

Array = NDArray[np.float64]


def first_order_lag(rate: float = 1.0, gain: float = 1.0) -> TriangularModel:
    """The model x' = -a x + b u(t - tau) (Lechappe et al. 2018, (39)).

    Parameters
    ----------
    rate
        a [1/s], one over the time constant.
    gain
        b [units of x per second and unit of u], not zero: the delay could not be seen.
    """
    rate, gain = as_positive("rate", rate), as_scalar("gain", gain)
    if gain == 0:
        raise InputError("gain", "0 must not be zero: no input would reach the state")
    return TriangularModel(1, _drift, _input_gain, np.array([rate, gain]))


@vector_field
def _drift(x: Array, parameters: Array, f: Array) -> None:
    # f = -a x
    f[0] = -parameters[0] * x[0]


@vector_field
def _input_gain(y: Array, parameters: Array, G: Array) -> None:
    # G = b
    G[0] = parameters[1]
