"""Config files: what there is, how it is read, and what a schema says of it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from reobserve.errors import InputError, nearest, shown
from reobserve.extras import package
from reobserve.ledger.names import DEFAULT_STYLE, style_sheet
from reobserve.plain_data.files import read_text, reason
from reobserve.plain_data.json_data import check_plain, read_json

Tree = dict[str, Any]

_DEPTH_OF_ENTRIES = 3  # in a ledger: the section, the name, the key

# What may stand in a path, in a pattern of Snakemake's and in a command.
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,59}")


def known_papers(project: Path) -> list[str]:
    """The papers that have a ledger.

    Raises
    ------
    InputError
        If the folder cannot be read, or a ledger's file has a name that is none of a paper.
    """
    folder = project / "config" / "papers"
    try:
        papers = sorted(path.stem for path in folder.glob("*.yaml"))
    except (OSError, ValueError) as error:  # ValueError: a path that the system cannot spell
        raise InputError(str(folder), f"cannot be read ({reason(error)})") from None
    for paper in papers:
        check_name("config.papers", paper)
    return papers


def named_papers(known: Sequence[str], papers: Sequence[str]) -> list[str]:
    """The papers that are named, or all that are known; `InputError` if there is no such one."""
    for paper in papers:
        if paper not in known:
            raise InputError("paper", f"there is no {paper!r}{nearest(paper, known)}")
    return list(dict.fromkeys(papers or known))


def known_styles(project: Path) -> list[str]:
    """The styles of figures that there is a sheet of, and the look of the house."""
    sheets = (project / style_sheet("x")).parent.glob("*.mplstyle")
    return sorted({DEFAULT_STYLE, *(path.stem for path in sheets)})


def check_name(place: str, name: object) -> None:
    """Refuse a name that could be more than a name where it stands in a path or a command.

    Raises
    ------
    InputError
        If it is anything but a letter, and letters, digits and underscores after it.
    """
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise InputError(
            place, f"{shown(name)} is no name: a letter, then up to 59 letters, digits and _"
        )


def read_yaml(path: Path) -> Tree:
    """A YAML file whose top is a mapping: UTF-8, every key once, plain values only.

    Raises
    ------
    InputError
        If the file is missing or no such YAML, or has more of it than a config needs.
    """
    from reobserve.plain_data.yaml_reader import MOST_BYTES, parse_yaml

    tree = parse_yaml(read_text(path, MOST_BYTES), str(path))
    if not isinstance(tree, dict):
        raise InputError(str(path), "must be a mapping of keys to values")
    return tree


def check_config_files(*paths: str | Path) -> None:
    """Check what Snakemake's own reader would not: every key once, and plain values only.

    Raises
    ------
    InputError
        As `read_yaml`; files that end in ``.json`` are read as JSON.
    """
    for path in map(Path, paths):
        if path.suffix == ".json":
            read_json(path)
        else:
            read_yaml(path)


def take_truths(config: Tree) -> None:
    """Take the words true and false as YAML does: Snakemake's ``--config`` knows Python's only."""
    for key, value in config.items():
        if isinstance(value, str) and value in ("true", "false"):
            config[key] = value == "true"


def check_config(project: Path, config: Tree, papers: list[str]) -> None:
    """Check what `config/config.yaml` and the command line say is to be built.

    Raises
    ------
    InputError
        If a key is neither of the schema nor a paper, or a value is not allowed.
    """
    check_plain(config, "config")
    schema = read_yaml(project / "workflow" / "schemas" / "config.schema.yaml")
    known = [*schema["properties"], *papers]
    for key in config:
        if key not in known:
            raise InputError(f"config.{key}", f"unknown key{nearest(key, known)}")
    check_schema(project, "config", config, "config")
    for paper in config.get("papers", ()):
        if paper not in papers:
            problem = f"there is no {shown(paper)}{nearest(paper, papers)}"
            raise InputError("config.papers", problem)
    styles = known_styles(project)
    if (style := config.get("style", DEFAULT_STYLE)) not in styles:
        raise InputError("config.style", f"there is no {shown(style)}, only {', '.join(styles)}")
    for name in ("seed", "draws"):
        if isinstance(config[name], float):
            raise InputError(f"config.{name}", f"{config[name]:g} must be a whole number")


def check_schema(project: Path, name: str, tree: Tree, place: str) -> None:
    """Check ``tree`` against ``workflow/schemas/<name>.schema.yaml``.

    Raises
    ------
    InputError
        With the dotted path of the worst fault, under ``place``.
    """
    package("jsonschema", "check config")
    from jsonschema import Draft202012Validator
    from jsonschema.exceptions import best_match

    schema = read_yaml(project / "workflow" / "schemas" / f"{name}.schema.yaml")
    error = best_match(Draft202012Validator(schema).iter_errors(tree))
    if error is None:
        return
    path = ".".join([place, *map(str, error.absolute_path)])
    problem = error.message.replace(repr(error.instance), shown(error.instance))
    if error.validator == "type" and error.validator_value == "object":
        problem = f"{shown(error.instance)} must be a mapping of keys to values"
        if name == "paper" and len(error.absolute_path) == _DEPTH_OF_ENTRIES:
            problem += "; a bare value will do in a branch that says what it is `like`"
    if error.validator in ("pattern", "oneOf", "maxLength", "not") and "title" in error.schema:
        problem = f"{shown(error.instance)} must be {error.schema['title']}"
    if error.validator == "additionalProperties" and isinstance(error.instance, dict):
        known = list(error.schema.get("properties", {}))
        unknown = [key for key in error.instance if key not in known]
        path, problem = f"{path}.{unknown[0]}", f"unknown key{nearest(unknown[0], known)}"
    raise InputError(path, problem)
