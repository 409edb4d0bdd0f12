"""The assumption ledger: a paper's config, checked, merged with overrides, and what runs.

A ledger is a tree whose leaves are entries: a value with its unit and its source. Stages get
the plain values of the branches they depend on and nothing else (`Ledger.settings`), so that
what is hashed to decide whether an output is stale is what the stage can see.
"""

from __future__ import annotations

import copy
import difflib
import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from reobserve.errors import InputError

Tree = dict[str, Any]

OVERRIDDEN = "user override"

# Keys whose value is a word, also where it looks like a number.
_WORDS = ("unit", "source", "why", "label", "title", "file", "column")

# Sections in which a user may add an entry of his own beside those of the paper.
_OPEN = ("scenarios", "observers", "studies", "figures")


@dataclass(frozen=True)
class Ledger:
    """The resolved ledger of one paper.

    ``tree`` is the whole file as nested dicts, ``seed`` the root of the random streams.
    """

    paper: str
    tree: Tree
    seed: int

    @classmethod
    def load(
        cls, project: Path, paper: str, overrides: Tree | None = None, seed: int = 0
    ) -> Ledger:
        """The ledger of ``config/papers/<paper>.yaml`` with ``overrides`` merged in, checked.

        Raises
        ------
        InputError
            If there is no such paper, or an entry breaks the schema or its own range.
        """
        papers = known_papers(project)
        if paper not in papers:
            raise InputError("paper", f"there is no {paper!r}{_nearest(paper, papers)}")
        tree = read_yaml(project / "config" / "papers" / f"{paper}.yaml")
        if overrides:
            tree = _merge(tree, _numbers(overrides), paper, open_here=False)
        check_schema(project, "paper", tree, paper)
        ledger = cls(paper, tree, seed)
        ledger._check_ranges()
        ledger._check_references()
        return ledger

    @classmethod
    def read(cls, path: str | Path) -> Ledger:
        """Read what `text` was written to.

        Raises
        ------
        InputError
            If the file is missing or no ledger.
        """
        try:
            stored = json.loads(Path(path).read_text(encoding="utf-8"))
            return cls(stored["paper"], stored["ledger"], stored["seed"])
        except OSError as error:
            raise InputError(str(path), f"cannot be read ({error.strerror})") from None
        except (ValueError, KeyError, TypeError):
            raise InputError(str(path), "is no ledger; build it anew") from None

    def text(self) -> str:
        """The ledger as JSON, the same for the same content."""
        stored = {"paper": self.paper, "seed": self.seed, "ledger": self.tree}
        return json.dumps(stored, indent=1, ensure_ascii=False) + "\n"

    def section(self, *path: str) -> Tree:
        """The plain values below ``path``, entries replaced by their values.

        Raises
        ------
        InputError
            If there is no such branch; the message lists those that there are.
        """
        branch: Any = self.tree
        for depth, key in enumerate(path):
            if key not in branch:
                place = ".".join((self.paper, *path[:depth]))
                raise InputError(place, f"there is no {key!r}{_nearest(key, branch)}")
            branch = branch[key]
        values: Tree = _values(branch)
        return values

    def entries(self) -> Iterator[tuple[str, Tree]]:
        """All entries with their dotted paths, in file order."""
        yield from _entries(self.tree, "")

    def settings(self, stage: str, name: str, observer: str = "") -> Tree:
        """What one job of a stage depends on, as plain values.

        ``name`` is the scenario (plant, observe), the study or the figure (metrics, plot).

        Raises
        ------
        InputError
            If the ledger has no such scenario, observer, study or figure.
        """
        if stage == "plant":
            scenario = self.section("scenarios", name)
            return {"plant": self.section("plant"), "scenario": scenario, "seed": self.seed}
        if stage == "observe":
            return {
                "plant": self.section("plant"),
                "observer": _without_labels(self.section("observers", observer)),
            }
        if stage == "study":
            study = self.section("studies", name)
            return {
                "plant": self.section("plant"),
                "scenario": self.section("scenarios", study["scenario"]),
                "study": study,
                "observers": {
                    key: _without_labels(self.section("observers", key))
                    for key in study["observers"]
                },
                "metrics": self.section("metrics"),
                "seed": self.seed,
            }
        figure = self.section("figures", name)
        settings = {
            "plant": self.section("plant"),
            "scenario": self.section("scenarios", figure["scenario"]),
            "observers": {key: self.section("observers", key) for key in figure["observers"]},
            "metrics": self.section("metrics"),
            "figure": figure,
        }
        if "study" in figure:
            settings["study"] = self.section("studies", figure["study"])
        if stage == "metrics":
            settings["observers"] = {
                key: _without_labels(value) for key, value in settings["observers"].items()
            }
        return settings

    def refined(self) -> Ledger:
        """The same ledger with every numerical step [s] halved."""
        tree = copy.deepcopy(self.tree)
        for _, entry in _entries(tree, ""):
            if entry.get("numerical") and entry["unit"] == "s":
                entry["value"] /= 2
        return Ledger(self.paper, tree, self.seed)

    def _check_ranges(self) -> None:
        for path, entry in self.entries():
            if entry["source"] == OVERRIDDEN or "range" not in entry:
                continue
            _check_range(f"{self.paper}.{path}", entry["value"], entry["range"])

    def _check_references(self) -> None:
        """Every scenario, observer and study that is named must exist."""
        for section in ("studies", "figures"):
            for name, body in self.tree.get(section, {}).items():
                for kind, wanted in (
                    ("scenarios", [body["scenario"]]),
                    ("observers", body["observers"]),
                    ("studies", [body["study"]] if "study" in body else []),
                ):
                    have = self.tree.get(kind, {})
                    for key in wanted:
                        if key not in have:
                            raise InputError(
                                f"{self.paper}.{section}.{name}",
                                f"there is no {key!r} in {kind}{_nearest(key, have)}",
                            )


def digest(value: Any) -> str:
    """A short hash of plain data, the same for the same content."""
    text = json.dumps(value, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def known_papers(project: Path) -> list[str]:
    """The papers that have a ledger."""
    return sorted(path.stem for path in (project / "config" / "papers").glob("*.yaml"))


def read_yaml(path: Path) -> Tree:
    """A YAML file whose top is a mapping.

    Raises
    ------
    InputError
        If the file is missing or no such YAML.
    """
    import yaml

    try:
        tree = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(str(path), f"cannot be read ({error.strerror})") from None
    except yaml.YAMLError as error:
        reason = " ".join(str(error).split())
        raise InputError(str(path), f"is not YAML: {reason}") from None
    if not isinstance(tree, dict):
        raise InputError(str(path), "must be a mapping of keys to values")
    # A YAML alias is one object in several places; here every place has its own.
    separate: Tree = json.loads(json.dumps(tree))
    return separate


def check_config(project: Path, config: Tree, papers: list[str]) -> None:
    """Check what `config/config.yaml` and the command line say is to be built.

    Raises
    ------
    InputError
        If a key is neither of the schema nor a paper, or a value is not allowed.
    """
    schema = read_yaml(project / "workflow" / "schemas" / "config.schema.yaml")
    known = [*schema["properties"], *papers]
    for key in config:
        if key not in known:
            raise InputError(f"config.{key}", f"unknown key{_nearest(key, known)}")
    check_schema(project, "config", config, "config")
    for paper in config["papers"]:
        if paper not in papers:
            raise InputError("config.papers", f"there is no {paper!r}{_nearest(paper, papers)}")


def check_schema(project: Path, name: str, tree: Tree, place: str) -> None:
    """Check ``tree`` against ``workflow/schemas/<name>.schema.yaml``.

    Raises
    ------
    InputError
        With the dotted path of the worst fault, under ``place``.
    """
    from jsonschema import Draft202012Validator
    from jsonschema.exceptions import best_match

    schema = read_yaml(project / "workflow" / "schemas" / f"{name}.schema.yaml")
    error = best_match(Draft202012Validator(schema).iter_errors(tree))
    if error is None:
        return
    path = ".".join([place, *map(str, error.absolute_path)])
    problem = error.message
    if error.validator == "additionalProperties" and isinstance(error.instance, dict):
        known = list(error.schema.get("properties", {}))
        unknown = [key for key in error.instance if key not in known]
        path, problem = f"{path}.{unknown[0]}", f"unknown key{_nearest(unknown[0], known)}"
    raise InputError(path, problem)


def is_entry(branch: Any) -> bool:
    """Whether a branch of the tree is an entry: a value with a unit."""
    return isinstance(branch, Mapping) and "value" in branch and "unit" in branch


def _merge(base: Tree, over: Any, place: str, open_here: bool) -> Tree:
    """``base`` with ``over`` laid over it; a bare value replaces the value of an entry."""
    if not isinstance(over, Mapping):
        raise InputError(place, f"{over!r} must be a mapping, like the section it overrides")
    merged = copy.deepcopy(base)
    for key, value in over.items():
        here = f"{place}.{key}"
        if key not in base:
            if not open_here:
                raise InputError(here, f"unknown key{_nearest(key, base)}")
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
    for key in value:
        if key not in ("value", "unit", "source", "why", "range"):
            raise InputError(f"{place}.{key}", f"unknown key{_nearest(key, ['value', 'why'])}")
    if value.get("unit", entry["unit"]) != entry["unit"]:
        raise InputError(f"{place}.unit", f"{value['unit']!r} must be {entry['unit']!r}")
    kept = {key: part for key, part in entry.items() if key != "why"}
    return {**kept, "source": OVERRIDDEN, **value}


def _added(siblings: Tree, body: Any, place: str) -> Any:
    """A user's own scenario, observer or figure; ``like`` names the one to start from."""
    if not isinstance(body, Mapping) or "like" not in body:
        return body
    model = body["like"]
    if model not in siblings:
        raise InputError(f"{place}.like", f"there is no {model!r}{_nearest(model, siblings)}")
    changes = {key: value for key, value in body.items() if key != "like"}
    return _merge(siblings[model], changes, place, open_here=False)


def _values(branch: Any) -> Any:
    if is_entry(branch):
        return branch["value"]
    if isinstance(branch, Mapping):
        return {key: _values(value) for key, value in branch.items()}
    return branch


def _without_labels(branch: Tree) -> Tree:
    """What decides numbers: a new wording must not make a simulation stale."""
    return {key: value for key, value in branch.items() if key not in ("label", "title")}


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


def _check_range(place: str, value: Any, allowed: Any) -> None:
    if isinstance(allowed, list):
        allowed = {"": allowed}
    if "choices" in allowed:
        if value not in allowed["choices"]:
            raise InputError(place, f"{value!r} must be one of {allowed['choices']}, its range")
        return
    for pattern, (low, high) in allowed.items():
        wanted = pattern.split(".") if pattern else []
        found = False
        for path, leaf in leaves(value):
            if len(path) == len(wanted) and all(
                w in ("*", str(p)) for w, p in zip(wanted, path, strict=True)
            ):
                found = True
                if not isinstance(leaf, int | float) or not low <= leaf <= high:
                    where = ".".join((place, *map(str, path)))
                    raise InputError(where, f"{leaf!r} is outside its range [{low:g}, {high:g}]")
        if not found:
            raise InputError(f"{place}.range", f"{pattern!r} matches nothing in the value")


def _nearest(key: str, known: Any) -> str:
    """The end of a sentence about an unknown key."""
    names = [str(name) for name in known]
    close = difflib.get_close_matches(str(key), names, n=1, cutoff=0.5)
    listed = ", ".join(names) if names else "none"
    return f"; did you mean {close[0]!r}?" if close else f"; there are: {listed}"
