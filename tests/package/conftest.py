"""The wheel, built and unpacked once."""

from __future__ import annotations

from pathlib import Path

import pytest

from .environments import ROOT, build, unpack


@pytest.fixture(scope="session")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel as a file."""
    (built,) = build(ROOT, tmp_path_factory.mktemp("dist"), "wheel")
    return built


@pytest.fixture(scope="session")
def unpacked(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel as pip lays it out."""
    return unpack(wheel, tmp_path_factory.mktemp("unpacked"))
