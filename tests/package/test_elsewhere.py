"""The library where it is not tested: on Windows and macOS, as far as they can be acted."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ACT = Path(__file__).with_name("elsewhere.py")


@pytest.mark.parametrize("system", ["win32", "darwin"])
def test_the_library_runs_on_another_system(system: str, tmp_path: Path) -> None:
    words = [sys.executable, "-X", "warn_default_encoding", str(ACT), system]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
