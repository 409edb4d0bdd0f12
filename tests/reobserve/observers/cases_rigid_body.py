"""Observers of a rigid body, with a record whose truth is known."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from reobserve.observers.adaptive import AdaptiveObserver
from reobserve.observers.ilo import ILO, SampledILO
from reobserve.observers.rigid_body_observer import RigidBodyObserver
from reobserve.systems.rigid_body import RigidBody
from tests.reobserve.observers.case import Array, Case

_INERTIA = np.array([[36.0, 1.5, 0.0], [1.5, 17.0, 0.0], [0.0, 0.0, 26.0]])
_FAULT = np.array([0.3, -0.2, 0.1])
_PERIOD, _ROWS, _FINER = 0.01, 600, 4


@cache
def _record() -> tuple[Array, Array]:
    """A constant fault under a control torque that a controller holds from sample to sample.

    The control torque and the rate.
    """
    time = _PERIOD * np.arange(_ROWS)
    control = 3.0 * np.sin(np.multiply.outer(time, [5.0, 4.0, 6.0]) + np.arange(3.0))
    rates = [np.array([0.05, -0.03, 0.04])]
    h, inverse = _PERIOD / _FINER, np.linalg.inv(_INERTIA)

    def slope(w: Array, torque: Array) -> Array:
        a, b, c = w.tolist()
        p, q, r = (_INERTIA @ w).tolist()
        # J w' = T - w x J w
        found: Array = inverse @ (torque - [b * r - c * q, c * p - a * r, a * q - b * p])
        return found

    for torque in control[:-1] + _FAULT:
        w = rates[-1]
        for _ in range(_FINER):
            k1 = slope(w, torque)
            k2 = slope(w + 0.5 * h * k1, torque)
            k3 = slope(w + 0.5 * h * k2, torque)
            k4 = slope(w + h * k3, torque)
            w = w + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        rates.append(w)
    return control, np.array(rates)


def _rigid_body(observer: RigidBodyObserver) -> Case:
    control, rate = _record()
    truth = {"rate": rate, "fault": np.tile(_FAULT, (_ROWS, 1))}
    bounds = {"rate": 5e-5, "fault": 1e-3}
    return Case(observer, rate, control, observer.init(rate[0]), truth, bounds, 400, 100.0)


def sampled_ilo() -> Case:
    """v is updated at every second sample."""
    body = RigidBody(_INERTIA)
    return _rigid_body(
        SampledILO(
            body,
            K1=1.0,
            K2=1000.0,
            observer_gain=1000.0,
            update_interval=2 * _PERIOD,
            sampling_period=_PERIOD,
        )
    )


def continuous_ilo() -> Case:
    """v is learned continuously from its value five samples before."""
    return _rigid_body(
        ILO(
            RigidBody(_INERTIA),
            K1=0.9,
            K2=1000.0,
            observer_gain=10.0,
            update_interval=5 * _PERIOD,
            sampling_period=_PERIOD,
        )
    )


def adaptive() -> Case:
    """A proportional-integral law."""
    return _rigid_body(
        AdaptiveObserver(
            RigidBody(_INERTIA),
            observer_gain=200.0,
            integral_gain=2000.0,
            proportional_gain=50.0,
            sampling_period=_PERIOD,
        )
    )


CASES: dict[str, Callable[[], Case]] = {
    "sampled ILO": sampled_ilo,
    "continuous ILO": continuous_ilo,
    "adaptive": adaptive,
}
