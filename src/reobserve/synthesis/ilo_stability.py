"""Stability of the observer that learns continuously (Chen & Saif 2007, (3) and (4)).

Linearised at rest, see `ilo_error_system`: a neutral-type delay system.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_kind
from reobserve.core.errors import InputError
from reobserve.core.matrices import Matrix, spectral_radius
from reobserve.synthesis.ilo_error_system import Complex, LearningLaw, Verdict

_UNIT = 1e-9  # a spectral radius this close to one is taken to be one
_SHIFTS = (1.0, 0.1, 0.01, 0.001, 0.0)  # real parts [1/interval] right of which roots are counted
_MOST = 1e150  # [1/s], of entries whose squares are floats
_PERIODS = 4000  # longest frequency range [2 pi / interval] over which roots are counted


@dataclass(frozen=True)
class ContinuousStability:
    """Verdict on the delay system.

    ``learning_radius`` is the spectral radius of K1. ``worst_round_gain`` is the supremum over
    frequency of the spectral radius of K1 (I + K2 (J s + Lambda)^-1 B_f)^-1, the factor on ``v``
    from one interval to the next (infinite if the inverse itself is unstable).
    ``unstable_roots`` counts the characteristic roots with real part above ``counted_right_of``
    [1/s], and no such root has a modulus above ``search_radius`` [rad/s]; each is None where it
    was not needed or not found. ``growth_rate`` [1/s] is a lower bound on the fastest growth.
    """

    verdict: Verdict
    reason: str
    learning_radius: float
    worst_round_gain: float
    unstable_roots: int | None = None
    counted_right_of: float | None = None
    search_radius: float | None = None
    growth_rate: float | None = None


def continuous_stability(
    law: LearningLaw,
) -> ContinuousStability:
    r"""Decide whether the error of (3) and (4) decays, linearised at rest.

    The roots are those of :math:`\det[Js+\Lambda+B_f(I-K_1e^{-s\tau})^{-1}K_2]`. In this order:

    1. A spectral radius of K1 above one is unstable whatever K2 is, because a chain of roots tends
       to Re s = ln(radius)/tau at high frequency; so is a defective eigenvalue on the unit circle.
    2. The roots also solve :math:`\det[I-e^{-s\tau}K_1T(s)]=0`, T = (I + K2 (Js+Lambda)^-1 B_f)^-1.
       If T is stable and the spectral radius of K1 T(j w) stays below one, it does so in the whole
       right half-plane (it is subharmonic there), and no root lies there for any interval.
    3. Otherwise roots right of a line are counted by the winding of the return difference along
       it. Beyond ``search_radius`` the loop gain has norm below one, so the count is exact if the
       frequency grid, refined until neighbours differ by less than half their size, is fine enough.

    If the radius of K1 is one, decay is never exponential: "marginal" then says that no root was
    found right of ``counted_right_of``. The same is said of a design too close to call.
    """
    as_kind("law", law, LearningLaw)
    radius = spectral_radius(law.K1)
    gain = _worst_round_gain(law)
    if radius > 1 + _UNIT:
        rate = float(np.log(radius)) / law.update_interval
        reason = f"K1 has spectral radius {radius:.6g} > 1, the estimate grows as exp({rate:.4g} t)"
        return ContinuousStability("unstable", reason, radius, gain, growth_rate=rate)
    if radius >= 1 - _UNIT and _powers_grow(law.K1):
        reason = "K1 has a defective eigenvalue of modulus one, its powers grow without bound"
        return ContinuousStability("unstable", reason, radius, gain)
    if gain < 1 - _UNIT:
        reason = (
            f"each interval multiplies an error by at most {gain:.6g} at every frequency, "
            "so no interval can make it grow"
        )
        return ContinuousStability("stable", reason, radius, gain, 0, 0.0)
    ripple = (
        f"K1 has spectral radius {radius:.6g}, so ripple near multiples of 2 pi/interval "
        "decays ever more slowly towards high frequency"
    )
    if gain <= 1 + _UNIT:
        reason = f"no root is in the open right half-plane; {ripple}"
        return ContinuousStability("marginal", reason, radius, gain, 0, 0.0)
    return _verdict_by_count(law, radius, gain, ripple)


def _verdict_by_count(
    law: LearningLaw, radius: float, gain: float, ripple: str
) -> ContinuousStability:
    """Step 3 of `continuous_stability`: count right of lines that approach the imaginary axis."""
    line, reach = None, None
    for shift in _SHIFTS:
        if radius * np.exp(-shift) >= 1 - _UNIT:
            break
        right_of = shift / law.update_interval
        bound = _root_bound(law, right_of)
        if bound * law.update_interval > 2 * np.pi * _PERIODS:
            break
        roots = _count_roots(law, right_of, bound)
        if roots is None:
            continue
        line, reach = right_of, bound
        if roots:
            reason = f"{roots} roots have a real part above {line:.4g} 1/s"
            return ContinuousStability("unstable", reason, radius, gain, roots, line, reach, line)
        if shift == 0:
            reason = f"no root is in the right half-plane, none could be beyond {reach:.4g} rad/s"
            return ContinuousStability("stable", reason, radius, gain, roots, line, reach)
    if radius >= 1 - _UNIT and _tail_excess(law) > _UNIT:
        reason = (
            f"K1 has spectral radius {radius:.6g} and K2 J^-1 B_f turns its learned harmonics: "
            "infinitely many roots approach the imaginary axis from the right"
        )
        return ContinuousStability("unstable", reason, radius, gain, None, line, reach)
    finding = "the roots cannot be counted on an affordable frequency grid"
    if line is not None:
        finding = f"no root has a real part above {line:.4g} 1/s"
    count = None if line is None else 0
    reason = f"{finding}; {ripple}" if radius >= 1 - _UNIT else f"{finding}, too close to call"
    return ContinuousStability("marginal", reason, radius, gain, count, line, reach)


def _powers_grow(K1: Matrix) -> bool:
    """True if K1, of spectral radius one, has a defective eigenvalue on the unit circle."""
    norms = [np.linalg.norm(np.linalg.matrix_power(K1, 2**power), 2) for power in (10, 14)]
    return bool(norms[1] > 4 * norms[0])  # bounded if semisimple, at least times 16 otherwise


@np.errstate(over="ignore", invalid="ignore")  # what is not finite is refused
def _worst_round_gain(law: LearningLaw) -> float:
    """Supremum of the radius of K1 T(j w) over a frequency grid, infinite if T is not stable."""
    closed = -np.linalg.solve(law.inertia, law.observer_gain + law.fault_matrix @ law.K2)
    if not (np.abs(closed) < _MOST).all():
        raise InputError("K1, K2", "make error dynamics beyond floating-point numbers")
    poles = np.concatenate([np.linalg.eigvals(closed), np.linalg.eigvals(law.rate_matrix)])
    if np.max(poles.real) >= 0:
        return float("inf")
    size = np.abs(poles)
    wide = np.geomspace(1e-3 * size.min(), 1e4 * size.max(), 1500)
    # Resonances of T may be narrower than that grid: sample each in units of its half-width.
    angles = np.tan(np.linspace(-1.5, 1.5, 61))
    near = np.abs(poles.imag)[:, None] + np.abs(poles.real)[:, None] * angles
    frequency = np.concatenate([[0.0], wide, np.abs(near).ravel()])
    trips = _round_trip(law, 1j * frequency)
    if not np.isfinite(trips).all():
        raise InputError("K1, K2", "make error dynamics beyond floating-point numbers")
    eigenvalues = np.linalg.eigvals(trips)
    return max(float(np.max(np.abs(eigenvalues))), spectral_radius(law.K1))


def _round_trip(law: LearningLaw, s: ArrayLike) -> Complex:
    """K1 (I + K2 (J s + Lambda)^-1 B_f)^-1, shape (..., n, n)."""
    with np.errstate(over="ignore", invalid="ignore"):  # of gains that are refused
        return np.asarray(law.K1 @ np.linalg.inv(np.eye(len(law.K1)) + law.loop(s)))


def _tail_excess(law: LearningLaw) -> float:
    """The excess of the radius of K1 T over one where the loop gain is 1e-5.

    Eigenvalues mu of K1 on the unit circle move to mu (1 - q / (j w)); q off the real axis, an
    effect of first order, makes this far above the second-order effects of about 1e-10.
    """
    gain = float(np.linalg.norm(law.K2 @ np.linalg.solve(law.inertia, law.fault_matrix), 2))
    frequency = 1e5 * max(gain, float(np.linalg.norm(law.rate_matrix, 2)))
    return float(np.max(np.abs(np.linalg.eigvals(_round_trip(law, 1j * frequency))))) - 1


def _root_bound(law: LearningLaw, right_of: float) -> float:
    """A modulus [rad/s] that no root with real part at least ``right_of`` [1/s] reaches.

    Beyond it the loop gain (J s + Lambda)^-1 B_f (I - K1 exp(-s tau))^-1 K2 has norm below one,
    because ||(J s + Lambda)^-1|| <= 1 / (s_min(J) |s| - ||Lambda||) and the norm of the other
    inverse is at most the sum of ||K1||^k exp(-k right_of tau), bounded here by repeated squaring.
    """
    power = law.K1 * np.exp(-right_of * law.update_interval)
    memory = 1.0
    while (norm := float(np.linalg.norm(power, 2))) >= 0.5:
        memory *= 1 + norm
        power = power @ power
    memory /= 1 - norm
    loop = float(np.linalg.norm(law.fault_matrix, 2) * np.linalg.norm(law.K2, 2)) * memory
    smallest = float(np.linalg.eigvalsh(law.inertia)[0])
    return (float(np.linalg.norm(law.observer_gain, 2)) + loop) / smallest * (1 + _UNIT)


def _count_roots(law: LearningLaw, right_of: float, bound: float) -> int | None:
    """Roots with real part above ``right_of`` by the argument principle, None if one is on it."""

    def difference(frequency: NDArray[np.float64]) -> Complex:
        s = right_of + 1j * frequency
        memory = law.memory(s)
        ratio = np.linalg.det(memory + law.loop(s)) / np.linalg.det(memory)
        return np.asarray(ratio, dtype=np.complex128)

    # K1 resonates at (angle of an eigenvalue + 2 pi k) / tau; sample each in its half-widths.
    eigenvalues = np.linalg.eigvals(law.K1)
    eigenvalues = np.append(eigenvalues[np.abs(eigenvalues) > 1e-6], np.exp(-1.0))
    width = right_of * law.update_interval - np.log(np.abs(eigenvalues))
    steps = np.sinh(np.linspace(-1, 1, 25)[:, None] * np.arcsinh(np.pi / width)) * width
    turns = 2 * np.pi * np.arange(np.ceil(bound * law.update_interval / (2 * np.pi)) + 2)
    resonances = (np.angle(eigenvalues) + steps)[..., None] + turns
    poles = np.abs(np.linalg.eigvals(law.rate_matrix))
    low = np.geomspace(1e-3 * poles.min(), max(bound, poles.max()), 400)
    grid = np.concatenate([[0.0, bound], low, np.abs(resonances).ravel() / law.update_interval])
    grid = np.unique(grid[grid <= bound])
    values = difference(grid)
    for _ in range(40):
        step = np.abs(np.diff(values))
        coarse = step > 0.5 * np.minimum(np.abs(values[1:]), np.abs(values[:-1]))
        if not coarse.any():
            break
        middle = 0.5 * (grid[1:] + grid[:-1])[coarse]
        where = np.flatnonzero(coarse) + 1
        grid = np.insert(grid, where, middle)
        values = np.insert(values, where, difference(middle))
    else:
        return None
    along = float(np.sum(np.angle(values[1:] / values[:-1])))
    s = right_of + 1j * bound
    loop = np.linalg.solve(law.memory(s), law.loop(s))
    # |eigenvalues| < 1 on the closing arc, so the principal angle is the continuous one.
    closing = float(np.sum(np.angle(1 + np.linalg.eigvals(loop))))
    return round((closing - along) / np.pi)
