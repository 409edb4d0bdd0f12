"""Designs as files, of every kind that there is, before all that reads them."""

from __future__ import annotations

import json
from collections.abc import Iterator
from random import Random

from .. import material, mutations
from ..case import Case, command

# What reads a design quickly: the stage, its name there, and the design.
_READERS = [
    ("lie", "observe", "constant", "linear"),
    ("lie", "observe", "order4", "linear"),
    ("lie", "observe", "transformed4", "linear"),
    ("lie", "observe", "composed4", "linear"),
    ("lie", "observe", "injection", "nonlinear"),
    ("lie", "table", "table_coefficients", "linear"),
    ("eso", "observe", "pi", "pi_feasible"),
    ("eso", "observe", "pd_pi", "pd_pi"),
    ("eso", "observe", "pi_optimal", "pi_optimal"),
]


def make(random: Random) -> Case:
    """A design with a few changes, and one of its readers."""
    reader = random.choice(_READERS)
    content = material.design(reader[0], reader[3]).read_bytes()
    if random.random() < 0.2:
        content, told = mutations.damaged(random, content)
        return case(reader, content, told)
    stored = json.loads(content)
    if random.random() < 0.2:
        stored, told = mutations.tree(random, stored)
    else:
        stored["design"], told = mutations.tree(random, stored["design"])
    return case(reader, json.dumps(stored).encode(), told)


def examples() -> Iterator[Case]:
    """Every reader with the design as it is."""
    for reader in _READERS:
        yield case(reader, material.design(reader[0], reader[3]).read_bytes(), "as it is")


def case(reader: tuple[str, str, str, str], content: bytes, told: str) -> Case:
    """Run the stage that reads it."""
    paper, stage, name, design = reader
    record = [material.record(paper)] if stage == "observe" else []
    arguments = [stage, material.ledger_file(paper), *record, name]
    return Case(
        f"{paper} {stage} {name}, design {design}: {told}",
        lambda: command("stage", *arguments, "--design-file", "d.json", "--output", "out"),
        {"d.json": content},
    )
