"""Configuration: schemas, the keys of a build, specifications of records and models of designs."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from docs.generate.markdown import block, code, plain, table
from reobserve.designs.file import KINDS, kind_of
from reobserve.ledger.config import read_yaml
from reobserve.own_data.examples import NAMES, specification_text

# Of the schemas in `workflow/schemas`: the files that each is of.
_SCHEMAS = {
    "config": "config/config.yaml",
    "paper": "config/papers/<paper>.yaml",
    "claims": "config/claims/<paper>.yaml",
    "claim": "each claim in config/claims/<paper>.yaml",
    "errata": "config/errata/<paper>.yaml",
}


def keys_of_a_build(root: Path) -> str:
    """The keys of `config/config.yaml` and what is allowed for each, and the file."""
    text = (root / "config/config.yaml").read_text(encoding="utf-8")
    properties = read_yaml(root / "workflow/schemas/config.schema.yaml")["properties"]
    told = dict(re.findall(r"^(\w+): .*?\s# (.+)$", text, re.MULTILINE))
    values = read_yaml(root / "config/config.yaml")
    rows = [
        (
            code(key),
            code(_value(values[key])) if key in values else "",
            plain(_allowed(schema)),
            plain(told.get(key, "the papers to build; all of them if it is not given")),
        )
        for key, schema in properties.items()
    ]
    listed = table(("key", "as it stands", "allowed", "what it is"), rows)
    return f"{listed}\n{block(text, 'yaml', 'config/config.yaml')}"


def _value(value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(str, value))}]"
    return str(value).lower() if isinstance(value, bool) else str(value)


def _allowed(schema: Mapping[str, Any]) -> str:
    if "items" in schema:
        items = schema["items"]
        inner = f"of {', '.join(items['enum'])}" if "enum" in items else f"of {items['type']}s"
        return f"a list {inner}"
    words = {"boolean": "true or false", "integer": "a whole number", "string": "a name"}
    told = words[schema["type"]]
    if "minimum" in schema:
        told += f" from {schema['minimum']} to {schema['maximum']}"
    return told


def schemas(root: Path) -> str:
    """The schemas of all files in `config`."""
    parts = []
    for file in sorted((root / "workflow/schemas").glob("*.schema.yaml")):
        name = file.name.removesuffix(".schema.yaml")
        text = file.read_text(encoding="utf-8")
        title = plain(read_yaml(file)["title"])
        about = f"{title}: {code(_SCHEMAS.get(name, name))}."
        shown = block(text, "yaml", f"workflow/schemas/{file.name}")
        parts.append(f"## {code(name)} {{ #{name} }}\n\n{about}\n\n{shown}")
    return "\n".join(parts)


def specifications() -> str:
    """The examples of `reobserve estimate`."""
    return "\n".join(_example(name, specification_text(name), 3) for name in NAMES)


def models() -> str:
    """The examples of `reobserve design`."""
    return "\n".join(_example(name, kind_of(name).example, 2) for name in KINDS)


def _example(name: str, text: str, level: int) -> str:
    return f"{'#' * level} {code(name)} {{ #{name} }}\n\n{block(text, 'yaml', f'{name}.yaml')}"
