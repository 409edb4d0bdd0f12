"""Kernels outside the observers, compiled with checks of all indices."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests import ROOT

PARTS = (
    "reobserve/detection", "reobserve/polynomials", "reobserve/core/test_chandrupatla.py",
    "reobserve_papers/papers/delay/test_estimators.py",
)  # fmt: skip


@pytest.mark.nightly
@pytest.mark.parametrize("part", PARTS)
def test_no_kernel_reads_or_writes_beyond_its_arrays(part: str, tmp_path: Path) -> None:
    environment = {**os.environ, "NUMBA_BOUNDSCHECK": "1", "NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider"]
    done = subprocess.run(
        [*command, f"tests/{part}"],
        cwd=ROOT, env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-3000:]
