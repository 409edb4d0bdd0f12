"""Errata files as trees, as the report reads them: what is wrong with one is a gap of the page."""

from __future__ import annotations

import json
from collections.abc import Iterator
from random import Random
from typing import Any

from reobserve.errors import InputError
from reobserve.evidence.report.errata import read_errata, read_obstacles
from reobserve.evidence.report.model import Gap
from reobserve.evidence.report.reading import Project

from .. import material, mutations
from ..case import Case


def make(random: Random) -> Case:
    """The errata of a paper with a few changes."""
    paper = random.choice(material.PAPERS)
    tree = material.config(f"config/errata/{paper}.yaml")
    changed, told = mutations.tree(random, tree)
    return case(paper, changed, told)


def examples() -> Iterator[Case]:
    """The errata as they are."""
    for paper in material.PAPERS:
        yield case(paper, material.config(f"config/errata/{paper}.yaml"), "as they are")


def case(paper: str, tree: Any, told: str) -> Case:
    """Read them, and the claims file that is not there."""

    def run() -> None:
        project = Project(material.here(), material.here() / "report.html")
        found = read_errata(project, paper)
        assert isinstance(read_obstacles(project, paper), Gap)
        if isinstance(found, Gap):
            raise InputError("errata", found.sentence)

    text = json.dumps(tree).encode()  # JSON is YAML
    return Case(f"{paper}: {told}", run, {f"config/errata/{paper}.yaml": text})
