"""Design files of users' own, of every kind, before what loads them and writes them as code."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

from reobserve.designs.file import KINDS, kind_of, save_design
from reobserve.plain_data.documents import parse_yaml

from .. import mutations
from ..case import Case, command

_FORMATS = ("c", "python", "latex", "json")


@cache
def _stored(kind: str) -> bytes:
    """The file of the example of a kind."""
    made: Any = kind_of(kind)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "design.json"
        save_design(path, made.designed(parse_yaml(made.example, "model.yaml")))
        return path.read_bytes()


def make(random: Random) -> Case:
    """A design file with a few changes."""
    kind = random.choice(list(KINDS))
    content = _stored(kind)
    if random.random() < 0.2:
        content, told = mutations.damaged(random, content)
        return case(kind, content, random.choice(_FORMATS), told)
    stored = json.loads(content)
    part = random.choice([None, "system", "gains", "certificate", "versions"])
    if part is None:
        stored, told = mutations.tree(random, stored)
    else:
        stored[part], told = mutations.tree(random, stored[part])
    return case(kind, json.dumps(stored).encode(), random.choice(_FORMATS), f"{part}: {told}")


def examples() -> Iterator[Case]:
    """Every kind as it is, in all formats."""
    for kind in KINDS:
        for to in _FORMATS:
            yield case(kind, _stored(kind), to, "as it is")


def case(kind: str, content: bytes, to: str, told: str) -> Case:
    """Export the file."""
    arguments = ["export", "design.json", "--to", to, "--out", "code"]
    name = f"design of {kind} to {to}: {told}"
    return Case(name, lambda: command(*arguments), {"design.json": content})
