"""The settings of the theory stage, and its numbers, computed once."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from reobserve_papers.metrics.metrics import Numbers, lookup
from reobserve_papers.papers.ilo import keys, theory, theory_runs
from reobserve_papers.parameters.job import read_job
from tests.reobserve_papers.papers import fixed_parameters, merged

INERTIA = np.array([[36, 1.5, 0], [1.5, 17, 0], [0, 0, 26.0]])
MOMENTS = 26.5 + np.array([-1, 1]) * np.sqrt(9.5**2 + 1.5**2)  # by hand: smallest and largest

Measure = Callable[..., Numbers]


def typed(settings: dict[str, Any]) -> keys.Job:
    """The settings of a job as the paper's types."""
    return read_job(keys.Parameters, settings)


@pytest.fixture(scope="package")
def settings() -> dict[str, Any]:
    parameters = fixed_parameters("ilo")
    return copy.deepcopy(parameters.settings("theory"))


@pytest.fixture(scope="package")
def found(settings: dict[str, Any]) -> Numbers:
    return lookup(theory.measure(typed(settings), {}))


@pytest.fixture(scope="package")
def measure(settings: dict[str, Any]) -> Measure:
    """The numbers of a part of `theory_runs`, with some settings changed."""

    def measured(part: str, over: dict[str, Any], base: dict[str, Any] | None = None) -> Numbers:
        job = typed(merged(base or settings, over))
        return lookup(getattr(theory_runs, part)(theory_runs.Runs.of(job)))

    return measured


@pytest.fixture
def changed(settings: dict[str, Any]) -> dict[str, Any]:
    """A copy that a test may change, with a run of 4 s to keep it short."""
    mine = copy.deepcopy(settings)
    mine["plant"]["horizon"] = 4.0
    mine["theory"]["stuck"][0]["from"] = 2.0
    return mine
