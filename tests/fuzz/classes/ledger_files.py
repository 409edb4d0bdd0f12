"""Ledgers as the stages read them, `parameters.json`: as trees and as bytes."""

from __future__ import annotations

import json
from collections.abc import Iterator
from random import Random
from typing import Any

from .. import material, mutations
from ..case import Case, command

# A job of each stage that is quick, by paper.
_JOBS: dict[str, list[tuple[Any, ...]]] = {
    "ilo": [("plant", "l.json", "constant")],
    "lie": [("design", "l.json", "linear"), ("table", "l.json", "table_coefficients")],
    "delay": [("plant", "l.json", "ramp")],
    "imm": [("plant", "l.json", "plain"), ("observe", "l.json", None, "kalman")],
    "eso": [("plant", "l.json", "disturbed"), ("observe", "l.json", None, "pd_pi")],
}


def make(random: Random) -> Case:
    """A ledger with a few changes, and a stage that reads it."""
    paper = random.choice(material.PAPERS)
    job = random.choice(_JOBS[paper])
    content = material.ledger_file(paper).read_bytes()
    if random.random() < 0.25:
        content, told = mutations.damaged(random, content)
        return case(paper, job, content, told)
    stored = json.loads(content)
    if random.random() < 0.3:
        stored, told = mutations.tree(random, stored)
    else:
        section = random.choice(["plant", "scenarios", "observers", "plant"])
        stored["ledger"][section], told = mutations.tree(random, stored["ledger"][section])
        told = f"{section}: {told}"
    return case(paper, job, json.dumps(stored).encode(), told)


def examples() -> Iterator[Case]:
    """Each job with the ledger as it is."""
    for paper, jobs in _JOBS.items():
        for job in jobs:
            yield case(paper, job, material.ledger_file(paper).read_bytes(), "as it is")


def case(paper: str, job: tuple[Any, ...], content: bytes, told: str) -> Case:
    """Run the stage."""
    arguments = [material.record(paper) if part is None else part for part in job]
    design = material.OBSERVERS[paper][2]
    if job[0] in ("observe", "table") and design is not None:
        arguments += ["--design-file", material.design(paper, design)]
    return Case(
        f"{paper} {' '.join(map(str, job))}: {told}",
        lambda: command("stage", *arguments, "--output", "out"),
        {"l.json": content},
    )
