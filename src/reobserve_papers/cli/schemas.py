"""JSON schemas of the files in ``config/``, for editors and for the reference."""

from __future__ import annotations

import json
from typing import Any

from reobserve.core.command_line import load

# By the name of a kind of file: its path, and the module and model that read it.
KINDS = {
    "config": ("config/config.yaml", "parameters.parameter_file:Configuration"),
    "parameters": ("config/papers/<paper>.yaml", "parameters.parameter_file:ParameterFile"),
    "claims": ("config/claims/<paper>.yaml", "claims.entries:ClaimsFile"),
    "conventions": ("config/conventions.yaml", "claims.conventions:ConventionsFile"),
    "errata": ("config/errata/<paper>.yaml", "claims.errata:ErrataFile"),
    "bench": ("config/bench/<task>.yaml", "bench.packaged_task:MODEL"),
}


def schema_of(kind: str) -> dict[str, Any]:
    """The JSON schema of a kind of file."""
    from reobserve.core.validation import schema

    return schema(load(f"reobserve_papers.{KINDS[kind][1]}"))


def print_schema(kind: str) -> None:
    """Print the JSON schema of a kind of file."""
    print(json.dumps(schema_of(kind), indent=2, ensure_ascii=False))
