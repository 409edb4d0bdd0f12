"""Gain functions of filters on linear models, called through a pointer by one compiled loop."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from reobserve.core.kernel import FunctionPointer
from reobserve.core.loop_function import GuardedPointer

Array = NDArray[np.float64]

_TALL, _FLAT = (types.Array(types.float64, size, "C") for size in (2, 1))
_SIGNATURE = types.void(_TALL, _TALL, _FLAT, _FLAT, _FLAT, _TALL)

own_gain_function = partial(FunctionPointer, _SIGNATURE)
"""As `gain_function`, for functions of the library, which raise nothing and change nothing."""


def _shaped(cross: Array, factor: Array, innovation: Array, *others: Array) -> tuple[Array, ...]:
    m = len(innovation)
    *vectors, gain = others
    return cross.reshape(-1, m), factor.reshape(m, m), innovation, *vectors, gain.reshape(-1, m)


def gain_function(function: Callable[..., None]) -> FunctionPointer:
    """Make a gain function of ``function(cross, factor, innovation, error, parameters, gain)``.

    It writes the gain K, shape (n, m), to its last argument. ``cross`` is P C', shape (n, m), of
    the predicted covariance, ``factor`` the lower Cholesky factor of the innovation's covariance,
    shape (m, m), ``innovation`` e(k+1|k) and ``error`` the filter's own a posteriori output error
    e(k|k), both of shape (m,), and ``parameters`` what the filter put there. What it raises is
    raised after the loop.
    """
    return GuardedPointer(_SIGNATURE, function, _shaped)


class Gain(NamedTuple):
    """A gain function and its parameters, or None for Kalman's, which the loops have built in."""

    function: Any
    parameters: Array
