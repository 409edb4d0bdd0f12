"""`reobserve design`: from a model's file to a design's file, with a few sentences on it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from reobserve.core.documents import Tree, read_yaml
from reobserve.core.errors import InputError
from reobserve.core.extras import package
from reobserve.core.files import write_text
from reobserve.estimation.designs.design import Design
from reobserve.estimation.designs.file import kind_of, naming, save_design


def run(
    design: str, model: Path | None, out: Path | None, example: Path | None, **options: Any
) -> None:
    """Design an observer, write its file and say what was found; or write an example of a model.

    Raises
    ------
    InputError
        If a file or an option cannot be used, or no observer is certified.
    """
    kind = kind_of(design)
    if example is not None:
        if model is not None or out is not None:
            raise InputError("--example", "writes a model and designs nothing: leave out the rest")
        if example.exists():
            raise InputError(str(example), "is there already, and is not replaced")
        write_text(example, kind.example)
        print(f"{example}: a model; next: reobserve design {design} {example} --out design.json")
        return
    if model is None or out is None:
        raise InputError("MODEL.yaml and --out", "must be given, or --example")
    given = {name: value for name, value in options.items() if value is not None}
    tree = read_model(model)
    with naming(model):
        found: Design = kind.designed(tree, **given)
    saved = save_design(out, found)
    print(*saved.summary(), sep="\n")
    print(f"{out}: certified, and so again whenever it is loaded")


def read_model(path: str | Path) -> Tree:
    """The mapping in a model's YAML file.

    Raises
    ------
    InputError
        If it is none.
    """
    package("yaml", "read a model", extra="design")
    return read_yaml(path)
