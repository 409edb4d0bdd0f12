"""JSON schemas of the files in ``config/``, for editors and for the reference."""

from __future__ import annotations

import json
from typing import Any

from reobserve.core.validation import schema
from reobserve.tuning.task import TaskFile
from reobserve_papers.claims.conventions import PATH as CONVENTIONS
from reobserve_papers.claims.conventions import ConventionsFile
from reobserve_papers.claims.entries import ClaimsFile
from reobserve_papers.claims.errata import ErrataFile
from reobserve_papers.parameters.parameter_file import Configuration, ParameterFile

# By the name of a kind of file: its path, and the model that reads it.
KINDS: dict[str, tuple[str, Any]] = {
    "config": ("config/config.yaml", Configuration),
    "parameters": ("config/papers/<paper>.yaml", ParameterFile),
    "claims": ("config/claims/<paper>.yaml", ClaimsFile),
    "conventions": (CONVENTIONS, ConventionsFile),
    "errata": ("config/errata/<paper>.yaml", ErrataFile),
    "bench": ("config/bench/<task>.yaml", TaskFile),
}


def print_schema(kind: str) -> None:
    """Print the JSON schema of a kind of file."""
    print(json.dumps(schema(KINDS[kind][1]), indent=2, ensure_ascii=False))
