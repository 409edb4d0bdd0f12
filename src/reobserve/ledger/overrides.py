"""A user's overrides: laid over a paper's config, marked as what they are."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any

from reobserve.errors import InputError, nearest, shown
from reobserve.ledger.config import Tree

OVERRIDDEN = "user override"

# Keys whose value is a word, also where it looks like a number.
_WORDS = ("unit", "source", "why", "label", "title", "file", "column", "text")

# Sections in which a user may add an entry of his own beside those of the paper.
_OPEN = ("designs", "scenarios", "observers", "studies", "searches", "tables", "figures")


def is_entry(branch: Any) -> bool:
    """Whether a branch of the tree is an entry: a value with a unit."""
    return isinstance(branch, Mapping) and "value" in branch and "unit" in branch


def lay_over(tree: Tree, overrides: Tree, paper: str) -> Tree:
    """A paper's config with overrides; a bare value replaces the value of an entry.

    Raises
    ------
    InputError
        If an override has no place in the config, or ``like`` names nothing.
    """
    return _merge(tree, _numbers(overrides), paper, open_here=False)


def _merge(base: Tree, over: Any, place: str, open_here: bool) -> Tree:
    if not isinstance(over, Mapping):
        raise InputError(place, f"{shown(over)} must be a mapping, like the section it overrides")
    merged = copy.deepcopy(base)
    for key, value in over.items():
        here = f"{place}.{key}"
        if key not in base:
            if not open_here:
                raise InputError(here, f"unknown key{nearest(key, base)}")
            merged[key] = _added(base, value, here)
        elif is_entry(base[key]):
            merged[key] = _override(base[key], value, here)
        elif isinstance(base[key], Mapping):
            merged[key] = _merge(base[key], value, here, place.count(".") == 0 and key in _OPEN)
        else:
            merged[key] = value
    return merged


def _numbers(branch: Any) -> Any:
    """``branch`` with numbers for words that spell one.

    Snakemake reads nested values of ``--config`` as words, and YAML takes 1e3 for a word.
    """
    if isinstance(branch, Mapping):
        return {key: value if key in _WORDS else _numbers(value) for key, value in branch.items()}
    if isinstance(branch, list):
        return [_numbers(value) for value in branch]
    if isinstance(branch, str):
        for kind in (int, float):
            try:
                return kind(branch)
            except ValueError:
                pass
    return branch


def _override(entry: Tree, value: Any, place: str) -> Tree:
    if not isinstance(value, Mapping):
        value = {"value": value}
    if not value:
        raise InputError(place, "{} must be a value, or a mapping with the key 'value'")
    for key in value:
        if key not in ("value", "unit", "source", "why", "range"):
            raise InputError(f"{place}.{key}", f"unknown key{nearest(key, ['value', 'why'])}")
    if value.get("unit", entry["unit"]) != entry["unit"]:
        raise InputError(f"{place}.unit", f"{shown(value['unit'])} must be {entry['unit']!r}")
    kept = {key: part for key, part in entry.items() if key != "why"}
    return {**kept, "source": OVERRIDDEN, **value}


def _added(siblings: Tree, body: Any, place: str) -> Any:
    """A user's own scenario, observer or figure; ``like`` names the one to start from."""
    if not isinstance(body, Mapping) or "like" not in body:
        return body
    model = str(body["like"])
    if model not in siblings:
        raise InputError(f"{place}.like", f"there is no {shown(model)}{nearest(model, siblings)}")
    changes = {key: value for key, value in body.items() if key != "like"}
    return _merge(siblings[model], changes, place, open_here=False)
