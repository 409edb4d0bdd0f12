"""The modules whose edits make results stale."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from reobserve.core.import_closure import import_closure
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps import provenance
from tests import FIVE, ROOT


def test_digest_of_a_job_covers_the_library_and_the_paper() -> None:
    package = Parameters.load(ROOT, "ilo").package
    closure = import_closure(provenance.stage_modules("observe", package))
    assert {
        "reobserve_papers.steps.build_job",
        "reobserve_papers.papers.ilo.observe",
        "reobserve.observers.ilo",
        "reobserve.core.kernel",
    } <= set(closure)


@pytest.mark.parametrize("paper", FIVE)
def test_record_of_a_plant_depends_on_no_observer(paper: str) -> None:
    closure = import_closure(provenance.stage_modules("plant", f"reobserve_papers.papers.{paper}"))
    assert f"reobserve_papers.papers.{paper}.plant" in closure
    assert not [module for module in closure if module.startswith("reobserve.observers")]


def test_digest_of_samples_covers_all_steps_of_the_paper() -> None:
    closure = import_closure(provenance.stage_modules("robustness", "reobserve_papers.papers.eso"))
    parts = ("plant", "design", "observe", "study", "study_rows", "theory", "metrics", "keys")
    assert {f"reobserve_papers.papers.eso.{part}" for part in parts} <= set(closure)


def test_package_of_a_paper_elsewhere_is_in_the_digest_of_its_jobs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    folder = tmp_path / "elsewhere" / "mine"
    folder.mkdir(parents=True)
    for name in ("../__init__", "__init__", "plant", "keys", "helper"):
        (folder / f"{name}.py").write_text("from elsewhere.mine import helper\n")
    modules = provenance.stage_modules("plant", "elsewhere.mine")
    closure = import_closure(modules)
    assert {"elsewhere", "elsewhere.mine", "elsewhere.mine.plant", "elsewhere.mine.helper"} <= {
        *closure
    }


def test_rules_name_modules_that_exist() -> None:
    """Those whose digest decides what is stale."""
    texts = [path.read_text() for path in (ROOT / "workflow/rules").glob("*.smk")]
    named = {name for text in texts for name in re.findall(r'"(reobserve[\w.]*\.\w+)["{]', text)}
    assert len(named) > 8
    assert import_closure(sorted(named))
