"""What numba made of all kernels of the papers, as in `tests.reobserve.core.test_machine_code`."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from reobserve_papers.papers.delay import theory_state_gain, without_threshold
from tests.reobserve.core import kernels
from tests.reobserve_papers.library.calls import calls
from tests.reobserve_papers.papers.delay.scalar_plant import ALL, FAST, constant, run


@pytest.fixture(scope="module")
def compiled() -> dict[str, Any]:
    """All kernels by name, after all public functions and what these do not reach."""
    for one in calls().values():
        one.function(*one.arguments)
    for make in ALL.values():
        run(make(0.1), FAST, constant(0.5), 0.5)
    inputs, states = np.ones((5, 4)), np.ones((3, 5))
    theory_state_gain._simulate(inputs, np.ones(4), np.ones(3), np.ones(3), 0.1, states)
    without_threshold._fill(inputs, np.ones(2), np.ones(2), np.ones(2), 0.1, np.ones((3, 2)))
    return kernels.kernels("reobserve_papers")


def test_all_kernels_compile(compiled: dict[str, Any]) -> None:
    missing = [name for name, one in compiled.items() if not kernels.machine_code(one)]
    assert missing == [], "let the fixture call them"


def test_only_kernels_that_make_arrays_count_references(compiled: dict[str, Any]) -> None:
    assert kernels.marked_wrongly(compiled) == []


def test_kernels_that_count_no_references_are_handed_no_new_arrays(
    compiled: dict[str, Any],
) -> None:
    assert kernels.leaking(compiled) == []
