r"""Designs certified by the theory (Chen & Saif 2007, Lemma 1 and Theorem 1).

The theorem depends on the gains only through k1 = ||K1||, ||K2|| and b = ||B_f^T B_f||_inf, so it
certifies -K2 if it certifies K2. Its conditions have a solution gamma_1..4, rho_1 > 0 if and only
if k1 < 1 and

.. math:: 2(\lambda_{\min}(\Lambda) - \eta) (1 - k_1^2) > b k_1^2 + 2\sqrt{b}\,\|K_2\| + \|K_2\|^2

(minimise over gamma_1 and gamma_4 with the other three tending to zero). The right side is at
least 2 sqrt(b) ||K2|| (1 + k1), so a certified design has lambda_min (1 - k1) > sqrt(b) ||K2||.
If Lambda is symmetric, ||D^-1 Q|| < 1 follows at every s = j w for D = I - K1 exp(-s tau) and
Q = K2 (J s + Lambda)^-1 B_f. Since u_f = (I + D^-1 Q) e, a certified design leaves more than half
of every steady sinusoid, and of every constant, unestimated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_kind
from reobserve.core.errors import InputError
from reobserve.core.finite import finite
from reobserve.core.matrices import Matrix, as_matrix, as_positive, as_rows, as_scalar


def _norm(matrix: ArrayLike) -> float:
    return float(np.linalg.norm(matrix, 2))


def _alphas(gamma1: float, gamma2: float, gamma3: float) -> tuple[float, float, float]:
    """The constants of (11)."""
    return 1 + gamma1 + gamma2, 1 + gamma3 + 1 / gamma1, 1 + 1 / gamma2 + 1 / gamma3


@finite("delayed_error, rate_error, mismatch")
def lemma1_sides(
    delayed_error: ArrayLike,
    rate_error: ArrayLike,
    mismatch: ArrayLike,
    K1: ArrayLike,
    K2: ArrayLike,
    gamma1: float,
    gamma2: float,
    gamma3: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Left and right sides of the inequality [N2 m2], shape (cases,).

    Chen & Saif 2007, (5), (6), (11), (12), Lemma 1 and after (11).

    Parameters
    ----------
    delayed_error, rate_error, mismatch
        e(t - tau) [N m], w~(t) [rad/s] and d(t) = u_f(t) - K1 u_f(t - tau) [N m], (cases, n).
    K1, K2
        Learning gains: a number, a diagonal or n x n.
    gamma1, gamma2, gamma3
        The weights of (8) to (10), above zero.

    Raises
    ------
    InputError
        If a shape is wrong or a weight is not above zero.
    """
    weights = (("gamma1", gamma1), ("gamma2", gamma2), ("gamma3", gamma3))
    alpha1, alpha2, alpha3 = _alphas(*(as_positive(name, value) for name, value in weights))
    past = as_rows("delayed_error", delayed_error)
    rate, d = as_rows("rate_error", rate_error, past), as_rows("mismatch", mismatch, past)
    kept = past @ as_matrix("K1", K1, past.shape[1]).T
    learned = rate @ as_matrix("K2", K2, past.shape[1]).T
    left = np.sum((kept - learned + d) ** 2, axis=1)
    squares = alpha1 * kept**2 + alpha2 * learned**2 + alpha3 * d**2
    return np.asarray(left), np.asarray(np.sum(squares, axis=1))


@dataclass(frozen=True)
class Theorem1:
    """Constants of the theorem for given weights, and whether its conditions hold.

    Chen & Saif 2007, after (11), (16), after (16), (17) and Theorem 1.

    (13) adds quantities of different units, which the weights hide. Lambda enters with the smallest
    eigenvalue of its symmetric part. ``epsilon1`` [N m s] must be above zero and ``learning_norm``
    = ||epsilon2 K1^T K1|| [-] at most one. Then V of (13) has dV/dt <= -epsilon1 |w~|^2 - rho1
    |e|^2 + epsilon3 |d|^2 (17); in (16) the last sign is printed as a minus.
    """

    epsilon1: float
    epsilon2: float
    epsilon3: float
    rho1: float
    learning_norm: float

    @property
    def holds(self) -> bool:
        """True if both conditions hold."""
        return self.epsilon1 > 0 and self.learning_norm <= 1

    @property
    def reason(self) -> str:
        """The conditions with their numbers."""
        above = "above" if self.epsilon1 > 0 else "not above"
        return (
            f"epsilon1 = {self.epsilon1:.4g} is {above} zero and "
            f"epsilon2 ||K1||^2 = {self.learning_norm:.6g} is "
            f"{'at most' if self.learning_norm <= 1 else 'above'} one"
        )


_LARGEST = 1e150  # norm whose square is a float
_SMALLEST = 1e-290  # of a square, which is divided by up to 1e12


@dataclass(frozen=True)
class _Design:
    """The numbers of a design that enter Theorem 1: k1 and k2 are the norms of K1 and K2."""

    excess: float  # lambda_min(Lambda) - eta
    spread: float  # ||B_f^T B_f||_inf
    k1: float
    k2: float

    @classmethod
    def check(
        cls,
        observer_gain: ArrayLike,
        fault_matrix: ArrayLike,
        K1: ArrayLike,
        K2: ArrayLike,
        eta: float,
    ) -> _Design:
        if as_scalar("eta", eta) < 0:
            raise InputError("eta", f"{eta:g} must not be below zero")
        full = as_matrix("observer_gain", observer_gain, 3)
        fault = as_matrix("fault_matrix", fault_matrix, 3)
        if not (fault.T @ fault).max() > _SMALLEST:
            raise InputError("fault_matrix", "must not be zero, nor so small that its square is")
        if not as_matrix("K2", K2, 3).any():
            raise InputError("K2", "must not be zero, the estimate would never change")
        sizes = (
            float(np.linalg.norm(fault.T @ fault, np.inf)),
            _norm(as_matrix("K1", K1, 3)),
            _norm(as_matrix("K2", K2, 3)),
        )
        norms = zip(("fault_matrix", "K1", "K2"), sizes, strict=True)
        for name, norm in (("observer_gain", np.abs(full).max()), *norms):
            if not norm < _LARGEST:
                raise InputError(
                    name, "is so large that its square is beyond floating-point numbers"
                )
        excess = float(np.linalg.eigvalsh((full + full.T) / 2)[0]) - as_scalar("eta", eta)
        return cls(excess, *sizes)

    def evaluate(self, g1: float, g2: float, g3: float, g4: float, rho1: float) -> Theorem1:
        alpha1, alpha2, alpha3 = _alphas(g1, g2, g3)
        factor = 1 + rho1 + self.spread / g4
        epsilon1 = 2 * self.excess - g4 - alpha2 * factor * self.k2**2
        epsilon2 = alpha1 * factor
        return Theorem1(epsilon1, epsilon2, alpha3 * factor, rho1, epsilon2 * self.k1**2)

    @property
    def threshold(self) -> float:
        """Infimum of certifiable lambda_min(Lambda) - eta, infinite if ||K1|| >= 1."""
        if self.k1 >= 1:
            return float("inf")
        root = np.sqrt(self.spread)
        numerator = (root * self.k1) ** 2 + 2 * root * self.k2 + self.k2**2
        return float(numerator / (2 * (1 - self.k1**2)))


@dataclass(frozen=True)
class IloCertificate:
    """Weights that satisfy Theorem 1, if any exist, and the error of the design.

    ``required_observer_gain`` [N m s] is the infimum of certifiable lambda_min(Lambda).
    ``dc_error`` is the largest share (2-norm) of a constant fault that the design leaves
    unestimated. ``weights`` = (gamma_1..4, rho_1) and ``theorem`` are None if none exist.
    """

    certified: bool
    required_observer_gain: float
    dc_error: float
    weights: tuple[float, float, float, float, float] | None
    theorem: Theorem1 | None
    reason: str


@np.errstate(all="ignore")  # what is not finite is refused, or no weight
def certify(
    observer_gain: ArrayLike,
    fault_matrix: ArrayLike,
    K1: ArrayLike,
    K2: ArrayLike,
    eta: float = 0.0,
) -> IloCertificate:
    """Find weights with which Theorem 1 certifies a design, if any exist.

    Chen & Saif 2007, Theorem 1.

    Weights exist if and only if the condition in the module's docstring holds. The RMS error that
    (18) promises with any weights is sqrt(epsilon3 / rho1) k_d, never below k_d / (1 - k1): since
    rho_1 < 1/(k1^2 alpha_1) - 1, its square is above (1 + 1/gamma_2) / (1 - k1^2 (1 + gamma_2)),
    whose minimum is 1 / (1 - k1)^2. Assumption 1 already implies |u_f| <= k_d / (1 - k1), so every
    certificate allows as large an error as an estimate of zero has.

    Parameters
    ----------
    observer_gain, fault_matrix, K1, K2
        Lambda [N m s], B_f [-], K1 [-] and K2 [N m s]: a number, a diagonal or 3 x 3.
    eta
        The constant of Assumption 2 [N m s], at least zero.

    Raises
    ------
    InputError
        If ``eta`` is below zero or a shape is wrong.

    Examples
    --------
    >>> import numpy as np
    >>> from reobserve.synthesis.ilo_certificate import certify
    >>> found = certify(observer_gain=2000.0, fault_matrix=np.eye(3), K1=0.5, K2=50.0)
    >>> print(found.certified, round(found.required_observer_gain, 1))
    True 1733.5
    """
    design = _Design.check(observer_gain, fault_matrix, K1, K2, eta)
    dc_error = _dc_error(
        as_matrix("observer_gain", observer_gain, 3),
        as_matrix("fault_matrix", fault_matrix, 3),
        as_matrix("K1", K1, 3),
        as_matrix("K2", K2, 3),
    )
    needed = design.threshold + eta
    lost = f"the design leaves up to {100 * dc_error:.3g}% of a constant fault unestimated"
    if design.k1 >= 1:
        reason = f"no weights: ||K1|| = {design.k1:.6g} and epsilon2 > 1 always; {lost}"
        return IloCertificate(False, needed, dc_error, None, None, reason)
    weights = _weights(design)
    if weights is None:
        must = f"{design.excess:.6g} must exceed {design.threshold:.6g}"
        reason = f"no weights: lambda_min(Lambda) - eta = {must}; {lost}"
        return IloCertificate(False, needed, dc_error, None, None, reason)
    theorem = design.evaluate(*weights)
    floor = 1 / (1 - design.k1)
    reason = f"{theorem.reason}; (18) promises no RMS error below {floor:.4g} k_d, and {lost}"
    return IloCertificate(True, needed, dc_error, weights, theorem, reason)


def _dc_error(observer_gain: Matrix, fault_matrix: Matrix, K1: Matrix, K2: Matrix) -> float:
    """Norm of [I - K1 + K2 Lambda^-1 B_f]^-1 (I - K1), or nan if there is no steady state."""
    memory = np.eye(len(K1)) - K1
    try:
        trip = K2 @ np.linalg.solve(observer_gain, fault_matrix)
        if np.isfinite(trip).all():
            return _norm(np.linalg.solve(memory + trip, memory))
    except np.linalg.LinAlgError:
        return float("nan")
    raise InputError("observer_gain", "has an inverse beyond floating-point numbers")


def _weights(design: _Design) -> tuple[float, float, float, float, float] | None:
    """Weights that satisfy Theorem 1, or None if none do, or only to rounding."""
    if design.excess <= design.threshold:
        return None
    # Weights that stay feasible down to the threshold, the others zero: m = ||K2|| / sqrt(b),
    # 1 + b / gamma4 = (1 + m) / (k1^2 + m), gamma1 = m (1 - k1^2) / (k1^2 (1 + m)).
    square = max(design.k1, 1e-6) ** 2  # K1 = 0 leaves gamma_1 without an upper bound
    m = design.k2 / float(np.sqrt(design.spread))
    factor = (1 + m) / (square + m)
    if not factor > 1:  # to rounding
        return None
    margin = 1 / (square * factor) - 1
    for slack in 0.5 ** np.arange(1, 50):  # halved until the conditions hold
        gamma1, gamma2 = margin * (1 - slack), margin * slack / 2
        # Nearly the largest with k1^2 alpha1 (1 + rho1 + b / gamma4) <= 1, the condition on K1
        rho1 = 0.99 * (1 / (square * (1 + gamma1 + gamma2)) - factor)
        weights = (gamma1, gamma2, float(slack), design.spread / (factor - 1), rho1)
        if rho1 > 0 and design.evaluate(*weights).holds:
            return weights
    return None


@np.errstate(over="ignore", invalid="ignore")  # what is not finite is refused
def bound18(
    theorem: Theorem1,
    rate_error: ArrayLike,
    error: ArrayLike,
    k_d: float,
) -> tuple[float, float]:
    """Both sides of the bound: the mean of epsilon1 |w~|^2 + rho1 |e|^2, and epsilon3 k_d^2.

    Chen & Saif 2007, (18).

    The mean is computed by the trapezoidal rule over uniform samples. For a record of finite
    duration [s], V(0) / duration adds to the right side, with V(0) of (13).

    Parameters
    ----------
    rate_error, error
        w~ [rad/s] and e [N m], shape (samples, n).
    k_d
        Supremum of the 2-norm of u_f(t) - K1 u_f(t - tau) [N m]: (17) needs this norm, where
        Assumption 1 prints the maximum norm, smaller by up to sqrt(n).

    Raises
    ------
    InputError
        If the conditions of the theorem do not hold, a shape is wrong or ``k_d`` is below zero.
    """
    if not as_kind("theorem", theorem, Theorem1).holds:
        raise InputError("theorem", f"its conditions do not hold: {theorem.reason}")
    if as_scalar("k_d", k_d) < 0:
        raise InputError("k_d", f"{k_d:g} must not be below zero")
    rates = as_rows("rate_error", rate_error)
    errors = as_rows("error", error, rates)
    density = theorem.epsilon1 * np.sum(rates**2, axis=1) + theorem.rho1 * np.sum(errors**2, axis=1)
    left = float(np.trapezoid(density)) / (len(density) - 1)
    right = theorem.epsilon3 * k_d * k_d
    if not np.isfinite([left, right]).all():
        raise InputError("rate_error, error, k_d", "have squares beyond floating-point numbers")
    return left, right
