"""The modules imported by a statement or a module, which decide what an edit makes stale."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from importlib.util import resolve_name
from pathlib import Path

import pytest

from reobserve.core.import_closure import _names, _read, import_closure
from tests import ROOT

MODULE = "reobserve.systems.ilo.plant"
FILE, PACKAGE = Path("plant.py"), Path("plant/__init__.py")


@pytest.mark.parametrize(
    ("statement", "path", "names"),
    [
        ("import a.b, c as d", FILE, ["a.b", "c"]),
        ("from a.b import c, d", FILE, ["a.b", "a.b.c", "a.b.d"]),
        (
            "from . import setup",
            FILE,
            ["reobserve.systems.ilo", "reobserve.systems.ilo.setup"],
        ),
        (
            "from .setup import grid",
            FILE,
            ["reobserve.systems.ilo.setup", "reobserve.systems.ilo.setup.grid"],
        ),
        (
            "from ..lie import plot",
            FILE,
            ["reobserve.systems.lie", "reobserve.systems.lie.plot"],
        ),
        ("from . import setup", PACKAGE, [MODULE, f"{MODULE}.setup"]),
        (
            "from .. import lie",
            PACKAGE,
            ["reobserve.systems.ilo", "reobserve.systems.ilo.lie"],
        ),
        ("x = 1", FILE, []),
        (
            "if TYPE_CHECKING:\n    import a\n\n    import b\nelse:\n    import c\nimport d",
            FILE,
            ["c", "d"],
        ),
        ("from a import (\n    b,  # not c\n    d as e,\n)", FILE, ["a", "a.b", "a.d"]),
    ],
)
def test_imported_names_are_found(statement: str, path: Path, names: list[str]) -> None:
    assert list(_names(statement, MODULE, path)) == names


def test_imports_are_those_that_python_parses() -> None:
    """In all modules of the project, inside functions and in parentheses, too."""
    files = [path for path in (ROOT / "src").rglob("*.py") if path.name != "__main__.py"]
    assert len(files) > 400
    for path in files:
        module = ".".join(path.relative_to(ROOT / "src").with_suffix("").parts)
        module = module.removesuffix(".__init__")
        tree = ast.parse(path.read_bytes())
        wanted = {name for node in running(tree) for name in imported(node, module, path)}
        assert set(_read(module)[1]) == wanted, module


def running(node: ast.AST) -> Iterator[ast.stmt]:
    """The statements below ``node`` that can run."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.If) and ast.unparse(child.test) == "TYPE_CHECKING":
            yield from running(ast.Module(child.orelse, []))
            continue
        if isinstance(child, ast.stmt):
            yield child
        yield from running(child)


def imported(node: ast.stmt, module: str, path: Path) -> list[str]:
    """The names that an import imports."""
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    if not isinstance(node, ast.ImportFrom):
        return []
    base = "." * node.level + (node.module or "")
    if node.level:
        base = resolve_name(
            base, module if path.name == "__init__.py" else module.rpartition(".")[0]
        )
    return [base, *(f"{base}.{alias.name}" for alias in node.names)]


def test_closure_contains_direct_and_indirect_imports() -> None:
    assert import_closure(["reobserve.core.errors"]) == [
        "reobserve",
        "reobserve.core",
        "reobserve.core.errors",
    ]
    closure = import_closure(["reobserve.observers.kalman"])
    assert {"reobserve.observers.linear_loop", "reobserve.core.errors"} <= set(closure)
    assert closure == sorted(closure)


def test_unknown_start_of_a_closure_is_refused() -> None:
    with pytest.raises(ModuleNotFoundError, match=r"there is no module reobserve\.core\.no"):
        import_closure(["reobserve.core", "reobserve.core.no"])
