"""The settings of the theory stage, and its numbers, computed once."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from reobserve.papers.ilo import theory
from reobserve.replication.metrics.metrics import Numbers, lookup
from tests.papers import fixed_ledger


@pytest.fixture(scope="package")
def settings() -> dict[str, Any]:
    ledger = fixed_ledger("ilo")
    return copy.deepcopy(ledger.settings("theory"))


@pytest.fixture(scope="package")
def found(settings: dict[str, Any]) -> Numbers:
    return lookup(theory.measure(settings, {}))


@pytest.fixture
def changed(settings: dict[str, Any]) -> dict[str, Any]:
    """A copy that a test may change, with a run of 4 s to keep it short."""
    mine = copy.deepcopy(settings)
    mine["plant"]["horizon"] = 4.0
    mine["theory"]["stuck"][0]["from"] = 2.0
    return mine
