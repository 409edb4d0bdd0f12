"""Valid designs, models, specifications and records, from the examples."""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path
from typing import Any

from reobserve.core.documents import parse_yaml
from reobserve.estimation.families import family
from reobserve.estimation.families.examples import model_text, simulated, specification_text
from reobserve.estimation.families.file import save_design

_FOLDER = tempfile.TemporaryDirectory(prefix="bad-input-")


@cache
def model(kind: str) -> Path:
    """The example model of a kind of observer."""
    path = Path(_FOLDER.name, f"{kind}.yaml")
    path.write_text(model_text(kind), encoding="utf-8")
    return path


@cache
def saved_design(kind: str) -> bytes:
    """The example design of a kind of observer."""
    made: Any = family(kind)
    path = Path(_FOLDER.name, f"{kind}.design.json")
    save_design(path, made.designed(parse_yaml(model_text(kind), "model.yaml")))
    return path.read_bytes()


@cache
def specification(name: str) -> Any:
    """The specification with which `reobserve estimate` reads the record of an example."""
    return parse_yaml(specification_text(name), name)


@cache
def columns(name: str) -> dict[str, Any]:
    """The first rows of the record of an example."""
    return {title: values[:60] for title, values in simulated(name).record().items()}


@cache
def csv_record(name: str) -> bytes:
    """The record of an example as CSV."""
    rows = zip(*(values.tolist() for values in columns(name).values()), strict=True)
    lines = [",".join(columns(name)), *(",".join(f"{one:.9g}" for one in row) for row in rows)]
    return ("\n".join(lines) + "\n").encode()
