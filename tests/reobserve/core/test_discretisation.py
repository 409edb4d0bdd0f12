"""Sampling of linear systems with inputs that are polynomials in each period."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad_vec
from scipy.linalg import expm

from reobserve.core.discretisation import interpolating_hold, polynomial_hold, zero_order_hold
from reobserve.core.errors import InputError


def test_polynomial_inputs_agree_with_the_integral() -> None:
    rng = np.random.default_rng(0)
    A, B, period = rng.normal(size=(3, 3)), rng.normal(size=(3, 2)), 0.3
    transition, effects = polynomial_hold(A, B, period, 3)
    assert transition == pytest.approx(expm(A * period), rel=1e-14)
    for k, effect in enumerate(effects):
        whole, _ = quad_vec(
            lambda s, k=k: expm(A * (period - s)) @ B * (s / period) ** k, 0, period, epsabs=1e-13
        )
        assert effect == pytest.approx(whole, abs=1e-14)


def test_integrators_follow_a_polynomial_exactly() -> None:
    # x1' = x2, x2' = u = 1 - 2 t + 3 t^2 from rest.
    transition, effects = interpolating_hold([[0, 1], [0, 0]], [[0], [1]], 0.5, (0, 1, 0.5))
    samples = [1 - 2 * t + 3 * t * t for t in (0.0, 0.5, 0.25)]
    found = sum(effect[:, 0] * u for effect, u in zip(effects, samples, strict=True))
    t = 0.5
    expected = [t**2 / 2 - t**3 / 3 + t**4 / 4, t - t**2 + t**3]
    assert found == pytest.approx(expected, rel=1e-14)
    assert np.array_equal(transition, [[1.0, 0.5], [0.0, 1.0]])


def test_first_order_hold_of_a_lag_is_exact() -> None:
    # x' = -x + u with u linear from 2 to 5 over T: x = e^-T x0 + ...
    period = 0.7
    decay = np.exp(-period)
    (transition,), effects = interpolating_hold([[-1.0]], [[1.0]], period, (0.0, 1.0))
    found = transition[0] * 4.0 + effects[0, 0, 0] * 2.0 + effects[1, 0, 0] * 5.0
    slope = 3.0 / period
    assert found == pytest.approx(decay * 4.0 + (2 - slope) * (1 - decay) + 3.0, rel=1e-14)


def test_single_node_hold_equals_the_zero_order_hold() -> None:
    A, B = np.array([[-10.0, 1.0], [-0.02, -2.0]]), np.array([[0.0], [2.0]])
    transition, effects = interpolating_hold(A, B, 0.2, (0.0,))
    held, effect = zero_order_hold(A, B, 0.2)
    assert np.array_equal(transition, held)
    assert np.array_equal(effects[0], effect)


def test_holds_refuse_mismatched_shapes() -> None:
    with pytest.raises(InputError, match=r"^A: has shape \(1, 2\), must be square"):
        interpolating_hold([[1.0, 2.0]], [[1.0]], 0.1, (0.0, 1.0))
    with pytest.raises(InputError, match=r"^B: has shape \(1, 1\), must have 2 rows like A"):
        interpolating_hold(np.eye(2), [[1.0]], 0.1, (0.0, 1.0))


@pytest.mark.parametrize("nodes", [(0.5, 0.5), (0.0, 1.0, 0.0), (), [[0.0], [1.0]], 0.5])
def test_holds_refuse_nodes_without_a_unique_polynomial(nodes: Any) -> None:
    with pytest.raises(InputError, match=r"^nodes: .+ must be different numbers$"):
        interpolating_hold(np.eye(2), np.eye(2), 0.1, nodes)
