"""The site, built once for all its tests."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from docs.generate.sources import write
from tests import ROOT
from tests.browser import browser
from tests.reobserve_papers.pipeline.conftest import Project, as_built

__all__ = ["as_built", "browser"]


MISSING = "no mkdocs to build the site with: make docs installs it"


@dataclass(frozen=True)
class Site:
    """The folder of the site's pages and the output of the build."""

    folder: Path
    printed: str

    def page(self, path: str) -> str:
        """The HTML of a page, by folder."""
        return (self.folder / path / "index.html").read_text(encoding="utf-8")


@pytest.fixture(scope="session")
def site(as_built: Project, tmp_path_factory: pytest.TempPathFactory) -> Site:
    """Build as `make docs` does. Without mkdocs tests are skipped; in CI they fail."""
    if importlib.util.find_spec("mkdocs") is None:
        (pytest.fail if os.environ.get("CI") else pytest.skip)(MISSING)
    folder = tmp_path_factory.mktemp("documentation")
    write(ROOT, folder / "build", as_built.folder / "results/report.html")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--config-file"]
    done = subprocess.run(
        [*command, str(folder / "build/mkdocs.yml")],
        cwd=ROOT, env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return Site(folder / "build/site", done.stdout + done.stderr)
