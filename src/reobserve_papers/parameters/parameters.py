"""The Parameters: a paper's config, checked, merged with overrides, and what runs.

A parameter file is a tree whose leaves are entries: a value with its unit and its source. Stages
get the plain values of the branches they depend on and nothing else (`Parameters.settings`), so
that what is hashed to decide whether an output is stale is what the stage can see.
"""

from __future__ import annotations

import copy
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from reobserve.core.documents import Tree, check_plain, read_json, read_yaml
from reobserve.core.errors import InputError, nearest, shown
from reobserve.core.seals import sealed
from reobserve.core.units import same
from reobserve.core.validation import parse
from reobserve_papers.parameters.config import known_papers, named_papers, refuse_unknown
from reobserve_papers.parameters.names import add_sources
from reobserve_papers.parameters.settings import settings
from reobserve_papers.parameters.step_kinds import SECTIONS

OVERRIDDEN = "user override"  # the source of a value that a user has changed

# What branches may name, by key: one name or a list of them, and where they stand.
_NAMED = {
    "scenario": "scenarios",
    "observers": "observers",
    "study": "studies",
    "design": "designs",
}


@dataclass(frozen=True)
class Parameters:
    """The resolved parameter file of one paper.

    ``tree`` is the whole file as nested dicts, ``seed`` the root of the random streams.
    """

    paper: str
    tree: Tree
    seed: int

    @classmethod
    def load(
        cls, project: Path, paper: str, overrides: Tree | None = None, seed: int = 0
    ) -> Parameters:
        """The checked parameters of ``config/papers/<paper>.yaml`` with ``overrides``."""
        named_papers(known_papers(project), [paper])
        tree = read_yaml(project / "config" / "papers" / f"{paper}.yaml")
        check_plain(overrides or {}, paper)
        from reobserve_papers.parameters.overrides import resolve  # which jobs do without
        from reobserve_papers.parameters.parameter_file import ParameterFile

        tree = resolve(tree, overrides or {}, paper)
        parse(ParameterFile, tree, paper)
        parameters = cls(paper, tree, seed)
        parameters._check_ranges()
        parameters._check_references()
        add_sources(project)
        return parameters

    @classmethod
    def read(cls, path: str | Path) -> Parameters:
        """Read what `text` was written to, which had been checked then."""
        kept = read_json(path, must_be_sealed=True)
        file = Path(path).absolute()  # results/PAPER/parameters.json
        add_sources(file.parent.parent.parent)
        return cls(kept["paper"], kept["parameters"], kept["seed"])

    def text(self) -> str:
        """The parameter file as JSON with a digest of it, the same for the same content."""
        stored = {"paper": self.paper, "seed": self.seed, "parameters": self.tree}
        return json.dumps(sealed(stored), indent=1, ensure_ascii=False) + "\n"

    @property
    def package(self) -> str:
        """The package with the paper's own modules."""
        found: str = self.tree["about"]["package"]
        return found

    def section(self, *path: str) -> Tree:
        """The plain values below ``path``, entries replaced by their values."""
        branch: Any = self.tree
        for depth, key in enumerate(path):
            refuse_unknown(".".join((self.paper, *path[:depth])), [key], branch)
            branch = branch[key]
        values: Tree = _values(branch)
        return values

    def entries(self) -> Iterator[tuple[str, Tree]]:
        """All entries with their dotted paths, in file order."""
        yield from _entries(self.tree, "")

    @cached_property
    def by_key(self) -> Mapping[str, Tree]:
        """All entries by their dotted paths, listed once."""
        return dict(self.entries())

    def settings(self, step: str, name: str = "") -> Tree:
        """The values that one run of a step depends on (see `parameters.settings.settings`).

        Labels, titles and sources are left out except for plots: they decide no number.
        """
        found = settings(self, step, name)
        # A new title must make nothing stale but plots.
        decisive: Tree = found if step == "plot" else _without(found, ("label", "title", "source"))
        return decisive

    def decisive(self) -> Tree:
        """The whole tree without wording: values, ranges, and which branches name which others."""
        wording = ("label", "title", "source", "why", "about")
        found: Tree = _without(self.tree, wording)
        return found

    def refined(self) -> Parameters:
        """The same parameter file with every numerical step [s] halved."""
        tree = copy.deepcopy(self.tree)
        for _, entry in _entries(tree, ""):
            if entry.get("numerical") and entry["unit"] != "1" and same(entry["unit"], "s"):
                entry["value"] /= 2
        return Parameters(self.paper, tree, self.seed)

    def _check_ranges(self) -> None:
        for path, entry in self.entries():
            if "multiple_of" in entry and entry["source"] != OVERRIDDEN:
                _check_grid(f"{self.paper}.{path}", entry)
            if entry["source"] == OVERRIDDEN or "range" not in entry:
                continue
            _check_range(f"{self.paper}.{path}", entry["value"], entry["range"])
            for named in entry.get("named", ()):
                _check_range(f"{self.paper}.{path}.named", named, entry["range"])

    def _check_references(self) -> None:
        """Every scenario, observer, study and design that is named must exist."""
        for section in SECTIONS.values():
            for name, body in self.tree.get(section, {}).items():
                for key, kind in _NAMED.items():
                    named = body.get(key, [])
                    if is_entry(named):
                        continue
                    have = self.tree.get(kind, {})
                    for wanted in named if isinstance(named, list) else [named]:
                        if wanted not in have:
                            raise InputError(
                                f"{self.paper}.{section}.{name}",
                                f"there is no {shown(wanted)} in {kind}{nearest(wanted, have)}",
                            )


def default_parameters(project: Path, paper: str) -> Parameters:
    """The parameter file of a paper without overrides, with the seed of the config."""
    return Parameters.load(project, paper, seed=default_seed(project))


def default_seed(project: Path) -> int:
    """The root of the random streams as the config states it."""
    seed: int = read_yaml(project / "config" / "config.yaml")["seed"]
    return seed


def is_entry(branch: Any) -> bool:
    """True if a branch of the tree is an entry: a value with a unit, or a link to one."""
    return isinstance(branch, Mapping) and (
        ("value" in branch and "unit" in branch) or isinstance(branch.get("same_as"), str)
    )


def _values(branch: Any) -> Any:
    if is_entry(branch):
        return branch["value"]
    if isinstance(branch, Mapping):
        return {key: _values(value) for key, value in branch.items()}
    return branch


def _without(branch: Any, keys: tuple[str, ...]) -> Any:
    if not isinstance(branch, Mapping):
        return branch
    return {key: _without(value, keys) for key, value in branch.items() if key not in keys}


def _entries(branch: Any, place: str) -> Iterator[tuple[str, Tree]]:
    if is_entry(branch):
        yield place, branch
    elif isinstance(branch, Mapping):
        for key, value in branch.items():
            yield from _entries(value, f"{place}.{key}" if place else str(key))


def leaves(
    value: Any, path: tuple[str | int, ...] = ()
) -> Iterator[tuple[tuple[str | int, ...], Any]]:
    """The numbers and words inside a value, with their paths."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from leaves(inner, (*path, key))
    elif isinstance(value, list):
        for index, inner in enumerate(value):
            yield from leaves(inner, (*path, index))
    else:
        yield path, value


def matches(pattern: str, path: tuple[str | int, ...]) -> bool:
    """True if a pattern of a range, such as ``*.size``, is of the leaf at a path of `leaves`."""
    wanted = pattern.split(".") if pattern else []
    return len(wanted) == len(path) and all(
        word in ("*", str(step)) for word, step in zip(wanted, path, strict=True)
    )


def _check_grid(place: str, entry: Tree) -> None:
    grids, allowed = entry["multiple_of"], entry.get("range")
    if not isinstance(grids, Mapping):
        grids = dict.fromkeys(allowed if isinstance(allowed, Mapping) else [""], grids)
    for pattern, grid in grids.items():
        for path, leaf in leaves(entry["value"]):
            if matches(pattern, path) and isinstance(leaf, int | float):
                steps = leaf / grid
                if abs(steps - round(steps)) > 1e-6:
                    where = ".".join((place, *map(str, path)))
                    raise InputError(where, f"{shown(leaf)} must be a multiple of {grid:g}")


def _check_range(place: str, value: Any, allowed: Any) -> None:
    if isinstance(allowed, list):
        allowed = {"": allowed}
    if "choices" in allowed:
        if value not in allowed["choices"]:
            raise InputError(
                place, f"{shown(value)} must be one of {shown(allowed['choices'])}, its range"
            )
        return
    for pattern, (low, high) in allowed.items():
        found = False
        for path, leaf in leaves(value):
            if matches(pattern, path):
                found = True
                if not isinstance(leaf, int | float) or not low <= leaf <= high:
                    where = ".".join((place, *map(str, path)))
                    raise InputError(
                        where, f"{shown(leaf)} is outside its range [{low:g}, {high:g}]"
                    )
        if not found:
            raise InputError(f"{place}.range", f"{pattern!r} matches nothing in the value")
