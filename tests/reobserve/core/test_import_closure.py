"""The modules imported by a statement or a module, which decide what an edit makes stale."""

from __future__ import annotations

import ast
import shutil
import sys
from collections.abc import Iterator
from functools import cache
from importlib.util import resolve_name
from pathlib import Path
from types import SimpleNamespace

import numba
import pytest

import reobserve
from reobserve.core import import_closure as closures
from reobserve.core import kernel
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


@pytest.mark.parametrize(
    "statement",
    [
        "import math; from consts import K",
        "from consts \\\n    import K",
        "from consts import (  # (1)\n    K,\n)",
        "from consts import(K)",
        "try: from consts import K\nexcept ImportError: pass",
        "def f():\n\tfrom consts import K",
    ],
)
def test_imports_of_users_are_found_in_any_form(statement: str) -> None:
    assert "consts.K" in [*_names(statement, "tracking.run", FILE)]
    near = statement.replace("consts", ".consts")
    assert "tracking.consts.K" in [*_names(near, "tracking.run", FILE)]


def test_relative_imports_of_a_module_that_is_run_are_those_of_its_package(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    run = SimpleNamespace(__spec__=SimpleNamespace(name="tracking.run"))
    monkeypatch.setitem(sys.modules, "__main__", run)
    names = [*_names("from .consts import K", "__main__", FILE)]
    assert names == ["tracking.consts", "tracking.consts.K"]


SOURCE = ROOT / "src"
FILES = {
    ".".join(path.relative_to(SOURCE).with_suffix("").parts).removesuffix(".__init__"): path
    for path in SOURCE.rglob("*.py")
    if path.name != "__main__.py"
}


def test_imports_are_those_that_python_parses() -> None:
    """In all modules of the project, inside functions and in parentheses, too."""
    assert len(FILES) > 400
    for module in FILES:
        assert set(_read(module)[1]) == parsed(module), module


@cache
def parsed(module: str) -> set[str]:
    """All names that a module imports, by Python's own parser."""
    tree = ast.parse(FILES[module].read_bytes())
    return {name for node in running(tree) for name in imported(node, module, FILES[module])}


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


def test_unknown_start_of_a_closure_is_refused() -> None:
    with pytest.raises(ModuleNotFoundError, match=r"there is no module reobserve\.core\.no"):
        import_closure(["reobserve.core", "reobserve.core.no"])


@pytest.mark.parametrize(
    ("folder", "counted"), [("mine", ["one", "two"]), ("site-packages", ["one"])]
)
def test_modules_beside_count_unless_they_are_installed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, folder: str, counted: list[str]
) -> None:
    (tmp_path / folder).mkdir()
    names = {name: f"{folder[:4]}_{name}" for name in ("one", "two")}
    for name in names.values():
        (tmp_path / folder / f"{name}.py").write_text(f"import numpy, {names['two']}")
    monkeypatch.syspath_prepend(tmp_path / folder)
    assert import_closure([names["one"]]) == [names[name] for name in counted]


WITH_KERNELS = {
    module
    for module, path in FILES.items()
    if module.startswith("reobserve.") and "kernel\ndef " in path.read_text(encoding="utf-8")
}


@pytest.fixture
def copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A copy of the library, in which its modules are found."""
    copy = tmp_path / "reobserve"
    shutil.copytree(SOURCE / "reobserve", copy, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(reobserve, "__path__", [str(copy)])
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "cache"))
    closures.source.cache_clear()
    forget()
    yield copy
    closures.source.cache_clear()
    forget()


def forget() -> None:
    """Forget what files held."""
    _read.cache_clear()
    closures._imports.cache_clear()


def folders() -> dict[str, Path | None]:
    """The folder for the machine code of each module with kernels."""
    forget()
    return {one: kernel._cache_folder.__wrapped__(frozenset([one])) for one in WITH_KERNELS}


def test_edit_begins_a_new_folder_for_the_kernels_that_import_the_module_and_no_others(
    copy: Path,
) -> None:
    assert len(WITH_KERNELS) > 20
    always = expected("reobserve.core.kernel")  # which compiles them
    behind = {one: expected(one) | always for one in WITH_KERNELS}
    library = sorted(one for one in FILES if one.startswith("reobserve."))
    before = folders()
    for edited in ("reobserve.detection.restarted_cusum", *library[::9]):
        path = copy.parent / FILES[edited].relative_to(SOURCE)
        path.write_text(f"{path.read_text(encoding='utf-8')}# edited\n", encoding="utf-8")
        after = folders()
        moved = {one for one in WITH_KERNELS if after[one] != before[one]}
        assert moved == {one for one in WITH_KERNELS if edited in behind[one]}, edited
        before = after


def expected(module: str) -> set[str]:
    """The import closure by Python's own parser."""
    found: set[str] = set()
    waiting = {module}
    while waiting:
        one = waiting.pop()
        found.add(one)
        waiting |= ({one.rpartition(".")[0], *parsed(one)} & {*FILES}) - found
    return found
