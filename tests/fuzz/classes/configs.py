"""What is to be built: `config/config.yaml`, and pairs after ``--config``, as trees."""

from __future__ import annotations

from collections.abc import Iterator
from random import Random
from typing import Any

from reobserve.ledger.config import check_config
from reobserve.ledger.ledger import Ledger

from .. import material, mutations
from ..case import Case


def make(random: Random) -> Case:
    """The config with a few changes; Snakemake hands on what YAML made of words."""
    tree = material.config("config/config.yaml")
    if random.random() < 0.3:
        tree[random.choice([*material.PAPERS, mutations.word(random)])] = mutations.value(random)
    changed, told = mutations.tree(random, tree)
    return case(changed, told)


def examples() -> Iterator[Case]:
    """The config as it is."""
    yield case(material.config("config/config.yaml"), "as it is")


def case(tree: Any, told: str) -> Case:
    """Check it, and load a ledger by it, as the workflow does."""

    def run() -> None:
        check_config(material.ROOT, tree, list(material.PAPERS))
        Ledger.load(material.ROOT, "ilo", tree.get("ilo"), tree["seed"])

    return Case(told, run)
