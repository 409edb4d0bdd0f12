"""Tables of equations as trees, and numbers that are asked for."""

from __future__ import annotations

import json
from collections.abc import Iterator
from random import Random
from typing import Any

from reobserve.evidence.equations.table import read_equations

from .. import material, mutations
from ..case import Case

_ASKED = ("1", "(9)", " 9 ", "09", "lemma 1", "Theorem 1", "after (3)", "()", "٣", "²", "9.0", "-1")


def make(random: Random) -> Case:
    """A table of a few entries, one of them or the top changed, or an odd number."""
    paper = random.choice(material.PAPERS)
    tree = material.config(f"config/equations/{paper}.yaml")
    if random.random() < 0.2:
        asked = random.choice([*_ASKED, mutations.word(random)])
        return case(paper, tree, asked, f"asked for {asked!r:.60}")
    del tree["equations"][random.randrange(2, 9) :]
    tree["last"] = sum(one["number"].isdecimal() for one in tree["equations"])
    if random.random() < 0.2:
        tree, told = mutations.tree(random, tree)
    else:
        at = random.randrange(len(tree["equations"]))
        tree["equations"][at], told = mutations.tree(random, tree["equations"][at])
    return case(paper, tree, "1", told)


def examples() -> Iterator[Case]:
    """The tables as they are."""
    for paper in material.PAPERS:
        yield case(paper, material.config(f"config/equations/{paper}.yaml"), "1", "as they are")


def case(paper: str, tree: Any, number: str, told: str) -> Case:
    """Read the table, and look one equation up."""
    text = json.dumps(tree).encode()  # JSON is YAML
    return Case(
        f"{paper}: {told}",
        lambda: read_equations(material.here(), paper).find(number),
        {f"config/equations/{paper}.yaml": text},
    )
