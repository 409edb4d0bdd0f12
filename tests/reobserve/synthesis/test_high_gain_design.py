"""Gains with one parameter, against their equations in exact fractions and by integration."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from reobserve.core.errors import InputError
from reobserve.synthesis.high_gain_design import high_gain, high_gain_over_time, lyapunov_matrix

Array = NDArray[np.float64]


def shift(size: int) -> Array:
    return np.eye(size, k=1)


@pytest.mark.parametrize("rho", [0.5, 3.0])
@pytest.mark.parametrize("size", [1, 2, 5])
def test_matrix_solves_the_lyapunov_equation_exactly(size: int, rho: float) -> None:
    S = np.array([[Fraction(each) for each in row] for row in lyapunov_matrix(size, rho)])
    A = shift(size).astype(int).astype(object)
    left = Fraction(rho) * S + A.T @ S + S @ A
    wanted = np.zeros((size, size))
    wanted[0, 0] = 1.0
    assert left.astype(float) == pytest.approx(wanted, abs=1e-14)


@pytest.mark.parametrize("size", [1, 2, 5])
def test_gain_places_all_poles_at_rho_and_is_the_one_of_the_matrix(size: int) -> None:
    rho, gain = 2.0, high_gain(size, 2.0)
    error = shift(size) - np.outer(gain, np.eye(size)[0])
    assert np.poly(error) == pytest.approx(np.poly(np.full(size, -rho)), rel=1e-9)
    unit = np.eye(size)[0]
    assert gain == pytest.approx(np.linalg.solve(lyapunov_matrix(size, rho), unit), rel=1e-9)


def test_gain_over_time_agrees_with_integration_and_settles() -> None:
    size, rho, initial = 3, 2.0, np.array([[2.0, 0.3, 0.0], [0.3, 1.0, 0.1], [0.0, 0.1, 0.5]])
    A, C = shift(size), np.eye(size)[:1]
    times = np.array([1.0, 0.0, 0.3])

    def slope(t: float, s: Array) -> Array:
        S = s.reshape(size, size)
        found: Array = (-rho * S - A.T @ S - S @ A + C.T @ C).ravel()
        return found

    run = solve_ivp(
        slope, (0, 1), initial.ravel(), "DOP853", t_eval=np.sort(times), rtol=1e-12, atol=1e-14
    )
    wanted = [np.linalg.solve(s.reshape(size, size), C[0]) for s in run.y.T]
    found = high_gain_over_time(size, rho, initial, times)
    assert found[np.argsort(times)] == pytest.approx(np.array(wanted), rel=1e-8)
    assert high_gain_over_time(size, rho, 1.0, [60.0])[0] == pytest.approx(high_gain(size, rho))


def test_sizes_and_numbers_beyond_the_range_are_refused() -> None:
    assert len(high_gain(500, 1e-2)) == 500
    assert high_gain_over_time(170, 1.0, 1.0, [0.0]).shape == (1, 170)
    for call, said in (
        (lambda: high_gain(501, 1e-2), "size: 501 must be a whole number, from 1 to 500"),
        (lambda: high_gain(0, 1.0), "size: 0 must be a whole number, from 1 to 500"),
        (lambda: high_gain(True, 1.0), "size: True must be a whole number"),
        (lambda: high_gain(2, 1e200), "rho: 1e\\+200 1/s must keep S and the gains inside"),
        (lambda: lyapunov_matrix(2, 1e-150), "rho: 1e-150 1/s must keep S"),
        (lambda: high_gain_over_time(171, 1.0, 1.0, [0.0]), "size: 171 must be below 171"),
        (lambda: high_gain_over_time(2, 1.0, 1.0, [0.0, -1.0]), "times: -1 s must not be before"),
        (lambda: high_gain_over_time(2, 1.0, 1.0, 0.0), r"times: has shape \(\), must be a list"),
    ):
        with pytest.raises(InputError, match=said):
            call()
