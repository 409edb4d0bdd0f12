"""Small plants of extended state observers."""

from __future__ import annotations

from typing import Any

import numpy as np

from reobserve.synthesis.extended_state.system import AugmentedSystem


def dc_motor(**changed: Any) -> AugmentedSystem:
    """A DC motor with J = b / 10 = 0.01, Ke = Kt = 0.01, R = 1, L = 0.5."""
    matrices = {
        "A": [[-10.0, 1.0], [-0.02, -2.0]],
        "B": [[0.0], [2.0]],
        "C": [[1.0, 0.0], [0.0, 1.0]],
        "Dd": [[1.0, 0.0], [0.0, 2.0]],
        "Dw": [[1.0], [0.0]],
        "Fa": [[0.0], [2.0]],
        "Fs": [[1.0], [0.0]],
    }
    return AugmentedSystem(**{**matrices, **changed})


def random_plant(seed: int, states: int, outputs: int = 2, **changed: Any) -> AugmentedSystem:
    """Stable, with an actuator fault at the last state and a sensor fault at the first output."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(states, states)) / np.sqrt(states)
    matrices = {
        "A": A - (0.5 + np.linalg.eigvals(A).real.max()) * np.eye(states),
        "B": np.eye(states, 1, 1 - states),
        "C": rng.normal(size=(outputs, states)),
        "Dd": rng.normal(size=(states, 1)),
        "Dw": rng.normal(size=(outputs, 1)),
        "Fa": np.eye(states, 1, 1 - states),
        "Fs": np.eye(outputs, 1),
    }
    return AugmentedSystem(**{**matrices, **changed})
