"""Packages that the papers name for types only."""

from __future__ import annotations

from pathlib import Path

import reobserve_papers
from tests.reobserve.library.test_packages import imported_late


def test_packages_used_for_types_are_imported_late() -> None:
    assert "reobserve_papers.signals.series" in imported_late(
        Path(str(reobserve_papers.__file__)).parent
    )
