"""`reobserve design`: from a model's file to a design's file, with a few sentences on it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from reobserve.core.documents import Tree, parse_yaml, read_yaml
from reobserve.core.errors import InputError, shown
from reobserve.core.extras import package
from reobserve.core.files import write_text
from reobserve.estimation.families import family
from reobserve.estimation.families.file import naming, save_design


def run(
    kind: str, model: Path | None, out: Path | None, example: Path | None, changed: Sequence[str]
) -> None:
    """Design an observer, write its file and say what was found, or write an example of a model.

    ``changed`` are texts KEY=VALUE that replace or add keys of the model, values in YAML.

    Raises
    ------
    InputError
        If a file or a key cannot be used, or no observer is certified.
    """
    package("yaml", "read a model", extra="design")
    chosen = family(kind)
    if example is not None:
        if model is not None or out is not None or changed:
            raise InputError("--example", "writes a model and designs nothing: leave out the rest")
        if example.exists():
            raise InputError(str(example), "is there already, and is not replaced")
        write_text(example, chosen.example)
        print(f"{example}: a model; next: reobserve design {kind} {example} --out design.json")
        return
    if model is None or out is None:
        raise InputError("MODEL.yaml and --out", "must be given, or --example")
    tree: Tree = {**read_yaml(model), **dict(map(_change, changed))}
    with naming(model), chosen.keyed():
        found = chosen.designed(tree)
        saved = save_design(out, found)
    print(*saved.summary(), sep="\n")
    print(f"{out}: certified; loading it certifies it again")


def _change(text: str) -> tuple[str, Any]:
    key, equals, value = text.partition("=")
    if not equals or not key:
        raise InputError("--set", f"{shown(text)} must be KEY=VALUE")
    return key, parse_yaml(f"value: {value}", f"--set {key}")["value"]
