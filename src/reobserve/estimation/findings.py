"""Findings of a check of a record."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from reobserve.core.documents import dumped
from reobserve.core.errors import InputError
from reobserve.core.validation import parse
from reobserve.estimation.specification import Specification
from reobserve.estimation.suggestion import Suggestion, suggest

_MOST_LISTED = 20
_MOST_TEXTS = 20  # in a record, that may mean missing values


@dataclass
class Findings:
    """The refusals of a record, each with its sentence and the lines where it occurs.

    ``tree`` is the specification with the keys that would accept it, as far as there are any.
    """

    tree: dict[str, Any]
    data: Path
    refusals: dict[str, tuple[str, set[int]]] = field(default_factory=dict)
    final: bool = False  # something is wrong that no key accepts
    changed: list[str] = field(default_factory=list)  # sections of the tree
    asked: str = ""  # what only the user can know
    choices: list[str] = field(default_factory=list)  # of sampling.repeated, which is not proposed
    summary: str = ""
    stated: dict[str, Any] = field(default_factory=dict)  # the specification as it is
    texts: dict[str, None] | None = field(default_factory=dict)  # that mean missing values
    refused: set[str] = field(default_factory=set)  # keys that do not go with others

    @cached_property
    def suggestion(self) -> Suggestion:
        """The layout that a text seems to have, nothing if it has none."""
        try:
            return suggest(self.data)
        except InputError:
            return Suggestion()

    def refuse(self, error: InputError, key: str = "", line: int = 0) -> None:
        """Take a refusal, which counts with all that have the same ``key``."""
        self.refusals.setdefault(key or str(error), (str(error), set()))[1].add(line)

    def state(self, section: str, **keys: Any) -> bool:
        """Put keys into a section of the tree, and return whether that changes it."""
        before = self.tree.get(section, {})
        tree = {**self.tree, section: {**before, **keys}}
        if all(key in before and before[key] == value for key, value in keys.items()):
            return False
        if repr(tree) in self.refused:
            return False
        try:
            parse(Specification, tree)
        except InputError:  # they do not go together
            self.refused.add(repr(tree))
            return False
        self.tree = tree
        self.changed = list(dict.fromkeys([*self.changed, section]))
        return True

    def state_missing(self, text: str) -> bool:
        """State that a text means a missing value, and return whether that changes anything.

        None is stated any more once there are too many for that.
        """
        if self.texts is None:
            return False
        self.texts = self.texts | {text: None}
        stated = self.stated.get("file", {}).get("missing_values", [])
        if len(self.texts) <= _MOST_TEXTS:
            return self.state("file", missing_values=[*stated, *self.texts])
        self.texts = None
        self.tree["file"] = {**self.tree["file"], "missing_values": stated}
        if not stated:
            del self.tree["file"]["missing_values"]
        if self.tree["file"] == self.stated.get("file", {}):
            self.changed.remove("file")
        if not self.tree["file"]:
            del self.tree["file"]
        return True

    def text(self, place: str) -> str:
        """The refusals, one in a line, and the lines to paste."""
        if not self.refusals:
            return f"{place} is accepted\n{self.summary}"
        lines = []
        for sentence, where in list(self.refusals.values())[:_MOST_LISTED]:
            times = f" ({len(where)} times)" if len(where) > 1 else ""
            lines.append(f"{sentence}{times}")
        if (more := len(self.refusals) - _MOST_LISTED) > 0:
            lines.append(f"and {more} more")
        if self.asked:
            lines += ["", f"state {self.asked}; what else is refused shows then"]
        elif self.final or not self.changed:
            lines += ["", "no key accepts all of this"]
        sections = {key: dict(self.tree[key]) for key in self.changed}
        if self.choices:
            assumed = self.tree["sampling"]["repeated"]
            sections.get("sampling", {}).pop("repeated", None)
            lines += ["", "state sampling.repeated, which is one of", *self.choices]
            lines += [f"what else is said here is so with {assumed}"]
        sections = {key: part for key, part in sections.items() if part != self.stated.get(key)}
        if sections:
            what = "the rest" if self.final or self.choices else "the record"
            lines += ["", f"stated as follows, these sections of the specification accept {what}:"]
            lines += ["", dumped(sections), ""]
        return "\n".join([*lines, self.summary])
