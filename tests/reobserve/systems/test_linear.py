"""Linear models of continuous time, sampled."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from reobserve import InputError, LinearModel


def test_continuous_linear_model_agrees_with_python_control() -> None:
    control = pytest.importorskip("control")
    A, B, C, D = [[0.0, 1.0], [-2.0, -0.3]], [[0.0], [1.5]], [[1.0, 0.0]], [[0.1]]
    made = LinearModel.from_ode(
        A, B, C, D, Q=1e-3, R=1e-2, sampling_period=0.2, state_names=["a", "w"]
    )
    wanted = control.c2d(control.ss(A, B, C, D), 0.2)
    for name in "ABCD":
        np.testing.assert_allclose(getattr(made, name), getattr(wanted, name), rtol=1e-13)
    assert made.sampling_period == 0.2
    assert made.state_names == ("a", "w")
    assert LinearModel.from_ode(A, None, C, Q=1, R=1, sampling_period=0.2).inputs == 0


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"sampling_period": 0}, "sampling_period: 0 must be greater than zero"),
        ({"C": None}, "C: is missing"),
        ({"A": 1.0}, "A: has shape (), must be square"),
        ({"B": [0.0, 1.0]}, "B: has shape (2,)"),
    ],
)
def test_invalid_linear_model_is_refused(given: dict[str, Any], said: str) -> None:
    good = {"A": np.eye(2), "C": np.eye(2), "Q": 1.0, "R": 1.0, "sampling_period": 0.1}
    with pytest.raises(InputError, match="^" + re.escape(said)):
        LinearModel.from_ode(**{**good, **given})
