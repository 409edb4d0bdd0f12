"""The modules imported by a statement, which determine the results an edit makes stale."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from importlib.util import resolve_name
from pathlib import Path

import pytest

from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps import provenance
from tests import ROOT

MODULE = "reobserve_papers.papers.ilo.plant"
FILE, PACKAGE = Path("plant.py"), Path("plant/__init__.py")


@pytest.mark.parametrize(
    ("statement", "path", "names"),
    [
        ("import a.b, c as d", FILE, ["a.b", "c"]),
        ("from a.b import c, d", FILE, ["a.b", "a.b.c", "a.b.d"]),
        (
            "from . import setup",
            FILE,
            ["reobserve_papers.papers.ilo", "reobserve_papers.papers.ilo.setup"],
        ),
        (
            "from .setup import grid",
            FILE,
            ["reobserve_papers.papers.ilo.setup", "reobserve_papers.papers.ilo.setup.grid"],
        ),
        (
            "from ..lie import plot",
            FILE,
            ["reobserve_papers.papers.lie", "reobserve_papers.papers.lie.plot"],
        ),
        ("from . import setup", PACKAGE, [MODULE, f"{MODULE}.setup"]),
        (
            "from .. import lie",
            PACKAGE,
            ["reobserve_papers.papers.ilo", "reobserve_papers.papers.ilo.lie"],
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
    assert list(provenance._names(statement, MODULE, path)) == names


def test_imports_are_those_that_python_parses() -> None:
    """In all modules of the project, inside functions and in parentheses, too."""
    files = [path for path in (ROOT / "src").rglob("*.py") if path.name != "__main__.py"]
    assert len(files) > 400
    for path in files:
        module = ".".join(path.relative_to(ROOT / "src").with_suffix("").parts)
        module = module.removesuffix(".__init__")
        tree = ast.parse(path.read_bytes())
        wanted = {name for node in running(tree) for name in imported(node, module, path)}
        assert set(provenance._imports(module)) == wanted, module


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
    assert provenance.import_closure(["reobserve.core.errors"]) == [
        "reobserve",
        "reobserve.core",
        "reobserve.core.errors",
    ]
    closure = provenance.import_closure(["reobserve_papers.parameters.config"])
    assert {"reobserve.core.files", "reobserve.core.errors"} <= set(closure)
    assert closure == sorted(closure)


def test_digest_of_a_job_covers_the_library_and_the_paper() -> None:
    package = Parameters.load(ROOT, "ilo").package
    closure = provenance.import_closure(provenance.stage_modules("observe", package))
    assert {
        "reobserve_papers.cli.stages.observe",
        "reobserve_papers.papers.ilo.observe",
        "reobserve.observers.ilo",
        "reobserve.core.kernel",
    } <= set(closure)


@pytest.mark.parametrize("stage", ["sample", "robustness"])
def test_digest_of_samples_covers_all_steps_of_the_paper(stage: str) -> None:
    closure = provenance.import_closure(
        provenance.stage_modules(stage, "reobserve_papers.papers.eso")
    )
    parts = ("plant", "design", "observe", "study", "study_rows", "theory", "metrics", "keys")
    assert {f"reobserve_papers.papers.eso.{part}" for part in parts} <= set(closure)


def test_package_of_a_paper_elsewhere_is_in_the_digest_of_its_jobs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    provenance._source.cache_clear()
    folder = tmp_path / "elsewhere" / "mine"
    folder.mkdir(parents=True)
    for name in ("../__init__", "__init__", "plant", "keys", "helper"):
        (folder / f"{name}.py").write_text("from elsewhere.mine import helper\n")
    modules = provenance.stage_modules("plant", "elsewhere.mine")
    closure = provenance.import_closure(modules)
    assert {"elsewhere", "elsewhere.mine", "elsewhere.mine.plant", "elsewhere.mine.helper"} <= {
        *closure
    }
    before = provenance.closure_digest(modules)
    (folder / "helper.py").write_text("# edited\n")
    assert provenance.closure_digest(modules) != before


def test_unknown_start_of_a_closure_is_refused() -> None:
    with pytest.raises(
        ModuleNotFoundError, match=r"there is no module reobserve_papers\.cli\.stages\.no"
    ):
        provenance.import_closure(["reobserve.core", "reobserve_papers.cli.stages.no"])


def test_rules_name_modules_that_exist() -> None:
    """Those whose digest decides what is stale."""
    texts = [path.read_text() for path in (ROOT / "workflow/rules").glob("*.smk")]
    named = {name for text in texts for name in re.findall(r'"(reobserve[\w.]*\.\w+)["{]', text)}
    assert len(named) > 8
    assert provenance.import_closure(sorted(named))
