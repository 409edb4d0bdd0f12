"""What a user lays over a ledger: values of any kind, entries of his own, names of any kind."""

from __future__ import annotations

import json
from collections.abc import Iterator
from random import Random
from typing import Any

from .. import material, mutations
from ..case import Case, command

_OPEN = ("designs", "scenarios", "observers", "studies", "searches", "tables", "figures")


def make(random: Random) -> Case:
    """A value of the ledger replaced, or an entry added that is like another one."""
    paper = random.choice(material.PAPERS)
    tree = material.paper_tree(paper)
    act = random.randrange(4)
    if act == 0:
        return case(paper, _added(random, tree))
    if act == 1:
        return case(paper, mutations.tree(random, _added(random, tree))[0])
    return case(paper, _replaced(random, tree))


def examples() -> Iterator[Case]:
    """Nothing laid over."""
    for paper in material.PAPERS:
        yield case(paper, {})


def case(paper: str, over: Any) -> Case:
    """Write the ledger with overrides."""
    text = json.dumps(over)

    def run() -> None:
        command(
            "stage",
            "parameters",
            paper,
            "--overrides",
            text,
            "--project",
            material.ROOT,
            "--output",
            "l",
        )

    return Case(f"{paper} --overrides {text:.300}", run)


def _replaced(random: Random, tree: Any) -> Any:
    """One value, under the keys that lead to it."""
    path: list[Any] = []
    here = tree
    while isinstance(here, dict) and here and (not path or random.random() < 0.9):
        path.append(random.choice([key for key in here if key not in ("why", "about")] or [*here]))
        here = here[path[-1]]
        if isinstance(here, dict) and "value" in here and random.random() < 0.8:
            here = here["value"]
            break
    new = mutations.value(random) if random.random() < 0.6 else mutations.tree(random, here)[0]
    for key in reversed(path):
        new = {key: new}
    return new


def _added(random: Random, tree: Any) -> Any:
    """An entry of one's own that starts from another, as the README has it."""
    section = random.choice([name for name in _OPEN if tree.get(name)])
    model = random.choice([*tree[section]])
    body: Any = {"like": model} if random.random() < 0.7 else {"title": "mine"}
    if random.random() < 0.5:
        key = random.choice([*tree[section][model]])
        body[key] = mutations.value(random)
    name = "mine" if random.random() < 0.5 else mutations.word(random)
    return {section: {name: body}}
