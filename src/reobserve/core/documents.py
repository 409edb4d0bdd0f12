"""Values from YAML and JSON: every key once, nothing nested too deep, no more than is needed."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

from reobserve.core.errors import InputError, shown
from reobserve.core.extras import package
from reobserve.core.files import read_text
from reobserve.core.seals import opened

Tree = dict[str, Any]
YAML = (".yaml", ".yml")  # endings of files

DEPTH = 40  # of nested lists and mappings; the deepest configuration has 8
VALUES = 100_000  # with the copies that aliases stand for; a configuration has some 3000
ALIASES = 200
LETTERS = 2_000_000  # of all text in a tree
YAML_BYTES = 512 * 1024  # of a file; the largest configuration has 40 000
_STORED_VALUES = 5_000_000  # in a file that a step of the chain wrote
_TOO_LARGE = "holds more values or text than anything that is read here needs"
# Plain values of YAML 1.2 (its core schema), each with the characters that one may begin with.
_YAML_1_2 = {
    "bool": (r"^(true|True|TRUE|false|False|FALSE)$", [*"tTfF"]),
    "null": (r"^(~|null|Null|NULL|)$", ["~", "n", "N", ""]),
    "int": (r"^[-+]?[0-9]+$", [*"-+0123456789"]),
    "float": (
        r"^[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?$|^[-+]?\.inf$|^\.nan$",
        [*"-+.0123456789"],
    ),
}

_DIGITS = 30  # of a number, with sign, point and exponent
_LARGEST = 2**53  # up to here every integer is a float


def check_plain(tree: Any, place: str, values: int = VALUES) -> None:
    """Refuse what JSON cannot hold, what is nested too deep, and too many values."""
    waiting, letters = [(tree, place, 0)], 0
    while waiting:
        value, here, depth = waiting.pop()
        values -= 1
        if depth > DEPTH:
            raise InputError(here, f"is nested deeper than {DEPTH} levels")
        if isinstance(value, Mapping):
            for key in value:
                if not isinstance(key, str) or not _is_text(key):
                    raise InputError(here, f"has the key {shown(key)}, must be text in quotes")
        if isinstance(value, Mapping | list | tuple):
            parts = value.items() if isinstance(value, Mapping) else enumerate(value)
            if len(value) > values:
                raise InputError(place, _TOO_LARGE)
            waiting.extend((part, f"{here}.{key}", depth + 1) for key, part in parts)
        else:
            _check_leaf(value, here)
            letters += len(value) if isinstance(value, str) else 0
        if letters > LETTERS:
            raise InputError(place, _TOO_LARGE)


def _check_leaf(value: Any, place: str) -> None:
    if isinstance(value, str):
        if not _is_text(value):
            raise InputError(place, "holds half a letter, which no file can")
    elif value is not None and not isinstance(value, bool | int | float):
        allowed = "only numbers, text, true, false, lists and mappings are taken"
        raise InputError(place, f"is a {type(value).__name__}; {allowed}")
    elif isinstance(value, int) and abs(value) > _LARGEST:
        raise InputError(place, "is an integer beyond 2^53, must be one that a float holds")
    elif isinstance(value, float) and not math.isfinite(value):
        raise InputError(place, f"{value} must be a finite number")


def _is_text(word: str) -> bool:
    """True if UTF-8 can spell it, as it cannot half of a surrogate pair."""
    return word.isascii() or word.encode(errors="replace").decode() == word


def parse_yaml(text: str, place: str) -> Any:
    """The data in one YAML document.

    Numbers, true and false are those of YAML 1.2, so that 1e-3 is a number, and yes, 12:30 and
    2020-01-01 are text.

    Raises
    ------
    InputError
        If it is no YAML, has a tag or a key twice, or is too deep or too large.
    """
    yaml = package("yaml", "read YAML")
    loader = _loader()
    try:
        _check_events(yaml.parse(text, loader))
        tree = yaml.load(text, loader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
        said = f"{where}{error.problem or error.context}"
        if "duplicate anchor" in (error.context or ""):
            name = re.match(r"&[^\s,\]}]*", text.splitlines()[mark.line][mark.column :])
            problem = f"the anchor {name and name[0]} is defined again, first in line"
            said = f"{where}{problem} {error.context_mark.line + 1}; give it another name"
            raise InputError(place, said) from None
        raise InputError(place, f"is not YAML of plain values: {said}") from None
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise InputError(place, f"is not YAML of plain values: {error}") from None
    check_plain(tree, place)
    return json.loads(json.dumps(tree))  # so that nothing stands in two places


def _check_events(events: Any) -> None:
    """Count before anything is built: libyaml crashes on what is nested deep."""
    from yaml.events import AliasEvent, CollectionEndEvent, CollectionStartEvent

    depth = aliases = 0
    for event in events:
        depth += isinstance(event, CollectionStartEvent) - isinstance(event, CollectionEndEvent)
        aliases += isinstance(event, AliasEvent)
        if depth > DEPTH:
            raise _refused(event, f"nested deeper than {DEPTH} levels")
        if aliases > ALIASES:
            raise _refused(event, f"more than {ALIASES} aliases")
        if getattr(event, "tag", None) is not None:
            raise _refused(event, f"the tag {event.tag}; only plain values are taken")


def _refused(found: Any, what: str) -> Exception:
    from yaml.constructor import ConstructorError

    return ConstructorError(None, None, what, found.start_mark)


@cache
def _loader() -> Any:
    """PyYAML's safe loader (that of libyaml, where there is one) with keys that stand once."""
    import yaml

    class Loader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]
        yaml_implicit_resolvers: ClassVar[dict[Any, Any]] = {}

        def construct_mapping(self, node: Any, deep: bool = False) -> Any:
            seen = set()
            for key, value in node.value:
                text = key.value if isinstance(key.value, str) else ""
                if text.isdigit() and not value.value:  # {value: 60,0} has a key 0
                    raise _refused(key, "a decimal comma; numbers have a decimal point")
                if key.tag != "tag:yaml.org,2002:str":
                    raise _refused(key, "a key that is no text; put it in quotes")
                if key.value in seen:
                    raise _refused(key, f"the key {shown(key.value)} twice")
                seen.add(key.value)
            return super().construct_mapping(node, deep)

    for tag, (pattern, first) in _YAML_1_2.items():
        Loader.add_implicit_resolver(f"tag:yaml.org,2002:{tag}", re.compile(pattern), first)
    Loader.add_constructor("tag:yaml.org,2002:int", lambda _, node: _number(node, int))
    Loader.add_constructor("tag:yaml.org,2002:float", lambda _, node: _number(node, float))
    return Loader


def _number(node: Any, kind: Any) -> Any:
    if len(node.value) > _DIGITS:
        raise _refused(node, f"a number of more than {_DIGITS} characters")
    return kind(node.value.replace(".inf", "inf").replace(".nan", "nan"))


def read_yaml(path: str | Path) -> Tree:
    """The mapping in a YAML file. It raises `InputError` as `read_text` and `parse_yaml`."""
    return _mapping(parse_yaml(read_text(path, YAML_BYTES), str(path)), path)


def parse_json(text: str, place: str, values: int = VALUES) -> Any:
    """Values from JSON text."""
    try:
        tree = json.loads(text, object_pairs_hook=_once)
    except InputError as error:
        raise InputError(place, error.problem) from None
    except RecursionError:
        raise InputError(place, f"is nested deeper than {DEPTH} levels") from None
    except json.JSONDecodeError as error:
        raise InputError(place, f"is not JSON: {error}") from None
    except ValueError:  # of an integer with thousands of digits
        raise InputError(place, "has an integer beyond 2^53") from None
    check_plain(tree, place, values)
    return tree


def read_json(path: str | Path, *, must_be_sealed: bool = False) -> Tree:
    """The mapping in a JSON file that a step wrote (raises as `read_text` and `parse_json`).

    If the file has a digest, or ``must_be_sealed``, it must be that of the rest.
    """
    tree = _mapping(parse_json(read_text(path), str(path), _STORED_VALUES), path)
    return opened(str(path), tree, must_be_sealed)


def _once(pairs: list[tuple[str, Any]]) -> Tree:
    found: Tree = {}
    for key, value in pairs:
        if key in found:
            raise InputError("", f"has the key {shown(key)} twice")
        found[key] = value
    return found


def _mapping(tree: Any, path: str | Path) -> Tree:
    if not isinstance(tree, dict):
        raise InputError(str(path), "must be a mapping of keys to values")
    return tree


def dumped(tree: dict[str, Any]) -> str:
    """A mapping as YAML, each section in a line.

    Texts that begin as numbers do are in quotes, since 1e9 is one to some readers of YAML.
    """
    yaml = package("yaml", "write a specification")

    class Quoting(yaml.SafeDumper):  # type: ignore[misc, name-defined]
        pass

    def text(dumper: Any, value: str) -> Any:
        style = "'" if re.match(r"[-+.]?\d|[-+]?\.?(inf|nan)", value, re.IGNORECASE) else None
        return dumper.represent_scalar("tag:yaml.org,2002:str", value, style=style)

    Quoting.add_representer(str, text)
    return "\n".join(
        f"{key}: " + yaml.dump(
            keys, Dumper=Quoting, default_flow_style=True, sort_keys=False, allow_unicode=True,
            width=1_000_000,
        ).strip()
        for key, keys in tree.items()
    )  # fmt: skip
