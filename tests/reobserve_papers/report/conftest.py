"""Fixtures of the report's tests: a made-up project, pages, and a browser."""

from __future__ import annotations

import os
from pathlib import Path
from types import SimpleNamespace

import pytest
from playwright.sync_api import Browser

from reobserve_papers.report import report_command
from reobserve_papers.steps import glossary
from tests.browser import browser
from tests.reobserve_papers.pipeline.conftest import Project, as_built

from .project import BROKEN, CLAIMS, MEANINGS, make_project, write_claims

__all__ = ["as_built", "browser"]


@pytest.fixture(autouse=True)
def toy_says_what_its_metrics_are(monkeypatch: pytest.MonkeyPatch) -> None:
    """Replace the glossary of metrics, as the package of `toy` cannot be imported here."""
    module = SimpleNamespace(MEANINGS=MEANINGS)
    monkeypatch.setattr(glossary, "paper_module", lambda package, part: module)


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A made-up project that a test may change."""
    return make_project(tmp_path)


@pytest.fixture(scope="session")
def whole_page(browser: Browser, request: pytest.FixtureRequest) -> Path:
    """The page of a complete build, or the one named by REPORT_PAGE."""
    if "REPORT_PAGE" in os.environ:
        return Path(os.environ["REPORT_PAGE"]).resolve()
    whole: Project = request.getfixturevalue("as_built")
    return whole.folder / "results" / "report.html"


@pytest.fixture(scope="session")
def small_page(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of a made-up project, with one figure and no gaps."""
    folder = make_project(tmp_path_factory.mktemp("small"))
    report_command(folder, folder / "results/report.html")
    return folder / "results/report.html"


@pytest.fixture(scope="session")
def page_with_gaps(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small page with a missing plot and a broken claim."""
    folder = make_project(tmp_path_factory.mktemp("gaps"))
    write_claims(folder, [*CLAIMS, BROKEN])
    (folder / "results/toy/fig1.svg").unlink()
    report_command(folder, folder / "results/report.html")
    return folder / "results/report.html"
