"""The replaced computation of metrics."""

from __future__ import annotations

import pytest

from reobserve_papers.claims import outcomes

from .stub import Code


@pytest.fixture
def code(monkeypatch: pytest.MonkeyPatch) -> Code:
    """The replaced computation, which a test may change and count."""
    instead = Code()
    monkeypatch.setattr(outcomes, "metrics_of", instead)
    return instead
