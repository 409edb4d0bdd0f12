"""Lyapunov functions of the learning observer: (13) of Chen & Saif 2007, and a repaired one."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_whole
from reobserve.core.covariances import as_positive_definite
from reobserve.core.errors import InputError
from reobserve.core.finite import finite
from reobserve.core.matrices import Matrix, as_matrix, as_positive, as_rows, as_scalar


@finite("rate_bound")
def gyroscopic_eta(inertia: ArrayLike, rate_bound: float) -> float:
    """The one-sided constant (J_max - J_min) / 2 * max |w| [N m s].

    Chen & Saif 2007, Assumption 2.

    The torque difference of Assumption 2 is quadratic in w~, so it has no global eta. The proof
    needs only its component along w~. With w^ = w - w~, the error equation contains
    g = -w x J w + w^ x J w^ = -w x J w~ - w~ x J w + w~ x J w~, so w~.g = -w~.(w x J w~). A
    multiple c I of the identity adds nothing to J there, and c = (J_max + J_min) / 2 gives
    |w~.g| <= |w| ||J - c I|| |w~|^2, with equality between the extreme principal axes.

    Parameters
    ----------
    inertia
        J [kg m2], 3 x 3.
    rate_bound
        Supremum of |w(t)| [rad/s].
    """
    moments = np.linalg.eigvalsh(as_positive_definite("inertia", inertia, 3))
    if as_scalar("rate_bound", rate_bound) < 0:
        raise InputError("rate_bound", f"{rate_bound:g} must not be below zero")
    return float((moments[-1] - moments[0]) / 2 * rate_bound)


@np.errstate(over="ignore", invalid="ignore")  # what is not finite is refused
def repaired_weights(
    fault_matrix: ArrayLike, K1: ArrayLike, K2: ArrayLike, *, size: int = 3
) -> tuple[Matrix, Matrix]:
    r"""P and K1^T P K1 of a Lyapunov function for K1 up to the identity and any interval.

    Chen & Saif 2007, (6).

    Let P be symmetric positive definite with P K2 = B_f^T and K1^T P K1 <= P, and

    .. math:: V = \tilde w^T J \tilde w + \int_{t-\tau}^t e^T K_1^T P K_1 e\,ds.

    Write x = K1 e(t - tau) and g for the gyroscopic torque difference. Then (4) and (6) are
    J w~' = g + B_f e - Lambda w~ and x = e + K2 w~ - d, and
    dV/dt = 2 w~.(g - Lambda w~) + 2 w~.B_f e + e.K1^T P K1 e - x.P x. For d = 0,
    x.P x = e.P e + 2 w~.K2^T P e + w~.K2^T P K2 w~, where K2^T P = B_f: the cross terms cancel, and

    .. math:: \dot V = 2\tilde w^T(g-\Lambda\tilde w) - \tilde w^TB_fK_2\tilde w
              - e^T(P-K_1^TPK_1)e \le -\tilde w^T(2\Lambda-2\eta I+B_fK_2)\tilde w
              - e^T(P-K_1^TPK_1)e.

    A mismatch d = u_f(t) - K1 u_f(t - tau) adds exactly 2 d.(P e + B_f^T w~) - d.P d. For B_f = I
    and K1 = k1 I this is P = K2^-1 with K2 symmetric positive definite, and |k1| <= 1. With K1 = I
    a constant fault gives d = 0: V does not increase, but e itself has no decay rate. V is in
    joules, whereas (13) adds different units.

    Parameters
    ----------
    fault_matrix, K1, K2
        B_f [-], K1 [-] and K2 [N m s]; see `LearningLaw`.
    size
        The number of axes.
    """
    first, second = as_matrix("K1", K1, size), as_matrix("K2", K2, size)
    if np.linalg.matrix_rank(second) < size:
        raise InputError("K2", f"{second.tolist()} must be invertible")
    weight = np.linalg.solve(second.T, as_matrix("fault_matrix", fault_matrix, size)).T
    if np.linalg.norm(weight - weight.T) > 1e-9 * np.linalg.norm(weight):
        raise InputError("K2", "P = B_f^T K2^-1 must be symmetric")
    weight = (weight + weight.T) / 2
    if not np.isfinite(np.linalg.norm(weight)):
        raise InputError("K2", "makes a Lyapunov function beyond floating-point numbers")
    if (lowest := float(np.linalg.eigvalsh(weight)[0])) <= 0:
        raise InputError("K2", f"P = B_f^T K2^-1 has the eigenvalue {lowest:g}, must be above 0")
    kept = first.T @ weight @ first
    if not np.isfinite(np.linalg.norm(kept)):
        raise InputError("K1", "makes a Lyapunov function beyond floating-point numbers")
    lowest = float(np.linalg.eigvalsh(weight - kept)[0])
    if lowest < -1e-12 * np.linalg.norm(weight):
        raise InputError("K1", f"P - K1^T P K1 has the eigenvalue {lowest:g}, must not be below 0")
    return np.asarray(weight), np.asarray(kept)


@finite("rate_error, error")
def lyapunov_values(
    inertia: ArrayLike,
    memory_weight: ArrayLike,
    rate_error: ArrayLike,
    error: ArrayLike,
    interval: float,
    samples: int,
) -> NDArray[np.float64]:
    """V at every sample that follows a whole interval, shape (len - samples,).

    Chen & Saif 2007, (13), if ``memory_weight`` is the identity. The integral is the trapezoidal
    rule over the last ``samples`` steps of a uniform grid, one ``interval`` [s] long. It is of
    second order where e is smooth, and of first order in a step in which e jumps. ``rate_error`` w~
    [rad/s] and ``error`` e [N m] have shape (len, n), len > ``samples``.
    """
    rates = as_rows("rate_error", rate_error)
    errors = as_rows("error", error, rates)
    size = rates.shape[1]
    samples = as_whole("samples", samples, 1, len(rates) - 1)
    # V = w~^T J w~ + the integral of e^T W e over the last interval
    energy = quadratic_form(as_positive_definite("inertia", inertia, size), rates)
    density = quadratic_form(as_matrix("memory_weight", memory_weight, size), errors)
    panels = np.append(0.0, np.cumsum((density[1:] + density[:-1]) / 2))
    learned = panels[samples:] - panels[:-samples]
    return np.asarray(energy[samples:] + learned * (as_positive("interval", interval) / samples))


def quadratic_form(matrix: Matrix, series: Matrix) -> NDArray[np.float64]:
    """x^T M x for every row x, shape (len,)."""
    return np.asarray(np.einsum("ki,ij,kj->k", series, matrix, series))
