"""Config files of papers, as trees: missing, misspelt and odd keys, values of any kind."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import Any
from unittest import mock

from reobserve.plain_data.documents import read_yaml

from .. import material, mutations
from ..case import Case, command


def make(random: Random) -> Case:
    """A ledger with a few changes; mostly outside of words that only people read."""
    paper = random.choice(material.PAPERS)
    tree = material.paper_tree(paper)
    section = random.choice([*tree, None])
    if section is None:
        changed, told = mutations.tree(random, tree)
    else:
        changed = tree
        changed[section], told = mutations.tree(random, tree[section])
        told = f"{section}: {told}"
    return case(paper, changed, told)


def examples() -> Iterator[Case]:
    """The ledgers as they are."""
    for paper in material.PAPERS:
        yield case(paper, material.paper_tree(paper), "as it is")


def case(paper: str, tree: Any, told: str) -> Case:
    """Load a ledger and check it, as a build does before its first job."""

    def run() -> None:
        # A tree that YAML has read already: what reads bytes is another class.
        with mock.patch("reobserve.ledger.ledger.read_yaml", read):
            command(
                "stage",
                "parameters",
                paper,
                "--project",
                material.ROOT,
                "--output",
                "parameters.json",
            )

    def read(path: Path) -> Any:
        if path.parent.name == "papers":
            return json.loads(json.dumps(tree))
        return read_yaml(path)

    return Case(f"{paper}: {told}", run)
