"""Standard deviations of the estimation errors under held random disturbances and noise.

The errors are those of Indriawati, Agustinah & Jazidie, (10).

    Eo e' = Ao e + Da~ v,    v held over a period, independent from one to the next

At the ends of the periods e(k+1) = Ad e(k) + Bd v(k), and the covariance of e solves the discrete
Lyapunov equation P = Ad P Ad^T + Bd V Bd^T. Within a period T the error is e = d + G v with the
error at rest G = -Ao^-1 Da~ and d' = A d, A = Eo^-1 Ao, so the mean of its covariance is

    Q / T - J G V G^T - (J G V G^T)^T + G V G^T,    A Q + Q A^T = Ad W Ad^T - W,
    W = P + G V G^T,    J = A^-1 (Ad - I) / T.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from reobserve.core.arguments import as_kind
from reobserve.core.discretisation import zero_order_hold
from reobserve.core.errors import InputError
from reobserve.core.matrices import Matrix, as_floats
from reobserve.synthesis.extended_state.certificate import error_system
from reobserve.synthesis.extended_state.system import AugmentedSystem, Gains


class Deviations(NamedTuple):
    """Standard deviations at the ends of the periods, and from the mean variance over all time."""

    ends: Matrix
    time: Matrix


@np.errstate(over="ignore", invalid="ignore")  # what is not finite is refused
def held_deviation(
    system: AugmentedSystem, gains: Gains, deviations: ArrayLike, period: float
) -> Deviations:
    """Standard deviations of the errors of x, xz, fa and fs, each of shape (N,).

    Parameters
    ----------
    system, gains
        The plant and a stable observer.
    deviations
        Standard deviations of the disturbances and then of the noise, all independent, shape
        (kd + kw,).
    period
        Time for which they are held [s].
    """
    from scipy.linalg import solve_continuous_lyapunov, solve_discrete_lyapunov

    size = np.asarray(as_floats("deviations", deviations))
    entering = as_kind("system", system, AugmentedSystem).Da.shape[1]
    if size.shape != (entering,):
        raise InputError("deviations", f"has shape {size.shape}, must be ({entering},)")
    Ao, Eo = error_system(system, gains)
    drive = np.vstack([system.Da, np.zeros((system.faults, entering))])
    A = np.linalg.solve(Eo, Ao)
    Ad, Bd = zero_order_hold(A, np.linalg.solve(Eo, drive), period)
    if np.max(np.abs(np.linalg.eigvals(Ad))) >= 1:
        raise InputError("gains", "give no stable observer, so its errors have no deviation")
    spread = Bd * size
    each = spread @ spread.T
    if not np.isfinite(each).all():
        raise InputError("deviations", "give variances beyond floating-point numbers")
    covariance = solve_discrete_lyapunov(Ad, each)
    rest = np.linalg.solve(Ao, drive * size)
    rest = rest @ rest.T
    start = covariance + rest
    unit = np.exp2(np.round(np.log2(np.max(start)))) if start.any() else 1.0  # the solver overflows
    Q = solve_continuous_lyapunov(A, (Ad @ start @ Ad.T - start) / unit) * unit / period
    mixed = np.linalg.solve(A, Ad - np.eye(len(A))) @ rest / period
    return Deviations(_roots(covariance), _roots(Q - mixed - mixed.T + rest))


def _roots(covariance: Matrix) -> Matrix:
    roots: Matrix = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    return roots
