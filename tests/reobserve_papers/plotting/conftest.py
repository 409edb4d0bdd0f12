"""Fixtures of the plotting tests."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from reobserve_papers.plotting.style_sheet import use_sheet


@pytest.fixture(autouse=True)
def _default_style() -> Iterator[None]:
    """Reset the style sheet after each test."""
    yield
    use_sheet(None)
