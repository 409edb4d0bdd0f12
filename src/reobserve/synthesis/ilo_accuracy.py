r"""Steady-state accuracy of the learning observer, linearised (Chen & Saif 2007, (3) and (4)).

How much of a fault torque ``u_f`` the estimate ``v`` of (3) misses: transfers from ``u_f`` to
e = u_f - v, for ``v`` learning at every instant ("continuous") and for ``v`` updated every
``interval`` and held ("sampled"); and the integral observer that K1 = I amounts to. A steady state
exists for the designs that `continuous_stability` or `sampled_stability` call stable.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_kind, as_word
from reobserve.core.errors import InputError
from reobserve.core.finite import finite
from reobserve.core.matrices import Matrix, as_floats, as_matrix, as_positive
from reobserve.synthesis.ilo_error_system import Complex, LearningLaw, solved
from reobserve.synthesis.ilo_sampled_stability import held_blocks

Variant = Literal["continuous", "sampled"]


def _frequencies(name: str, value: ArrayLike) -> NDArray[np.float64]:
    omega = np.atleast_1d(as_floats(name, value))
    if omega.ndim != 1 or np.any(omega < 0):
        raise InputError(name, f"{omega.tolist()} must be a list of numbers, none below zero")
    return omega


@finite("omega")
def error_transfer(
    omega: ArrayLike,
    law: LearningLaw,
) -> Complex:
    r"""Transfer matrix from the fault to its estimation error, v learning at every instant.

    With z = exp(-s tau) and G = (J s + Lambda)^-1 B_f, (4) gives w~ = G e and (3) gives
    (I - K1 z)(u_f - e) = K2 G e. Hence, at s = j omega,

    .. math:: E(s) = [I - K_1 z + K_2 G(s)]^{-1} (I - K_1 z)

    which is zero at omega = 0 if K1 = I.

    Parameters
    ----------
    omega
        Frequencies [rad/s], shape (k,).
    law
        See `LearningLaw`.

    Returns
    -------
    Complex
        E(j omega) [N m / N m], shape (k, n, n).

    Raises
    ------
    InputError
        If it is no such law or a frequency is negative.
    """
    as_kind("law", law, LearningLaw)
    return _continuous(law, _frequencies("omega", omega))


def _continuous(law: LearningLaw, omega: NDArray[np.float64]) -> Complex:
    memory = law.memory(1j * omega)
    return np.asarray(solved(memory + law.loop(1j * omega), memory))


@finite("omega")
def sampled_error_transfer(
    omega: ArrayLike,
    law: LearningLaw,
) -> Complex:
    """Transfer matrix from the fault to its error at the updates, v held in between.

    For u_f = U exp(j omega t) the samples at t_k = k tau are w~ = W exp(j omega t_k) and
    v = V exp(j omega t_k), V being held until the next update. With A and the response D to a
    held torque from the exact discretisation, and zeta = exp(j omega tau),

        (zeta I - A) W + D V = H U,    H = (j omega I + J^-1 Lambda)^-1 (zeta I - A) J^-1 B_f,
        (I - K1 / zeta) V = K2 W,

    and the transfer is I - V U^-1, the error right after each update. Between updates e also
    holds harmonics of the update rate, which `predicted_rms_error` counts.

    Returns
    -------
    Complex
        [N m / N m], shape (k, n, n); parameters as in `error_transfer`.

    Raises
    ------
    InputError
        If it is no such law or a frequency is negative.
    """
    as_kind("law", law, LearningLaw)
    frequency = _frequencies("omega", omega)
    return np.asarray(np.eye(len(law.K1)) - _held(law, frequency))


def _held(law: LearningLaw, omega: NDArray[np.float64]) -> Complex:
    """V U^-1 of `sampled_error_transfer`, shape (k, n, n)."""
    size = len(law.inertia)
    decay, drive = held_blocks(law)
    s = 1j * omega[:, None, None]
    turned = np.exp(s * law.update_interval) * np.eye(size) - decay
    torque = solved(law.inertia, law.fault_matrix)
    fault = solved(s * np.eye(size) - law.rate_matrix, turned @ torque)
    both = np.zeros((len(omega), 2 * size, 2 * size), dtype=np.complex128)
    both[:, :size, :size] = turned
    both[:, :size, size:] = drive
    both[:, size:, :size] = -law.K2
    both[:, size:, size:] = law.memory(1j * omega)
    forcing = np.concatenate([fault, np.zeros_like(fault)], axis=1)
    return np.asarray(solved(both, forcing)[:, size:])


@finite("amplitudes")
def predicted_rms_error(
    amplitudes: ArrayLike,
    frequencies: ArrayLike,
    law: LearningLaw,
    *,
    phases: ArrayLike = 0.0,
    variant: Variant = "continuous",
) -> NDArray[np.float64]:
    """RMS over time of each component of e in steady state, for a fault that is a sum of sines.

    The fault is sum_k amplitudes[k] sin(frequencies[k] t + phases[k]), where a frequency of zero
    stands for the constant amplitudes[k]. Powers of distinct frequencies add. In the sampled
    variant e at t_k + r is U exp(j omega r) - V, times exp(j omega t_k); its mean power over
    0 <= r < tau, (|U|^2 + |V|^2)/2 - Re[conj(U) V (1 - exp(-j omega tau))/(j omega tau)], is
    exact for frequencies below half the update rate, where samples of distinct sines stay
    uncorrelated.

    Parameters
    ----------
    amplitudes, phases
        [N m] and [rad], shape (k, n): one row per sine, one column per torque.
    frequencies
        [rad/s], shape (k,), all distinct.
    law
        See `LearningLaw`.
    variant
        "continuous" or "sampled".

    Returns
    -------
    NDArray
        RMS of e [N m], shape (n,).

    Raises
    ------
    InputError
        If it is no such law, a shape is wrong, a frequency is negative or repeated, or, in the
        sampled variant, at or above half the update rate.

    Examples
    --------
    >>> from reobserve.synthesis.ilo_accuracy import predicted_rms_error
    >>> from reobserve import RigidBody, SampledILO
    >>> observer = SampledILO(RigidBody([36, 17, 26]), K1=1.0, K2=500.0, observer_gain=500.0,
    ...                       update_interval=0.01, sampling_period=0.01)
    >>> error = predicted_rms_error([[1.0, 0, 0]], [10.0], observer.law, variant="sampled")
    >>> print(error[0].round(3))  # [N m], of the fault sin 10 t about the first axis
    0.095
    """
    as_kind("law", law, LearningLaw)
    omega = _frequencies("frequencies", frequencies)
    shape = (len(omega), len(law.inertia))
    size = as_floats("amplitudes", amplitudes)
    angle = as_floats("phases", phases)
    if size.shape != shape:
        raise InputError("amplitudes", f"has shape {size.shape}, must be (sines, torques) {shape}")
    if angle.shape not in ((), shape):
        raise InputError("phases", f"has shape {angle.shape}, must be one number or {shape}")
    if len(np.unique(omega)) < len(omega):
        raise InputError("frequencies", f"{omega.tolist()} must all differ")
    constant = omega[:, None] == 0
    torque = np.where(constant, size, size * np.exp(1j * angle))
    if as_word("variant", variant, ("continuous", "sampled")) == "continuous":
        error = np.einsum("kij,kj->ki", _continuous(law, omega), torque)
        power = np.abs(error) ** 2
    else:
        nyquist = np.pi / law.update_interval
        if np.any(omega >= nyquist):
            raise InputError(
                "frequencies",
                f"{omega.max():g} rad/s must be below half the update rate, {nyquist:g} rad/s",
            )
        estimate = np.einsum("kij,kj->ki", _held(law, omega), torque)
        half = omega[:, None] * law.update_interval / 2
        # (1 - exp(-j omega tau)) / (j omega tau), and one for a constant.
        mean = np.exp(-1j * half) * np.sinc(half / np.pi)
        cross = np.real(np.conj(torque) * estimate * mean)
        # The difference of squares, arranged so that a small error keeps its digits.
        lag = np.real(np.conj(torque) * estimate) - cross
        power = np.abs(torque - estimate) ** 2 + 2 * lag
    total = np.sum(np.where(constant, power, power / 2), axis=0)
    return np.asarray(np.sqrt(np.maximum(total, 0.0)))


@dataclass(frozen=True)
class IntegralGains:
    """Gains of v = proportional_gain w~ + integral_gain (integral of w~): [N m s] and [N m]."""

    integral_gain: Matrix
    proportional_gain: Matrix


@finite("K2")
def matched_integrator(K2: ArrayLike, interval: float) -> IntegralGains:
    """The proportional-integral observer that K1 = I approximates for a small interval.

    With K1 = I, v = K2 / (1 - exp(-s tau)) w~, and 1 / (1 - exp(-x)) = 1/x + 1/2 + O(x): an
    integrator of gain K2 / tau with a proportional gain K2 / 2, up to frequencies of about
    1 / tau. ``K2`` [N m s] is a number, a diagonal or 3 x 3; ``interval`` [s].

    Raises
    ------
    InputError
        If ``K2`` has another shape or ``interval`` is not above zero.
    """
    gain = as_matrix("K2", K2, 3)
    return IntegralGains(gain / as_positive("interval", interval), gain / 2)


@finite("omega, integral_gain")
def pi_error_transfer(
    omega: ArrayLike,
    inertia: ArrayLike,
    observer_gain: ArrayLike,
    fault_matrix: ArrayLike,
    integral_gain: ArrayLike,
    proportional_gain: ArrayLike = 0.0,
) -> Complex:
    """Transfer matrix from the fault to its error for a proportional-integral observer.

    v = (P + Gamma / s) w~ and w~ = G e with G = (J s + Lambda)^-1 B_f, so that
    e = [s I + (P s + Gamma) G]^-1 s u_f. A proportional gain of zero is the adaptive observer
    whose estimate is a pure integral of the rate error.

    Parameters
    ----------
    omega
        Frequencies [rad/s], shape (k,).
    inertia, observer_gain, fault_matrix
        As in `LearningLaw`.
    integral_gain, proportional_gain
        Gamma [N m] and P [N m s]: a number, a diagonal or n x n.

    Returns
    -------
    Complex
        [N m / N m], shape (k, n, n).

    Raises
    ------
    InputError
        As `LearningLaw`; or if a frequency is negative.
    """
    law = LearningLaw(inertia, observer_gain, fault_matrix, 0.0, 1.0, 1.0)
    size = len(law.inertia)
    integral = as_matrix("integral_gain", integral_gain, size)
    proportional = as_matrix("proportional_gain", proportional_gain, size)
    s = 1j * _frequencies("omega", omega)[:, None, None]
    plant = solved(s * law.inertia + law.observer_gain, law.fault_matrix)
    unit = s * np.eye(size)
    return np.asarray(solved(unit + (proportional * s + integral) @ plant, unit))
