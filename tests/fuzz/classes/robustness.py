"""The robustness of claims as a file, before the verdicts."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

from reobserve.errors import InputError
from reobserve.evidence.claims.flips import Flip
from reobserve.evidence.claims.outcomes import Outcome
from reobserve.evidence.claims.registry import Claim, read_registry
from reobserve.evidence.claims.robustness import Robustness, Trial
from reobserve.evidence.claims.robustness_file import to_data

from .. import material, mutations
from ..case import Case, command


def make(random: Random) -> Case:
    """The file with a few changes."""
    content = json.dumps(_stored()).encode()
    if random.random() < 0.2:
        content, told = mutations.damaged(random, content)
        return case(content, told)
    stored = json.loads(content)
    if random.random() < 0.3:
        stored, told = mutations.tree(random, stored)
    else:
        name = random.choice([*stored["claims"]])
        stored["claims"][name], told = mutations.tree(random, stored["claims"][name])
    return case(json.dumps(stored).encode(), told)


def examples() -> Iterator[Case]:
    """The file as it should be."""
    yield case(json.dumps(_stored()).encode(), "as it is")


def case(content: bytes, told: str) -> Case:
    """Write the table of claims; a row says if the file is refused."""

    def run() -> None:
        command("stage", "claims", "eso", "--output", "claims.csv", "--project", material.ROOT)
        told = Path("claims.csv").read_text(encoding="utf-8")
        Path("claims.csv").unlink()
        if "robustness.json: " in told:
            raise InputError(
                "claims.csv", next(line for line in told.splitlines() if "json: " in line)
            )

    results = {
        "parameters.json": material.ledger_file("eso").read_bytes(),
        "robustness.json": content,
    }
    for figure in (*material.ledger("eso").tree["figures"], "theory"):
        results[f"{figure}.metrics.csv"] = material.metrics("eso", figure)
    return Case(told, run, {f"results/eso/{name}": part for name, part in results.items()})


@cache
def _stored() -> Any:
    claims = read_registry(material.ROOT, material.ledger("eso")).claims
    flip = Flip("plant.horizon", "s", 20.0, 10.0, 0.5)
    found = {
        claim.name: to_data(_robustness(claim, flip if k % 2 else None))
        for k, claim in enumerate(claims[:5])
    }
    return {"paper": "eso", "seed": 1, "draws": 32, "claims": found}


def _robustness(claim: Claim, flip: Flip | None) -> Robustness:
    """Some draws, of which one does not hold and one diverges."""
    values = tuple(range(len(claim.knob_names)))
    outcomes = [Outcome(k != 3, (k / 3,) * len(claim.checks)) for k in range(12)]
    trials = [Trial(values, outcome) for outcome in (*outcomes, Outcome(False))]
    return Robustness(outcomes[0], claim.knob_names, trials, [2], flip)
