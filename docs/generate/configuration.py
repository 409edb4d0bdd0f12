"""Configuration: schemas, the keys of a build, specifications of records and models of designs."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from docs.generate.markdown import block, code, heading, plain, table
from reobserve.core.documents import read_yaml
from reobserve.core.validation import schema
from reobserve.estimation.families import FAMILIES
from reobserve.estimation.families.examples import examples, model_text, specification_text
from reobserve_papers.cli.schemas import KINDS, schema_of
from reobserve_papers.parameters.parameter_file import Configuration


def keys_of_a_build(root: Path) -> str:
    """The keys of `config/config.yaml` and what is allowed for each, and the file."""
    text = (root / "config/config.yaml").read_text(encoding="utf-8")
    stated = dict(re.findall(r"^(\w+): .*?\s# (.+)$", text, re.MULTILINE))
    values = read_yaml(root / "config/config.yaml")
    rows = [
        (
            code(key),
            code(_value(values[key])) if key in values else "",
            plain(_allowed(part)),
            plain(part.get("description") or stated.get(key, "")),
        )
        for key, part in schema(Configuration)["properties"].items()
    ]
    listed = table(("key", "default", "allowed", "meaning"), rows)
    return f"{listed}\n{block(text, 'yaml', 'config/config.yaml')}"


def _value(value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(str, value))}]"
    return str(value).lower() if isinstance(value, bool) else str(value)


_WORDS = {
    "boolean": "true or false", "integer": "a whole number", "number": "a number",
    "string": "text", "object": "a mapping", "array": "a list", "null": "",
}  # fmt: skip


def _allowed(part: Mapping[str, Any]) -> str:
    """What a JSON schema allows, in words."""
    options = part.get("anyOf", part.get("oneOf"))
    if options:
        return " or ".join(dict.fromkeys(filter(None, map(_allowed, options))))
    if "$ref" in part:
        return str(part["$ref"].rpartition("/")[2])
    if "enum" in part or "const" in part:
        return ", ".join(map(_value, part.get("enum", [part.get("const")])))
    if part.get("type") == "array" and part.get("items"):
        return f"a list of {_allowed(part['items'])}"
    inner = next(iter(part.get("patternProperties", {}).values()), part.get("additionalProperties"))
    if part.get("type") == "object" and isinstance(inner, dict):
        return f"by name: {_allowed(inner)}"
    said = _WORDS.get(part.get("type", ""), "any value")
    bounds = {
        "exclusiveMinimum": "above", "minimum": "from", "exclusiveMaximum": "below",
        "maximum": "to",
    }  # fmt: skip
    return " ".join(
        [said, *(f"{word} {part[key]:g}" for key, word in bounds.items() if key in part)]
    )


def schemas() -> str:
    """The keys of all kinds of files in `config`."""
    parts = []
    for name, (path, _) in KINDS.items():
        found = schema_of(name)
        about = f"{code(path)}, as `reobserve-papers schema {name}` prints it for an editor."
        parts.append(f"{heading(2, code(name), name)}\n\n{about}\n\n{_keys(found)}")
        parts += [
            f"{heading(3, code(title), f'{name}-{title.lower()}')}\n\n{_keys(part)}"
            for title, part in found["$defs"].items()
            if "properties" in part and part["title"] != found["title"]
        ]
    return "\n".join(parts)


def _keys(found: Mapping[str, Any]) -> str:
    """A description and a table of the keys of a mapping."""
    needed = found.get("required", ())
    rows = [
        (
            code(key),
            "yes" if key in needed else "",
            plain(_allowed(part)),
            plain(part.get("description", "").replace("`", "")),
        )
        for key, part in found["properties"].items()
    ]
    if isinstance(found.get("additionalProperties"), dict):
        rows.append(("others", "", plain(_allowed(found["additionalProperties"])), ""))
    about = plain(found.get("description", "").partition("\n\n")[0].replace("`", ""))
    return f"{about}\n\n{table(('key', 'required', 'allowed', 'meaning'), rows)}"


def specifications() -> str:
    """The examples of `reobserve estimate`."""
    return "\n".join(_example(name, specification_text(name), 3) for name in examples())


def models() -> str:
    """The examples of `reobserve design`."""
    return "\n".join(_example(name, model_text(name), 2) for name in FAMILIES)


def _example(name: str, text: str, level: int) -> str:
    return f"{heading(level, code(name), name)}\n\n{block(text, 'yaml', f'{name}.yaml')}"
