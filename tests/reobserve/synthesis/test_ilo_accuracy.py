"""Steady-state errors against scalar formulas and brute-force simulation."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.synthesis.ilo_accuracy import (
    error_transfer,
    matched_integrator,
    pi_error_transfer,
    predicted_rms_error,
    sampled_error_transfer,
)
from reobserve.synthesis.ilo_error_system import LearningLaw as Law

Array = NDArray[np.float64]
INERTIA = np.array([[36, 1.5, 0], [1.5, 17, 0], [0, 0, 26.0]])
OMEGA = np.array([0.1, 1.0, 10.0, 40.0, 200.0])


def simulate(
    amplitudes: Array,
    frequencies: Array,
    observer_gain: Array,
    K1: Array,
    K2: Array,
    interval: float,
    *,
    per_interval: int,
    settle: float,
    span: float,
    held: bool,
) -> Array:
    """RMS of e over ``span`` after ``settle``, for v learned on the fine grid, or held."""
    h = interval / per_interval
    inverse, n = np.linalg.inv(INERTIA), len(K1)
    implicit = np.linalg.inv(
        np.eye(n) + h / 2 * inverse @ (observer_gain + (0 if held else 1) * K2)
    )
    explicit = np.eye(n) - h / 2 * inverse @ observer_gain
    steps = round((settle + span) / h)
    time = h * np.arange(steps + 1)
    sine = np.where(frequencies == 0, 1.0, np.sin(np.outer(time, frequencies)))
    fault = sine @ amplitudes
    middle = np.where(frequencies == 0, 1.0, np.sin(np.outer(time + h / 2, frequencies)))
    fault_middle = middle @ amplitudes
    v = np.zeros((steps + 1, n))
    w = np.zeros(n)
    for k in range(steps):
        past = v[k + 1 - per_interval] if k + 1 >= per_interval else np.zeros(n)
        if held:
            if k % per_interval == 0:
                v[k] = K1 @ (v[k - 1] if k else np.zeros(n)) + K2 @ w
            torque = 2 * (fault_middle[k] - v[k])
            v[k + 1] = v[k]
            w = implicit @ (explicit @ w + h / 2 * inverse @ torque)
        else:
            # Trapezoidal rule; v at the new time is K1 (past) + K2 (new w).
            torque = fault[k] + fault[k + 1] - v[k] - K1 @ past
            w = implicit @ (explicit @ w + h / 2 * inverse @ torque)
            v[k + 1] = K1 @ past + K2 @ w
    start = round(settle / h)
    error = (fault_middle - v if held else fault - v)[start:steps]
    return np.asarray(np.sqrt(np.mean(error**2, axis=0)))


def test_error_agrees_with_the_scalar_formula() -> None:
    j, lam, k1, k2, tau = 36.0, 100.0, 0.9, 2000.0, 0.01
    s = 1j * OMEGA
    memory = (j * s + lam) * (1 - k1 * np.exp(-s * tau))
    transfer = error_transfer(OMEGA, Law(j, lam, 1.0, k1, k2, tau))
    assert transfer.shape == (5, 1, 1)
    assert transfer[:, 0, 0] == pytest.approx(memory / (memory + k2), rel=1e-12)


def test_identity_learning_removes_constants_and_decouples_the_axes() -> None:
    law = Law(INERTIA, 100.0, 1.0, 1.0, 2000.0, 0.01)
    for transfer in (error_transfer, sampled_error_transfer):
        assert np.abs(transfer(0.0, law)).max() < 1e-12
    moments, axes = np.linalg.eigh(INERTIA)
    full = error_transfer(OMEGA, Law(INERTIA, 100.0, 1.0, 0.9, 2000.0, 0.01))
    diagonal = axes.T @ full @ axes
    for i, moment in enumerate(moments):
        alone = error_transfer(OMEGA, Law(moment, 100.0, 1.0, 0.9, 2000.0, 0.01))[:, 0, 0]
        assert diagonal[:, i, i] == pytest.approx(alone, rel=1e-10)


def test_sampled_transfer_follows_the_scalar_recursion() -> None:
    j, lam, k1, k2, tau, omega = 20.0, 1000.0, 0.95, 900.0, 0.01, 37.0
    a = np.exp(-lam * tau / j)
    w, v, samples = 0.0j, 0.0j, []
    pole = -lam / j
    for k in range(6000):
        v = k1 * v + k2 * w
        samples.append((np.exp(1j * omega * k * tau) - v) / np.exp(1j * omega * k * tau))
        forced = np.exp(1j * omega * k * tau) * (np.exp(1j * omega * tau) - a) / (1j * omega - pole)
        w = a * w + forced / j - (1 - a) / lam * v
    expected = sampled_error_transfer(omega, Law(j, lam, 1.0, k1, k2, tau))[0, 0, 0]
    assert samples[-1] == pytest.approx(expected, rel=1e-9)


MATRICES = [
    (np.eye(3), 500 * np.eye(3), 200 * np.eye(3)),
    (
        np.array([[0.6, 0.1, 0], [0, 0.8, 0.1], [-0.1, 0, 0.7]]),
        np.array([[500, 40, 0], [-60, 400, 10], [0, 30, 300.0]]),
        np.diag([200.0, 150.0, 250.0]),
    ),
]
AMPLITUDES = np.array([[0.5, 0.0, -0.2], [1.0, 0.3, 0.0], [0.0, 0.2, 0.4]])
FREQUENCIES = np.array([0.0, 10.0, 2 * np.pi])


@pytest.mark.parametrize(("K1", "K2", "observer_gain"), MATRICES)
@pytest.mark.parametrize("held", [False, True])
def test_rms_error_agrees_with_simulation(
    K1: Array, K2: Array, observer_gain: Array, held: bool
) -> None:
    simulated = simulate(
        AMPLITUDES,
        FREQUENCIES,
        observer_gain,
        K1,
        K2,
        0.05,
        per_interval=40,
        settle=10.0,
        span=10 * np.pi,  # nearly whole periods of 10 and 2 pi rad/s
        held=held,
    )
    predicted = predicted_rms_error(
        AMPLITUDES,
        FREQUENCIES,
        Law(INERTIA, observer_gain, 1.0, K1, K2, 0.05),
        variant="sampled" if held else "continuous",
    )
    assert predicted == pytest.approx(simulated, rel=0.02)


def test_phase_between_components_matters_only_with_coupling() -> None:
    amplitudes, phases = [[1.0, 1.0]], [[0.0, 1.2]]
    plain = (np.eye(2), 50.0, 1.0, 0.9, 100.0, 0.05)
    same = predicted_rms_error(amplitudes, [3.0], Law(*plain))
    assert predicted_rms_error(amplitudes, [3.0], Law(*plain), phases=phases) == pytest.approx(same)
    coupled = (np.eye(2), 50.0, 1.0, 0.9, [[100.0, 30.0], [0.0, 80.0]], 0.05)
    response = error_transfer(3.0, Law(*coupled))[0] @ np.exp(1j * np.array(phases[0]))
    expected = np.abs(response) / np.sqrt(2)
    assert predicted_rms_error(amplitudes, [3.0], Law(*coupled), phases=phases) == pytest.approx(
        expected
    )


def test_the_sampled_and_the_continuous_variant_agree_on_a_constant() -> None:
    arguments = ([[0.5, 0, 0]], [0.0], Law(INERTIA, 100.0, 1.0, 0.9, 400.0, 0.01))
    expected = 0.5 * 100 * 0.1 / (100 * 0.1 + 400)
    for variant in ("continuous", "sampled"):
        rms = predicted_rms_error(*arguments, variant=variant)
        assert rms == pytest.approx([expected, 0, 0], abs=1e-12)


def test_error_is_proportional_to_the_interval() -> None:
    # Errors of sin(10 t) on the first thruster, gains 2000 and 100, from simulations.
    simulated = {0.2: 0.327, 0.1: 0.203, 0.05: 0.1006, 0.025: 0.0489, 0.0125: 0.0240}
    for interval, value in simulated.items():
        gain = error_transfer(10.0, Law(INERTIA, 100.0, 1.0, 1.0, 2000.0, interval))[0, 0, 0]
        assert abs(gain) == pytest.approx(value, rel=0.01)
    fine = [
        abs(error_transfer(10.0, Law(INERTIA, 100.0, 1.0, 1.0, 2000.0, tau))[0, 0, 0])
        for tau in (1e-4, 1e-5)
    ]
    assert fine[0] / fine[1] == pytest.approx(10, rel=0.02)


def test_identity_learning_is_a_proportional_integral_observer() -> None:
    for interval, tolerance in [(0.01, 2e-3), (0.001, 2e-5)]:
        gains = matched_integrator(2000.0, interval)
        assert gains.integral_gain == pytest.approx(2000 / interval * np.eye(3))
        assert gains.proportional_gain == pytest.approx(1000 * np.eye(3))
        pi = pi_error_transfer(
            10.0, INERTIA, 100.0, 1.0, gains.integral_gain, gains.proportional_gain
        )[0]
        learning = error_transfer(10.0, Law(INERTIA, 100.0, 1.0, 1.0, 2000.0, interval))[0]
        assert np.linalg.norm(pi - learning) < tolerance * np.linalg.norm(learning)


def test_integral_observer_agrees_with_the_scalar_formula() -> None:
    s = 1j * OMEGA
    expected = s * (36 * s + 100) / (s * (36 * s + 100) + 7 * s + 100)
    found = pi_error_transfer(OMEGA, 36.0, 100.0, 1.0, 100.0, 7.0)[:, 0, 0]
    assert found == pytest.approx(expected, rel=1e-12)


def test_invalid_inputs_are_refused() -> None:
    design = (INERTIA, 100.0, 1.0, 1.0, 2000.0, 0.1)
    with pytest.raises(InputError, match="half the update rate"):
        predicted_rms_error([[1, 0, 0]], [40.0], Law(*design), variant="sampled")
    with pytest.raises(InputError, match="differ"):
        predicted_rms_error(np.ones((2, 3)), [1.0, 1.0], Law(*design))
    with pytest.raises(InputError, match="amplitudes"):
        predicted_rms_error([1.0, 0.0, 0.0], [1.0], Law(*design))
    with pytest.raises(InputError, match="omega"):
        error_transfer([-1.0], Law(*design))
