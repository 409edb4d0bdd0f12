"""Intervals and steps: their number and its maximum."""

from __future__ import annotations

import pytest

from reobserve.core.errors import InputError
from reobserve_papers.signals.grid import MAX_STEPS, multiple


def test_number_of_steps_is_limited() -> None:
    assert multiple("horizon", float(MAX_STEPS), 1.0, "the step") == MAX_STEPS
    with pytest.raises(InputError) as error:
        multiple("horizon", MAX_STEPS + 1.0, 1.0, "the step")
    assert str(error.value) == "horizon: 1e+08 s is 1e+08 steps, must be 1e+08 at most"
