"""A user's overrides of a parameter file, and entries that take their value from another."""

from __future__ import annotations

import copy
from collections.abc import Collection, Iterator, Mapping
from typing import Any

from reobserve.core.documents import Tree
from reobserve.core.errors import InputError, nearest, shown
from reobserve_papers.parameters.parameters import OVERRIDDEN, is_entry
from reobserve_papers.parameters.step_kinds import SECTIONS

# Keys whose value is a word, also where it looks like a number.
_WORDS = ("unit", "source", "why", "label", "title", "file", "column", "text", "same_as")


def resolve(tree: Tree, overrides: Tree, paper: str) -> Tree:
    """The parameters of a paper with overrides, and then with the values of linked entries.

    A bare value replaces the value of an entry. A linked entry, ``same_as: plant.initial_rate``,
    follows the other one, also where that is overridden, until it is overridden itself.
    """
    merged = _merge(tree, _numbers(overrides), paper, paper, tree)
    return {
        section: _linked(merged, branch, (section,), paper) for section, branch in merged.items()
    }


def follow(tree: Tree, links: Mapping[str, str], changed: Collection[str]) -> Tree:
    """The tree with the values of linked entries after some have changed, which keep theirs.

    Parameters
    ----------
    tree
        Resolved parameters.
    links
        By key of a linked entry, the key that it follows; see `links_in`.
    changed
        Keys of entries that have another value.
    """
    for key in links:
        if key in changed or not (target := _end(links, key, changed)):
            continue
        value = _entry_at(tree, target)["value"]
        if _entry_at(tree, key)["value"] is not value:
            tree = _replaced(tree, tuple(key.split(".")), value)
    return tree


def links_in(entries: Iterator[tuple[str, Tree]]) -> dict[str, str]:
    """The key that a linked entry follows, by key of the entry."""
    return {key: entry["same_as"] for key, entry in entries if "same_as" in entry}


def _end(links: Mapping[str, str], key: str, changed: Collection[str]) -> str:
    """The changed entry that a linked one follows, if any."""
    while key in links and key not in changed:
        key = links[key]
    return key if key in changed else ""


def _entry_at(tree: Tree, key: str) -> Tree:
    for word in key.split("."):
        tree = tree[word]
    return tree


def _replaced(tree: Tree, path: tuple[str, ...], value: Any) -> Tree:
    """A copy of the tree with another value of one entry."""
    if not path:
        return {**tree, "value": value}
    return {**tree, path[0]: _replaced(tree[path[0]], path[1:], value)}


def _linked(tree: Tree, branch: Any, path: tuple[str, ...], paper: str) -> Any:
    """A branch in which every link has what it names."""
    if is_entry(branch):
        return _target(tree, branch, ".".join((paper, *path)), ())
    if isinstance(branch, Mapping):
        return {key: _linked(tree, part, (*path, key), paper) for key, part in branch.items()}
    return branch


def _target(tree: Tree, entry: Tree, place: str, seen: tuple[str, ...]) -> Tree:
    """An entry, with what a link does not say itself from the entry that it names."""
    key = entry.get("same_as")
    if key is None:
        return entry
    found: Any = tree
    for word in key.split("."):
        found = found.get(word) if isinstance(found, Mapping) else None
    if not is_entry(found):
        problem = f"there is no entry {shown(key)}{nearest(key, _keys(tree, ''))}"
        raise InputError(f"{place}.same_as", problem)
    if key in seen:
        raise InputError(f"{place}.same_as", f"{shown(key)} is the same as itself")
    if "value" in entry:
        raise InputError(f"{place}.value", "must not stand beside same_as")
    other = _target(tree, found, place, (*seen, key))
    wording = {**other, **entry}
    if other.get("source") == OVERRIDDEN:
        wording |= {"source": OVERRIDDEN}
        wording.pop("why", None)
    return {**wording, "value": copy.deepcopy(other["value"])}


def _keys(branch: Any, place: str) -> Iterator[str]:
    """The keys of all entries."""
    if is_entry(branch):
        yield place
    elif isinstance(branch, Mapping):
        for key, part in branch.items():
            yield from _keys(part, f"{place}.{key}".lstrip("."))


def _merge(base: Tree, over: Any, place: str, paper: str, root: Tree) -> Tree:
    if not isinstance(over, Mapping):
        raise InputError(place, f"{shown(over)} must be a mapping, like the section it overrides")
    merged = copy.deepcopy(base)
    section = place.removeprefix(f"{paper}.")
    for key, value in over.items():
        here = f"{place}.{key}"
        if key not in base:
            if section not in SECTIONS.values():  # in which a user may add a branch
                raise InputError(here, f"unknown key{nearest(key, base)}")
            merged[key] = _added(base, value, here, paper, root)
        elif is_entry(base[key]):
            merged[key] = _override(base[key], value, here, root)
        elif isinstance(base[key], Mapping):
            merged[key] = _merge(base[key], value, here, paper, root)
        else:
            merged[key] = value
    return merged


def _numbers(branch: Any) -> Any:
    """``branch`` with numbers for words that spell one: Snakemake reads ``--config`` as words."""
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


def _override(entry: Tree, value: Any, place: str, root: Tree) -> Tree:
    if not isinstance(value, Mapping):
        value = {"value": value}
    if not value:
        raise InputError(place, "{} must be a value, or a mapping with the key 'value'")
    for key in value:
        if key not in ("value", "unit", "source", "why", "range"):
            problem = f"unknown key{nearest(key, ['value', 'why'])}"
            raise InputError(f"{place}.{key}", problem)
    entry = _target(root, entry, place, ())
    if value.get("unit", entry["unit"]) != entry["unit"]:
        raise InputError(f"{place}.unit", f"{shown(value['unit'])} must be {entry['unit']!r}")
    kept = {key: part for key, part in entry.items() if key not in ("why", "same_as")}
    return {**kept, "source": OVERRIDDEN, **value}


def _added(siblings: Tree, body: Any, place: str, paper: str, root: Tree) -> Any:
    """A user's own scenario, observer or figure. ``like`` names the one to start from."""
    if not isinstance(body, Mapping) or "like" not in body:
        return body
    model = str(body["like"])
    if model not in siblings:
        raise InputError(f"{place}.like", f"there is no {shown(model)}{nearest(model, siblings)}")
    changes = {key: value for key, value in body.items() if key != "like"}
    return _merge(siblings[model], changes, place, paper, root)
