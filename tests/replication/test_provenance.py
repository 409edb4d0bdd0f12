"""The modules imported by a statement, which determine the results an edit makes stale."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from reobserve.replication import provenance

MODULE = "reobserve.papers.ilo.plant"
FILE, PACKAGE = Path("plant.py"), Path("plant/__init__.py")


@pytest.mark.parametrize(
    ("statement", "path", "names"),
    [
        ("import a.b, c as d", FILE, ["a.b", "c"]),
        ("from a.b import c, d", FILE, ["a.b", "a.b.c", "a.b.d"]),
        ("from . import setup", FILE, ["reobserve.papers.ilo", "reobserve.papers.ilo.setup"]),
        (
            "from .setup import grid",
            FILE,
            ["reobserve.papers.ilo.setup", "reobserve.papers.ilo.setup.grid"],
        ),
        ("from ..lie import plot", FILE, ["reobserve.papers.lie", "reobserve.papers.lie.plot"]),
        ("from . import setup", PACKAGE, [MODULE, f"{MODULE}.setup"]),
        ("from .. import lie", PACKAGE, ["reobserve.papers.ilo", "reobserve.papers.ilo.lie"]),
        ("x = 1", FILE, []),
    ],
)
def test_imported_names_are_found(statement: str, path: Path, names: list[str]) -> None:
    (node,) = ast.parse(statement).body
    assert list(provenance._names(node, MODULE, path)) == names


def test_closure_contains_direct_and_indirect_imports() -> None:
    assert provenance.import_closure(["reobserve.core.errors"]) == [
        "reobserve",
        "reobserve.core",
        "reobserve.core.errors",
    ]
    closure = provenance.import_closure(["reobserve.replication.parameters.config"])
    assert {"reobserve.core.files", "reobserve.core.errors"} <= set(closure)
    assert closure == sorted(closure)
