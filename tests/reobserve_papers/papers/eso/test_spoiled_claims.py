"""Main claims with one outcome in all samples: a spoiled observer gives the other one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from reobserve.synthesis.extended_state import pd_pi
from reobserve.synthesis.extended_state.certificate import certify
from reobserve.synthesis.extended_state.system import AugmentedSystem
from reobserve_papers.claims.outcomes import outcome
from reobserve_papers.claims.registry import read_registry
from reobserve_papers.metrics.metrics import Numbers, lookup
from reobserve_papers.papers.eso.theory_observers import certified
from reobserve_papers.parameters.parameters import default_parameters
from tests import ROOT
from tests.reobserve.synthesis.plants import dc_motor

TRUE = dc_motor()
INEQUALITIES = {  # the systems that (19) is stated for
    "as it is": TRUE,
    "with half of Da": dc_motor(Dd=TRUE.Dd / 2, Dw=TRUE.Dw / 2),
}


def guaranteed(system: AugmentedSystem) -> Numbers:
    """Certificates for the motor of both designs by an inequality, with the gamma of that."""
    least = pd_pi.design_minimum_gamma(system, bound=50.0)
    designs = {"pd_pi": pd_pi.design(system), "minimum_gamma": least}
    return lookup(
        certified({
            name: (TRUE, replace(design, certificate=certify(TRUE, design.gains)))
            for name, design in designs.items()
        })
    )  # fmt: skip


SPOILED: dict[str, Callable[[AugmentedSystem], Numbers]] = {"guarantee": guaranteed}


@pytest.mark.parametrize("inequality", INEQUALITIES)
@pytest.mark.parametrize("name", SPOILED)
def test_claim_fails_with_a_spoiled_inequality(name: str, inequality: str) -> None:
    claims = read_registry(ROOT, default_parameters(ROOT, "eso")).claims
    claim = next(claim for claim in claims if claim.name == name)
    numbers = {"theory": SPOILED[name](INEQUALITIES[inequality])}
    assert (outcome(claim, numbers) == "holds") == (inequality == "as it is")
