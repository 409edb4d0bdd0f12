"""What the two masses must do, whoever observes them."""

from __future__ import annotations

import numpy as np

from reobserve.papers.two_mass import Plant, build, sampled

PLANT = Plant([1.0, 0.5], 20.0, 0.4, 2.0, 5.0, 0.5, 20.0, 0.01)


def test_the_printed_sign_of_the_damper_is_unstable() -> None:
    """Free, the masses drift together, and what moves them apart must not grow."""
    largest = [np.abs(np.linalg.eigvals(sampled(PLANT, sign)[0])).max() for sign in (1.0, -1.0)]
    assert largest[0] < 1.0 + 1e-6 < largest[1]


def test_the_error_decays_with_the_poles_of_the_design() -> None:
    poles = [0.8, 0.85, 0.9, 0.95]
    built = build(PLANT, poles, 1.0)
    A, H = built.model.arrays.A, built.model.arrays.H
    left = np.linalg.eigvals((np.eye(4) - built.gain @ H) @ A)
    assert np.allclose(np.sort(left.real), poles, rtol=0, atol=1e-8)
