"""Limits of the learning gains in closed form."""

from __future__ import annotations

from math import tanh


def scalar_sampled_limit(inertia: float, damping: float, K1: float, interval: float) -> float:
    """The largest stable scalar K2 [N m s] of the sampled-and-held observer with B_f = I.

    k2 < (1 + a)(1 + k1) lambda / (1 - a), a = exp(-lambda tau / j), where an eigenvalue passes -1.
    For scalar gains and a full inertia matrix, its smallest eigenvalue decides.
    """
    return (1 + K1) * damping / tanh(damping * interval / (2 * inertia))
