"""The wheel, built once."""

from __future__ import annotations

import subprocess
import sys
import zipfile

import pytest

from tests import ROOT


@pytest.fixture(scope="session")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """The files of the wheel by name."""
    folder = tmp_path_factory.mktemp("dist")
    words = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory"]
    subprocess.run([*words, str(folder)], cwd=ROOT, capture_output=True, check=True)
    (built,) = folder.iterdir()
    with zipfile.ZipFile(built) as archive:
        return {name: archive.read(name) for name in archive.namelist()}
