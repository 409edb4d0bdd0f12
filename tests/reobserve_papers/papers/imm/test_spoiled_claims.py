"""Main claims whose outcome hardly ever changes: with a spoiled gain it does."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest

from reobserve_papers.claims.outcomes import outcome
from reobserve_papers.claims.registry import read_registry
from reobserve_papers.metrics.metrics import Numbers, lookup
from reobserve_papers.papers.imm import theory
from reobserve_papers.parameters.parameters import default_parameters
from reobserve_papers.steps.evaluation import Evaluator
from tests import ROOT

INVERSES = {"pseudo-inverse": np.linalg.pinv, "transpose": np.transpose}


def bounded(patched: pytest.MonkeyPatch, inverse: str) -> Numbers:
    """Full corrections by the transpose of H in place of its inverse, which (15) lacks."""
    linalg = SimpleNamespace(**{**vars(np.linalg), "pinv": INVERSES[inverse]})
    patched.setattr(theory, "np", SimpleNamespace(**{**vars(np), "linalg": linalg}))
    asked = frozenset({"corrected_radius"})
    return {"theory": lookup(Evaluator(default_parameters(ROOT, "imm")).theory(asked))}


SPOILED: dict[str, Callable[[pytest.MonkeyPatch, str], Numbers]] = {"svsf_bounded": bounded}


@pytest.mark.parametrize("inverse", INVERSES)
@pytest.mark.parametrize("name", SPOILED)
def test_claim_fails_with_a_spoiled_gain(
    name: str, inverse: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    claims = read_registry(ROOT, default_parameters(ROOT, "imm")).claims
    claim = next(claim for claim in claims if claim.name == name)
    held = outcome(claim, SPOILED[name](monkeypatch, inverse)) == "holds"
    assert held == (inverse == "pseudo-inverse")
