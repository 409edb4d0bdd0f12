"""Rows of measurements and inputs belong together as the contract says: known truths tell."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from tests.observers.cases_delay import DELAY_CASES, Array, Case


def moved(values: Array) -> Iterator[Array]:
    """A row late and a row early."""
    yield np.concatenate([values[:1], values[:-1]])
    yield np.concatenate([values[1:], values[-1:]])


def worst_error(case: Case, **changed: Any) -> float:
    """The largest error once settled, as a multiple of its bound."""
    run = case.observer.run(**{"y": case.y, "u": case.u, "state": case.state, **changed})
    return max(
        float(np.abs(run[name] - truth)[case.settled :].max()) / case.bounds[name]
        for name, truth in case.truth.items()
    )


@pytest.mark.parametrize("name", DELAY_CASES)
def test_rows_as_the_contract_says_give_the_truth_and_others_do_not(name: str) -> None:
    case = DELAY_CASES[name]()
    aligned = worst_error(case)
    assert aligned < 1.0
    for y in moved(case.y):
        assert worst_error(case, y=y) > max(case.worse * aligned, 1.0)
    if case.u is not None:
        for u in moved(case.u):
            assert worst_error(case, u=u) > max(case.worse * aligned, 1.0)
