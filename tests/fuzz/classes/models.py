"""Models of users' own, of every kind of design, and what is asked of them on the command line."""

from __future__ import annotations

from collections.abc import Iterator
from random import Random

import yaml

from reobserve.designs.file import KINDS, kind_of

from .. import mutations
from ..case import Case, command

# Linear matrix inequalities take a solver seconds, and are refused before one begins or never.
_QUICK = [kind for kind in KINDS if kind != "eso"]
_OPTIONS = {
    "luenberger": ["--poles", "-3, -4"],
    "normal-form": ["--poles", "-1.5 -2.2", "--order", "2", "--form", "transformed"],
}


def make(random: Random) -> Case:
    """A model with a few changes, or odd options for one."""
    kind = random.choice(_QUICK if random.random() < 0.95 else list(KINDS))
    text, options, told = kind_of(kind).example, list(_OPTIONS.get(kind, [])), "as it is"
    act = random.random()
    if act < 0.2:
        content, told = mutations.damaged(random, text.encode())
        return case(kind, content, [], told)
    if act < 0.3 and options:
        place = random.randrange(1, len(options), 2)
        options[place] = random.choice([*mutations.WORDS, *map(str, mutations.NUMBERS)])
        if "\x00" in options[place] or "\ud800" in options[place]:  # no shell can say it
            options[place] = "x"
        return case(kind, text.encode(), options, f"options {options!r:.80}")
    tree, told = mutations.tree(random, yaml.safe_load(text))
    try:
        content = yaml.safe_dump(tree, allow_unicode=True, sort_keys=False).encode()
    except (yaml.YAMLError, UnicodeError):
        content = b"\xff"
    return case(kind, content, options if random.random() < 0.3 else [], told)


def examples() -> Iterator[Case]:
    """Every kind as its example is, with options and without."""
    for kind in KINDS:
        content = kind_of(kind).example.encode()
        yield case(kind, content, [], "as it is")
        if kind in _OPTIONS:
            yield case(kind, content, _OPTIONS[kind], "with options")


def case(kind: str, content: bytes, options: list[str], told: str) -> Case:
    """Design what the model says."""
    arguments = ["design", kind, "model.yaml", *options, "--out", "design.json"]
    return Case(f"model of {kind}: {told}", lambda: command(*arguments), {"model.yaml": content})
