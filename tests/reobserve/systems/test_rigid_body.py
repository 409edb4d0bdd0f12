"""Euler's equation by hand and against cross products; invalid bodies."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.stats import special_ortho_group

from reobserve.core.errors import InputError
from reobserve.systems.rigid_body import RigidBody
from reobserve.systems.rigid_body_arithmetic import acceleration, product


def test_acceleration_agrees_with_hand_calculation() -> None:
    # w x J w = (1, 1, 1) x (1, 2, 3) = (1, -2, 1); its sign decides that of every component.
    inertia = np.diag([1.0, 2.0, 3.0])
    found = acceleration(inertia, np.linalg.inv(inertia), (1.0, 1.0, 1.0), (0.0, 0.0, 0.0))
    assert found == pytest.approx((-1.0, 1.0, -1.0 / 3.0), abs=1e-15)


def test_kernels_agree_with_cross_products() -> None:
    rng = np.random.default_rng(5)
    for _ in range(50):
        root = rng.normal(size=(3, 3))
        inertia = root @ root.T + np.eye(3)
        rate, torque = rng.normal(size=(2, 3))
        assert product(root, *rate) == pytest.approx(root @ rate, rel=1e-12, abs=1e-12)
        expected = np.linalg.solve(inertia, torque - np.cross(rate, inertia @ rate))
        found = acceleration(inertia, np.linalg.inv(inertia), tuple(rate), tuple(torque))
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_rotated_inertia_is_symmetrised() -> None:
    """R J R^T is symmetric up to rounding only; it is replaced by its symmetric part."""
    refused_before = 0
    for seed in range(200):
        axes = special_ortho_group.rvs(3, random_state=seed)
        moments = 10.0 ** np.random.default_rng(seed).uniform(-3, 3) * np.array([36.0, 17.0, 26.0])
        rotated = axes @ np.diag(moments) @ axes.T
        refused_before += not np.array_equal(rotated, rotated.T)
        inertia = RigidBody(rotated).inertia
        assert np.array_equal(inertia, inertia.T)
        assert np.abs(inertia - rotated).max() <= 1e-15 * moments.max()
        assert np.linalg.eigvalsh(inertia) == pytest.approx(np.sort(moments), rel=1e-13)
    assert refused_before > 50


def test_symmetric_inertia_keeps_its_numbers() -> None:
    root = np.random.default_rng(3).normal(size=(3, 3))
    inertia = root + root.T + 9.0 * np.eye(3)
    assert RigidBody(inertia).inertia.tobytes() == inertia.tobytes()


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e200])
def test_asymmetry_beyond_rounding_is_refused(scale: float) -> None:
    inertia = scale * np.array([[36.0, 1.5, 0.0], [1.5, 17.0, 0.0], [0.0, 0.0, 26.0]])
    inertia[0, 1] *= 1.0 + 1e-11 * 36.0 / 1.5 / 3.0  # 3.3 times the tolerance
    with pytest.raises(InputError, match="must be symmetric"):
        RigidBody(inertia)
    inertia[0, 1] = inertia[1, 0] * (1.0 + 0.3e-12 * 36.0 / 1.5)
    RigidBody(inertia)


SHAPE = r"has shape \({}\), must be one number \(times the identity\), 3 numbers .* 3 x 3"
BAD_BODIES: list[tuple[Any, str]] = [
    (
        np.diag([1.0, 2.0, -3.0]),
        r"^inertia: must be positive definite, .* eigenvalues are -3, 1, 2$",
    ),
    (np.diag([1.0, 2.0, 0.0]), r"^inertia: must be positive definite, .* eigenvalues are 0, 1, 2$"),
    ([[2, 1, 0], [0, 2, 0], [0, 0, 2]], r"^inertia: \[\[2.0, 1.0, 0.0\].* must be symmetric$"),
    (np.eye(2), "^inertia: " + SHAPE.format("2, 2")),
    ([1.0, 2.0], "^inertia: " + SHAPE.format("2,")),
    ([[1, 2, 3], [4, 5]], r"^inertia: .* is not a number or an array of numbers$"),
    ("heavy", r"^inertia: 'heavy' is not a number"),
    ([1.0, np.inf, 1.0], r"^inertia: \[1.0, inf, 1.0\] has an entry that is not finite$"),
]


@pytest.mark.parametrize(("inertia", "sentence"), BAD_BODIES)
def test_invalid_inertia_is_refused(inertia: Any, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        RigidBody(inertia)


@pytest.mark.parametrize(
    ("matrices", "sentence"),
    [
        ((np.ones((3, 2)),), "^input_matrix: " + SHAPE.format("3, 2")),
        ((1.0, np.ones(4)), "^fault_matrix: " + SHAPE.format("4,")),
    ],
)
def test_invalid_matrices_are_refused(matrices: tuple[Any, ...], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        RigidBody([36.0, 17.0, 26.0], *matrices)
