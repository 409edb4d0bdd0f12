"""Intervals and steps: their number and its maximum."""

from __future__ import annotations

import pytest

from reobserve.core.errors import InputError
from reobserve_papers.signals.grid import MAX_STEPS, multiple, plant_grid
from reobserve_papers.signals.piecewise_constant import _count


def test_number_of_steps_is_limited() -> None:
    assert multiple("horizon", float(MAX_STEPS), 1.0, "the step") == MAX_STEPS
    with pytest.raises(InputError) as error:
        multiple("horizon", MAX_STEPS + 1.0, 1.0, "the step")
    assert str(error.value) == "horizon: 1e+08 s is 1e+08 steps, must be 1e+08 at most"


def test_steps_of_a_record_and_levels_of_a_signal_are_limited() -> None:
    assert plant_grid(500.0, 0.5, 1000) == (1000, 0.5)
    with pytest.raises(InputError, match=r"^plant.horizon: 500.5 s is 1e\+03 steps, must be 1000 "):
        plant_grid(500.5, 0.5, 1000)
    assert _count(500_000.0, "half periods", 2) == 500_001
    with pytest.raises(InputError, match=r"^until: asks for 1000002 half periods, .* 1000000 or"):
        _count(500_001.0, "half periods", 2)
