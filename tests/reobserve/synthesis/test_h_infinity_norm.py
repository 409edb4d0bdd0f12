"""Closed forms, 50 digits, sweeps and python-control; difficult systems; invalid input."""

from __future__ import annotations

from fractions import Fraction
from math import sqrt
from typing import Any

import control
import mpmath
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from reobserve.core.errors import InputError
from reobserve.synthesis.h_infinity_norm import Norm, h_infinity_norm

Array = NDArray[np.float64]
System = tuple[Array, Array, Array]

JORDAN = -np.eye(4) + np.eye(4, k=1)
SPRING = np.array([[0.0, 1.0], [-1.0, -0.2]])


def encloses(norm: Norm, value: float, tolerance: float = 1e-12) -> bool:
    """Whether the bounds contain a value known up to rounding, and are tight."""
    slack = 4e-16 * value
    close = norm.upper <= norm.lower * (1 + tolerance)
    return close and norm.lower <= value + slack and value - slack <= norm.upper


def stable(seed: int, states: int, inputs: int, outputs: int) -> System:
    """Random, with lightly damped modes, so that gains peak away from zero frequency."""
    rng = np.random.default_rng(seed)
    A = np.zeros((states, states))
    for k in range(0, states, 2):
        pole = rng.uniform(0.02, 0.3), rng.uniform(1, 20)
        A[k : k + 2, k : k + 2] = [[-pole[0], pole[1]], [-pole[1], -pole[0]]]
    basis = np.linalg.qr(rng.normal(size=(states, states)))[0]
    return (
        basis.T @ A @ basis,
        rng.normal(size=(states, inputs)),
        rng.normal(size=(outputs, states)),
    )


def gains(system: System, frequency: Array) -> Array:
    A, B, C = system
    shifted = 1j * frequency[:, None, None] * np.eye(len(A)) - A
    return np.linalg.norm(C @ np.linalg.solve(shifted, B), 2, axis=(1, 2))


def swept(system: System) -> float:
    """The largest gain on a fine grid, refined by golden section."""
    frequency = np.concatenate([[0.0], np.linspace(0.3, 30, 6000), np.geomspace(30, 1e4, 200)])
    found = gains(system, frequency)
    k = int(np.argmax(found))
    if k == 0:
        return float(found[0])
    polished = minimize_scalar(
        lambda w: -gains(system, np.array([w]))[0],
        bracket=(frequency[k - 1], frequency[k], frequency[k + 1]),
        method="golden",
        options={"xtol": 1e-10},
    )
    return -float(polished.fun)


def digits_50(system: System, frequency: float) -> float:
    """The gain at one frequency, from G* G in 50 digits."""
    with mpmath.workdps(50):
        A, B, C = (mpmath.matrix(matrix.tolist()) for matrix in system)
        G = C * (mpmath.mpc(0, frequency) * mpmath.eye(A.rows) - A) ** -1 * B
        return float(mpmath.sqrt(max(mpmath.eighe(G.H * G, eigvals_only=True))))


# --- Closed forms -------------------------------------------------------------------------------


@pytest.mark.parametrize(("pole", "gain"), [(3.0, 10.0), (2.5e5, 1e7), (1e-9, -7.0), (1e80, 2.0)])
def test_first_order_lag_peaks_at_zero_frequency(pole: float, gain: float) -> None:
    norm = h_infinity_norm([[-pole]], [[gain]], [[1.0]])
    assert encloses(norm, abs(gain) / pole)
    assert norm.frequency == 0


@pytest.mark.parametrize("damping", [0.6, 0.1, 1e-3, 1e-7, 2.0**-40])
def test_lightly_damped_oscillator_agrees_with_closed_form(damping: float) -> None:
    norm = h_infinity_norm([[0, 1], [-1, -2 * damping]], [[0], [1]], [[1, 0]])
    assert encloses(norm, 1 / (2 * damping * sqrt(1 - damping**2)))
    assert norm.frequency == pytest.approx(sqrt(1 - 2 * damping**2), rel=1e-6)


def test_overdamped_oscillator_peaks_at_zero_frequency() -> None:
    norm = h_infinity_norm([[0, 1], [-1, -1.6]], [[0], [1]], [[1, 0]])
    assert encloses(norm, 1.0)
    assert norm.frequency == 0


def test_norms_of_columns_and_rows_agree_with_closed_form() -> None:
    # [1 / (s + 1); 3 / (s + 2)]: the sum of squares falls with frequency from 1 + 9/4.
    assert encloses(h_infinity_norm(np.diag([-1.0, -2]), [[1], [3]], np.eye(2)), sqrt(3.25))
    # [3, 4, 12] / (s + 1): 169 over w^2 + 1.
    row = h_infinity_norm([[-1]], [[3, 4, 12]], [[1]])
    assert encloses(row, 13.0)
    assert row.frequency == 0


def test_global_peak_is_found_among_local_ones() -> None:
    # Modes w0^2 c / (s^2 + 2 z w0 s + w0^2), each with its own output: one column.
    modes = [(1.0, 0.5, 30.0), (7.0, 1e-2, 1.0), (90.0, 1e-4, 0.01)]
    A = np.zeros((6, 6))
    B, C = np.zeros((6, 3)), np.zeros((3, 6))
    for k, (w, z, c) in enumerate(modes):
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[0, 1], [-(w**2), -2 * z * w]]
        B[2 * k + 1, k], C[k, 2 * k] = w**2, c
    # The three peaks are 34.64, 50.0025 and 50.00000025.
    norm = h_infinity_norm(A, B, C)
    exact = 1 / (0.02 * sqrt(1 - 1e-4))
    assert norm.lower == pytest.approx(exact, rel=1e-12)
    assert norm.frequency == pytest.approx(7 * sqrt(1 - 2e-4), rel=1e-6)


# --- Independent computations -------------------------------------------------------------------

SHAPES = [(2, 1, 1), (4, 2, 1), (6, 1, 3), (8, 3, 2), (12, 2, 5), (24, 4, 2)]


@pytest.mark.parametrize(("states", "inputs", "outputs"), SHAPES)
def test_norm_agrees_with_a_refined_sweep(states: int, inputs: int, outputs: int) -> None:
    for seed in range(1 if states == 24 else 3):
        system = stable(seed, states, inputs, outputs)
        norm = h_infinity_norm(*system)
        assert norm.lower == pytest.approx(swept(system), rel=1e-9)
        assert norm.upper <= norm.lower * (1 + 1e-12)


def test_lower_bound_agrees_with_the_gain_in_50_digits() -> None:
    for seed in range(3):
        system = stable(seed, 6, 2, 3)
        norm = h_infinity_norm(*system)
        assert norm.lower == pytest.approx(digits_50(system, norm.frequency), rel=1e-15)


@pytest.mark.parametrize(("states", "inputs", "outputs"), SHAPES[:-1])
def test_dual_system_has_the_same_norm(states: int, inputs: int, outputs: int) -> None:
    A, B, C = stable(7, states, inputs, outputs)
    one, dual = h_infinity_norm(A, B, C), h_infinity_norm(A.T, C.T, B.T)
    assert dual.lower == pytest.approx(one.lower, rel=1e-12)
    assert max(one.lower, dual.lower) <= min(one.upper, dual.upper)


def test_descriptor_form_has_the_same_norm() -> None:
    # Entries short enough for E A and E B to be exact.
    A, B, C = (np.round(matrix * 2**16) / 2**16 for matrix in stable(3, 6, 2, 1))
    E = np.random.default_rng(5).integers(-99, 100, size=(6, 6)).astype(np.float64)
    plain = h_infinity_norm(A, B, C)
    descriptor = h_infinity_norm(E @ A, E @ B, C, E)
    assert descriptor.lower == pytest.approx(plain.lower, rel=1e-14)
    assert descriptor.frequency == pytest.approx(plain.frequency, rel=1e-9)
    # Powers of two are exact.
    for scale in (0.25, np.full(6, 0.25)):
        assert h_infinity_norm(A / 4, B / 4, C, scale) == plain


def test_norm_agrees_with_python_control() -> None:
    for seed in range(3):
        system = stable(seed, 6, 2, 2)
        theirs = control.norm(
            control.ss(*system, np.zeros((2, 2))), "inf", tol=1e-10, method="scipy"
        )
        assert h_infinity_norm(*system).lower == pytest.approx(theirs, rel=1e-9)


# --- Difficult systems --------------------------------------------------------------------------


def test_poles_and_gains_of_very_different_sizes_are_handled() -> None:
    poles, sizes = np.array([3.0, 41, 700, 6e4, 2.5e5]), np.array([1.0, 1e3, 20, 1e7, 1e7])
    # A sum of positive lags peaks at zero; in another basis, all of them are observable.
    basis = np.random.default_rng(2).integers(-9, 10, size=(5, 5)) + 20 * np.eye(5)
    A = np.linalg.solve(basis, -np.diag(poles) @ basis)
    B, C = np.linalg.solve(basis, sizes[:, None]), np.ones((1, 5)) @ basis
    norm = h_infinity_norm(A, B, C)
    assert norm.frequency == 0
    assert norm.lower == pytest.approx(digits_50((A, B, C), 0.0), rel=1e-15)
    assert norm.lower == pytest.approx(float(np.sum(sizes / poles)), rel=1e-9)


def test_scaling_the_states_changes_nothing() -> None:
    A, B, C = stable(1, 6, 2, 3)
    scale = 2.0 ** np.array([-40, 35, 0, 28, -17, 3])
    plain = h_infinity_norm(A, B, C)
    scaled = h_infinity_norm(A * scale[:, None] / scale, B * scale[:, None], C / scale)
    assert scaled.lower == pytest.approx(plain.lower, rel=1e-14)


def test_no_gain_is_above_the_upper_bound() -> None:
    for seed in range(3):
        # A basis of condition 1e4 shifts the computed eigenvalues.
        A, B, C = stable(seed, 6, 2, 2)
        left, right = (np.linalg.qr(part)[0] for part in (A[::-1] + 1, A.T + 2))
        basis = left * np.geomspace(1, 1e4, 6) @ right
        system = np.linalg.solve(basis, A @ basis), np.linalg.solve(basis, B), C @ basis
        norm = h_infinity_norm(*system, tolerance=1e-14)
        assert norm.upper <= norm.lower * (1 + 1e-14)
        near = norm.frequency * (1 + np.linspace(-1e-7, 1e-7, 11))
        far = np.append(0.0, np.geomspace(0.5, 40, 60))
        assert max(digits_50(system, frequency) for frequency in (*near, *far)) <= norm.upper
        assert digits_50(system, norm.frequency) >= norm.lower * (1 - 1e-15)


def test_multiple_and_defective_poles_are_handled() -> None:
    # 1 / (s + 1)^4, and one oscillator three times.
    assert encloses(h_infinity_norm(JORDAN, np.eye(4)[:, 3:], np.eye(4)[:1]), 1.0)
    three = [np.kron(np.eye(3), part) for part in (SPRING, [[0.0], [1.0]], [[1.0, 0.0]])]
    assert encloses(h_infinity_norm(*three), 1 / (0.2 * sqrt(0.99)))


def test_two_equal_peaks_are_handled() -> None:
    # s / (s^2 + 0.1 s + w0^2) has the peak 10 at w0, here 1 and 4 at once, in two channels.
    A, B, C = np.zeros((4, 4)), np.zeros((4, 2)), np.zeros((2, 4))
    for k, w in enumerate([1.0, 4.0]):
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[0, 1], [-(w**2), -0.125]]
        B[2 * k + 1, k] = C[k, 2 * k + 1] = 1.0
    norm = h_infinity_norm(A, B, C)
    assert encloses(norm, 8.0)
    assert norm.frequency in (pytest.approx(1.0), pytest.approx(4.0))


def test_zero_system_has_zero_norm() -> None:
    assert h_infinity_norm([[-1]], [[0]], [[2]]) == Norm(0.0, 0.0, 0.0)
    hidden = h_infinity_norm(np.diag([-1.0, -2]), [[1], [0]], [[0, 1]])
    assert hidden.lower == 0
    assert 0 < hidden.upper < 1e-60


def test_coarser_tolerance_widens_the_bounds() -> None:
    system = stable(2, 6, 2, 1)
    fine, coarse = h_infinity_norm(*system), h_infinity_norm(*system, tolerance=1e-3)
    assert coarse.lower <= fine.upper
    assert fine.lower <= coarse.upper <= coarse.lower * (1 + 1e-3)


# --- Bad input ----------------------------------------------------------------------------------

GOOD: dict[str, Any] = {"A": [[-1, 0], [0, -2]], "B": [[1], [1]], "C": [[1, 0]]}


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"A": [[1, 0], [0, -2]]}, r"A: eigenvalue 1\+0j of s E - A must be left of the .* axis"),
        ({"A": [[0, 1], [0, -2]]}, r"A: eigenvalue 0\+0j of s E - A is not proved to be left .*"),
        ({"A": [[0, 4], [-1, 0]]}, r"A: eigenvalue .*0[+-]2j of s E - A is not proved .*"),
        ({"E": [1, -2]}, r"A: eigenvalue 1\+0j of s E - A must be left of the imaginary axis"),
        ({"E": [[1, 2], [2, 4]]}, "E: must have an inverse"),
        ({"E": 0}, "E: must have an inverse"),
        ({"E": [1, 2, 3]}, r"E: has shape \(3,\), must be one number .*"),
        ({"A": [[-1, 0]]}, r"A: has shape \(1, 2\), must be \(1, 1\) and not empty"),
        ({"A": np.zeros((0, 0))}, r"A: has shape \(0, 0\), must be \(0, 0\) and not empty"),
        ({"B": [[1]]}, r"B: has shape \(1, 1\), must be \(2, 1\) and not empty"),
        ({"B": [1, 1]}, r"B: has shape \(2,\), must be \(samples, n\)"),
        ({"B": np.zeros((2, 0))}, r"B: has shape \(2, 0\), must be \(2, 0\) and not empty"),
        ({"C": [[1, 0, 0]]}, r"C: has shape \(1, 3\), must be \(1, 2\) and not empty"),
        ({"tolerance": 0.0}, "tolerance: 0 must be greater than zero"),
        ({"tolerance": 1e-16}, "tolerance: 1e-16 must be 1e-14 or more"),
        ({"B": [[1e200], [1]], "C": [[1e200, 1]]}, "C: must keep the norm inside the float range"),
    ],
)
def test_wrong_systems_are_refused(changed: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=f"^{said}$"):
        h_infinity_norm(**{**GOOD, **changed})


@pytest.mark.parametrize("outputs", [2, 3, 5, 6, 7])
def test_bounds_enclose_an_irrational_gain_exactly(outputs: int) -> None:
    """G = [1; 1; ...] has the irrational norm sqrt(p), which lies strictly between the bounds."""
    column = np.ones((outputs, 1))
    norm = h_infinity_norm([[-1.0]], [[1.0]], column)
    assert Fraction(norm.lower) ** 2 <= outputs <= Fraction(norm.upper) ** 2
    assert encloses(norm, sqrt(outputs))
