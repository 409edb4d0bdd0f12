"""The largest and smallest numbers in each argument of the papers' functions."""

from __future__ import annotations

import pytest

from tests.reobserve.bad_input.test_extreme_numbers import check_extremes
from tests.reobserve_papers.library.calls import calls

SLOW = "papers.lie.floquet.limit_cycle"
NAMES = [name for name in calls() if name.startswith("papers.") and name != SLOW]


@pytest.mark.parametrize("name", NAMES)
def test_extreme_numbers_give_a_result_or_one_sentence(name: str) -> None:
    check_extremes(calls()[name])
