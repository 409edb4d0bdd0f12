"""`reobserve design`: from a model's file to a design's file, with a few sentences on it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from reobserve.core.documents import YAML, Tree, parse_yaml, read_yaml
from reobserve.core.errors import InputError, shown
from reobserve.core.extras import package
from reobserve.core.files import check_not_read, write_text
from reobserve.estimation.families import family
from reobserve.estimation.families.examples import model_text
from reobserve.estimation.families.file import naming, save_design
from reobserve.estimation.observer_design import Design


def run(
    kind: str, model: Path | None, out: Path | None, example: Path | None, changed: Sequence[str]
) -> None:
    """Design an observer, write its file and say what was found, or write an example of a model.

    The model may be a specification of `reobserve estimate`, or one without columns; as it has a
    kind, its path may stand in the place of ``kind``. ``changed`` are texts KEY=VALUE that replace
    or add keys of the observer, values in YAML.
    """
    package("yaml", "read a model", extra="design")
    path = Path(kind)
    if model is None and example is None and (path.suffix in YAML or path.is_file()):
        kind, model = "", path
        check_not_read([] if out is None else [out], [path])
    chosen = family(kind) if kind else None
    if example is not None and chosen is not None:
        if model is not None or out is not None or changed:
            raise InputError("--example", "writes a model and designs nothing: leave out the rest")
        if example.exists():
            raise InputError(str(example), "is there already, and is not replaced")
        title, period, rest = model_text(kind).partition("sampling_period")
        write_text(example, f"{title}kind: {kind}\n{period}{rest}")
        print(f"{example}: a model; next: reobserve design {kind} {example} --out design.json")
        return
    if model is None or out is None:
        raise InputError("MODEL.yaml and --out", "must be given, or --example")
    tree, changes = read_yaml(model), dict(map(_change, changed))
    with naming(model):
        saved, notes = _saved(chosen, kind, tree, changes, out)
    print(*saved.summary(), *notes, sep="\n")
    print(f"{out}: certified; loading it certifies it again")


def _saved(
    chosen: type[Design] | None, kind: str, tree: Tree, changes: Tree, out: Path
) -> tuple[Design, Sequence[str]]:
    """The design of a model or of a specification, written, and sentences on what is left out."""
    from reobserve.estimation.specified_design import is_specification, specified_design

    if chosen is not None and not is_specification(tree):
        return save_design(out, chosen.designed({**tree, **changes})), ()
    made = specified_design(tree, kind, changes)
    if made.from_file:
        raise InputError("observer.kind", "design is of a file that `reobserve design` wrote")
    if len(made.signals[1]) != len(made.design.inputs):
        problem = f"must be named and have units, as the columns are {len(made.signals[1])}"
        raise InputError("observer.inputs", problem)
    return save_design(out, made.design), made.notes


def _change(text: str) -> tuple[str, Any]:
    key, equals, value = text.partition("=")
    if not equals or not key:
        raise InputError("--set", f"{shown(text)} must be KEY=VALUE")
    return key, parse_yaml(f"value: {value}", f"--set {key}")["value"]
