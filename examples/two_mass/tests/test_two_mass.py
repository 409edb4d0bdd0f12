"""What the two masses must do, whoever observes them."""

from __future__ import annotations

import numpy as np
from two_mass import Plant, sampled


def test_the_printed_sign_of_the_damper_is_unstable() -> None:
    plant = Plant([1.0, 0.5], 20.0, 0.4, 2.0, 5.0, 0.5, 20.0, 0.01)
    stated, printed = (np.linalg.eigvals(sampled(plant, sign)[0]) for sign in (1.0, -1.0))
    assert max(abs(stated)) < 1.0 + 1e-6 < max(abs(printed))  # at rest or drifting together: 1
