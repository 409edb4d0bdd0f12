"""Claims files as trees, and the verdicts on what they say."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from random import Random
from typing import Any
from unittest import mock

from reobserve.evidence.claims.outcomes import Outcome
from reobserve.evidence.claims.registry import read_registry
from reobserve.evidence.claims.robustness import Robustness, Trial
from reobserve.evidence.claims.table import row
from reobserve.plain_data.documents import read_yaml
from reobserve.scoring.metrics import lookup, read_metrics

from .. import material, mutations
from ..case import Case


def make(random: Random) -> Case:
    """A few claims of a paper, one of them changed."""
    paper = random.choice(material.PAPERS)
    tree = material.config(f"config/claims/{paper}.yaml")
    names = random.sample([*tree["claims"]], 3)
    tree["claims"] = {name: tree["claims"][name] for name in names}
    if random.random() < 0.2:
        tree, told = mutations.tree(random, tree)
    else:
        part = random.choice(["claims", "claims", "claims", "choices"])
        part = part if part in tree else "claims"
        name = random.choice([*tree[part]])
        tree[part][name], told = mutations.tree(random, tree[part][name])
        told = f"{name}: {told}"
    return case(paper, tree, told)


def examples() -> Iterator[Case]:
    """The claims as they are."""
    for paper in material.PAPERS:
        yield case(paper, material.config(f"config/claims/{paper}.yaml"), "as they are")


def case(paper: str, tree: Any, told: str) -> Case:
    """Read the claims and decide them by the golden numbers."""
    ledger, numbers = material.ledger(paper), _numbers(paper)

    def run() -> None:
        with mock.patch("reobserve.evidence.claims.registry.read_yaml", read):
            registry = read_registry(material.ROOT, ledger)
        for claim in registry.claims:
            held = Outcome(True, (0.5,) * len(claim.checks))
            trials = [Trial(("x",) * len(claim.knob_names), held)] * 3
            row(claim, ledger, numbers, Robustness(held, claim.knob_names, trials))

    def read(path: Path) -> Any:
        return json.loads(json.dumps(tree)) if path.parent.name == "claims" else read_yaml(path)

    return Case(f"{paper}: {told}", run)


@cache
def _numbers(paper: str) -> Any:
    tables = (material.ROOT / "tests/golden" / paper).glob("*.metrics.csv")
    found = {}
    for table in tables:
        figure = table.name.removesuffix(".metrics.csv")
        found[figure] = _read(material.metrics(paper, figure))
    return found


def _read(content: bytes) -> Any:
    path = material.scratch("metrics.csv")
    path.write_bytes(content)
    return lookup(read_metrics(path))
