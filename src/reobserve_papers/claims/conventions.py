"""Conventions by which claims are decided, and the alternatives to each, in one file.

Whatever a reader might see otherwise is data: what a bound counts as "less", which measure an error
has, how "any" is read, which share of samples decides. Claims name a convention as ``$less``; an
alternative gives one convention, or some keys of single claims, another value, or keeps only some
of the samples. `reobserve_papers.claims.decider` says what each changes.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from reobserve.core.documents import Tree, read_yaml
from reobserve.core.errors import InputError, located, nearest, shown
from reobserve.core.validation import Text, distinct, items, parse
from reobserve_papers.parameters.config import refuse_unknown
from reobserve_papers.parameters.names import CONVENTIONS
from reobserve_papers.parameters.parameter_file import Model

# What the code itself reads, with the values that hold where a project has no such file.
SPECIAL: Mapping[str, Any] = {
    "share": 0.9,
    "majority": 0.5,
    "purpose": "ignored",
    "main": "abstract and conclusions",
    "samples": 400,
}
_ALLOWED = {
    "purpose": ("ignored", "counts"),
    "main": ("abstract and conclusions", "abstract", "conclusions", "figures", "all claims"),
}
# Keys of claims and conventions that hold reasons.
_WORDING = (
    "why",
    "note",
    "reasons",
    "statement",
    "place",
    "history",
    "departs",
    "setting",
    "errata",
)
_NAMED = re.compile(r"\$([a-z][a-z0-9_]*)")


class Convention(Model):
    """One convention, and what else one could have taken."""

    value: Any = Field(description="What holds.")
    why: Text = Field(description="The reason for it.")
    alternatives: dict[str, Any] = Field({}, description="Other defensible values, by name.")
    reasons: dict[str, Text] = Field({}, description="By alternative: why one could take it.")


class SingleAlternative(Model):
    """A change of single claims of a paper, or of which samples count."""

    paper: str = Field(description="The paper.")
    why: Text = Field(description="Why one could see it so.")
    claims: dict[str, dict[str, Any]] = Field(
        {},
        description="By claim: what its keys are instead, as `checks.0.below: 1.0`; null removes.",
    )
    ranges: dict[str, Annotated[list[Any], items()]] = Field(
        {},
        description="By key of a choice: the ends between which it lies, or the words that count.",
    )
    weights: dict[str, dict[str, Annotated[float, Field(ge=0, le=1)]]] = Field(
        {},
        description="By key of a choice: with which probability samples with a word are kept.",
    )
    only: Annotated[list[str], distinct] = Field(
        [], description="The claims that `ranges` and `weights` are about, if not all."
    )


class ConventionsFile(Model):
    """The file ``config/conventions.yaml``."""

    note: Text = Field(description="When and with what knowledge the conventions were chosen.")
    conventions: dict[str, Convention] = Field(description="By name.")
    alternatives: dict[str, SingleAlternative] = Field({}, description="By name.")


@dataclass(frozen=True)
class Conventions:
    """The conventions of a project: values by name, and the file with the alternatives."""

    values: Mapping[str, Any] = field(default_factory=lambda: dict(SPECIAL))
    stated: Mapping[str, Convention] = field(default_factory=dict)
    single: Mapping[str, SingleAlternative] = field(default_factory=dict)
    note: str = ""

    def with_value(self, name: str, value: Any) -> Conventions:
        """The same with another value of one convention."""
        return Conventions({**self.values, name: value}, self.stated, self.single, self.note)


def read_conventions(project: Path) -> Conventions:
    """The conventions of a project, those of the code where it has no file."""
    path = project / CONVENTIONS
    if not path.is_file():
        return Conventions()
    file = parse(ConventionsFile, read_yaml(path))
    for name, entry in file.conventions.items():
        for value in (entry.value, *entry.alternatives.values()):
            with located(f"conventions.{name}"):
                _check(name, value)
        refuse_unknown(f"conventions.{name}.reasons", entry.reasons, entry.alternatives)
        if entry.value in entry.alternatives.values():
            problem = f"{shown(entry.value)} must be another than the value"
            raise InputError(f"conventions.{name}.alternatives", problem)
    values = {**SPECIAL, **{name: entry.value for name, entry in file.conventions.items()}}
    return Conventions(values, file.conventions, file.alternatives, file.note)


@cache
def conventions_text(project: Path) -> Tree:
    """The file as it stands, to see whether it has changed."""
    try:
        return read_yaml(project / CONVENTIONS) if (project / CONVENTIONS).is_file() else {}
    except InputError as error:
        return {"problem": str(error)}


def words_in(tree: Any) -> Iterator[str]:
    """The words in a tree that may name metrics or levels, without reasons: bounds are numbers."""
    if isinstance(tree, Mapping):
        for key, value in tree.items():
            if key not in _WORDING:
                yield from words_in(value)
    elif isinstance(tree, list):
        for value in tree:
            yield from words_in(value)
    elif isinstance(tree, str):
        yield tree


def without_reasons(tree: Any) -> Any:
    """A tree without its reasons, which decide nothing."""
    if isinstance(tree, Mapping):
        return {key: without_reasons(part) for key, part in tree.items() if key not in _WORDING}
    return [without_reasons(part) for part in tree] if isinstance(tree, list) else tree


def names_in(tree: Any) -> set[str]:
    """The conventions that a part of a claims file names."""
    return {name for word in words_in(tree) for name in _NAMED.findall(word)}


def filled(tree: Any, values: Mapping[str, Any]) -> Any:
    """A part of a claims file with values in place of the names of conventions."""
    if isinstance(tree, Mapping):
        return {
            key: value if key in ("why", "statement", "place") else filled(value, values)
            for key, value in tree.items()
        }
    if isinstance(tree, list):
        return [filled(value, values) for value in tree]
    if not isinstance(tree, str) or "$" not in tree:
        return tree
    whole = _NAMED.fullmatch(tree)
    if whole:
        return _value(whole[1], values)
    return _NAMED.sub(lambda match: str(_value(match[1], values)), tree)


def changed(body: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """An entry of a claims file with other values of some keys, as ``checks.0.below``."""
    tree: Any = dict(body)
    removed = []
    for key, value in changes.items():
        tree = _with(tree, key.split("."), value, key)
        removed += [key] if value is None else []
    return dict(_without_none(tree)) if removed else tree


def _value(name: str, values: Mapping[str, Any]) -> Any:
    if name not in values:
        raise InputError("", f"there is no convention {shown(name)}{nearest(name, values)}")
    return values[name]


def _with(tree: Any, path: list[str], value: Any, key: str) -> Any:
    if not path:
        return value
    head, *rest = path
    if isinstance(tree, list):
        if not head.isdigit() or int(head) >= len(tree):
            raise InputError(key, f"there is no item {head}, must be 0 to {len(tree) - 1}")
        number = int(head)
        return [*tree[:number], _with(tree[number], rest, value, key), *tree[number + 1 :]]
    if not isinstance(tree, Mapping) or ((rest or value is None) and head not in tree):
        known = tree if isinstance(tree, Mapping) else ()
        raise InputError(key, f"there is no {shown(head)}{nearest(head, known)}")
    return {**tree, head: _with(tree.get(head), rest, value, key)}


def _without_none(tree: Any) -> Any:
    if isinstance(tree, Mapping):
        return {key: _without_none(value) for key, value in tree.items() if value is not None}
    if isinstance(tree, list):
        return [_without_none(value) for value in tree if value is not None]
    return tree


def _check(name: str, value: Any) -> None:
    """Refuse a value that the code could not use."""
    if name in _ALLOWED and value not in _ALLOWED[name]:
        allowed = ", ".join(_ALLOWED[name])
        raise InputError("value", f"{shown(value)} must be one of {allowed}")
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if name == "share" and not (number and 0.5 < value < 1):
        raise InputError("value", f"{shown(value)} must be between 0.5 and 1")
    if name == "majority" and not (number and 0 <= value < 1):
        raise InputError("value", f"{shown(value)} must be 0 or more, and less than 1")
    if name == "samples" and not (isinstance(value, int) and 36 <= value <= 100_000):
        raise InputError("value", f"{shown(value)} must be a number of samples, 36 or more")
