"""Main claims with one outcome in all samples: a spoiled observer gives the other one."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

from reobserve.observers.extended_high_gain import ExtendedHighGainObserver
from reobserve_papers.claims.outcomes import metrics_of, outcome
from reobserve_papers.claims.registry import Claim, read_registry
from reobserve_papers.metrics.metrics import Numbers, lookup
from reobserve_papers.papers.delay import theory_gains
from reobserve_papers.steps.evaluation import Evaluator
from tests import ROOT
from tests.reobserve_papers.papers import fixed_parameters

# One gain and few runs: the checks name no more.
SETTINGS: dict[str, Any] = {
    "studies": {"tradeoff": {"rhos": [2.5], "runs": 1}},
    "theory": {"rhos": [2.5], "cases": 10},
}


@cache
def plants() -> Evaluator:
    """An evaluator with the records of the plants, which nothing spoils."""
    evaluator = Evaluator(fixed_parameters("delay", SETTINGS))
    for scenario in ("ramp", "sine", "lag"):
        evaluator.result("plant", scenario)
    return evaluator


@cache
def unspoiled() -> Evaluator:
    evaluator = plants().isolated()
    evaluator.result("theory")  # as a whole, so that it is known which parts claims need
    return evaluator


def numbers_of(claim: Claim, evaluator: Evaluator) -> dict[str, Numbers]:
    """The numbers that a claim asks for, computed from the records."""
    asked = frozenset(ref.metric for ref in claim.references("theory"))
    return {figure: lookup(metrics_of(evaluator, figure, asked)) for figure in claim.figures}


def wrong_sign(monkeypatch: pytest.MonkeyPatch) -> None:
    """The last of the gains S^-1 C^T, that of the delay, with the wrong sign."""
    gains, column = ExtendedHighGainObserver._gains, theory_gains.high_gain

    def spoiled(self: ExtendedHighGainObserver, times: Any) -> Any:
        return gains(self, times) * np.append(np.ones(self.model.states), -1.0)

    monkeypatch.setattr(ExtendedHighGainObserver, "_gains", spoiled)
    monkeypatch.setattr(theory_gains, "high_gain", lambda n, rho: column(n, rho) * [1, 1, -1])


SPOILED: dict[str, Callable[[pytest.MonkeyPatch], None]] = {
    "bounded_error": wrong_sign,
    "works_for_varying_delays": wrong_sign,
}


@pytest.mark.parametrize("name", SPOILED)
def test_each_check_fails_with_a_spoiled_gain(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    claims = read_registry(ROOT, plants().parameters).claims
    claim = next(claim for claim in claims if claim.name == name)
    assert outcome(claim, numbers_of(claim, unspoiled())) == "holds"
    SPOILED[name](monkeypatch)
    spoiled = numbers_of(claim, plants().isolated())
    assert outcome(claim, spoiled) != "holds"
    assert not any(check.holds(spoiled) for check in claim.checks)
