"""What tests of drawings share."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from reobserve.plotting.look import use_sheet


@pytest.fixture(autouse=True)
def _the_look_of_the_house() -> Iterator[None]:
    """A sheet that a test uses is laid aside after it."""
    yield
    use_sheet(None)
