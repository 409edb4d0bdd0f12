"""Pendulum that a delayed torque turns (Lechappe et al. 2018, (33))."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.core.matrices import as_positive, as_scalar
from reobserve.core.vector_field import vector_field
from reobserve.systems.triangular import TriangularModel

Array = NDArray[np.float64]


def pendulum(gravity: float, length: float, mass: float, friction: float) -> TriangularModel:
    """The model x1' = x2, x2' = -(g/l) sin x1 - (k/m) x2 + u(t - tau) / (m l^2).

    Lechappe et al. 2018, (33).

    x1 is the angle [rad], zero where the bob hangs down, and is not wrapped: it counts turns. x2 is
    its rate [rad/s], u a torque [N m]. The friction is a force k l x2 on the bob against its
    velocity l x2; its torque k l^2 x2 over the moment of inertia m l^2 is (k/m) x2.

    Parameters
    ----------
    gravity
        g [m/s^2].
    length
        l [m], of the rod, which has no mass.
    mass
        m [kg], of the bob.
    friction
        k [kg/s], may be zero.

    Raises
    ------
    InputError
        If the friction is negative or another parameter is not greater than zero.
    """
    gravity, length = as_positive("gravity", gravity), as_positive("length", length)
    mass, friction = as_positive("mass", mass), as_scalar("friction", friction)
    if friction < 0:
        raise InputError("friction", f"{friction:g} kg/s must not be negative")
    with np.errstate(over="ignore", divide="ignore"):
        factors = np.array([gravity, friction, 1.0]) / [length, mass, mass * length**2]
    if not np.isfinite(factors).all():
        raise InputError("mass", f"{mass:g} kg at {length:g} m is so small that rates overflow")
    return TriangularModel(2, _drift, _input_gain, factors)


@vector_field
def _drift(x: Array, parameters: Array, f: Array) -> None:
    # f = [0, -(g/l) sin x1 - (k/m) x2]
    f[0] = 0.0
    f[1] = -parameters[0] * math.sin(x[0]) - parameters[1] * x[1]


@vector_field
def _input_gain(y: Array, parameters: Array, G: Array) -> None:
    # G = 1 / (m l^2)
    G[0] = parameters[2]
