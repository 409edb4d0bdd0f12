"""The page on adding an observer, followed literally in a copy of the package and outside of it."""

from __future__ import annotations

import csv
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.docs.hand_written import PAGES, ROOT, blocks

PAGE = PAGES / "how-to" / "add-an-observer.md"
TITLED = {found[1]: block.text for block in blocks(PAGE)
          if (found := re.fullmatch(r'title="(.*)"', block.options))}  # fmt: skip
ALGORITHM = "observers/alpha_beta.py"
FAMILY = "estimation/families/alpha_beta.py"
TYPED = [line[2:] for block in blocks(PAGE) if block.language == "console"
         for line in block.text.splitlines()]  # fmt: skip


def copied(folder: Path) -> Path:
    """The two files and the line of the table in a copy of the package."""
    shutil.copytree(ROOT / "src", folder / "src", ignore=shutil.ignore_patterns("__pycache__"))
    for name in (ALGORITHM, FAMILY):
        (folder / "src/reobserve" / name).write_text(TITLED[name], encoding="utf-8")
    table = folder / "src/reobserve/estimation/families/__init__.py"
    text = table.read_text(encoding="utf-8")
    last = next(line for line in text.splitlines() if '"levant:LevantDesign"' in line)
    table.write_text(text.replace(last, f"{last}\n{TITLED['FAMILIES'].rstrip()}"), encoding="utf-8")
    return folder / "src"


def installed(folder: Path) -> Path:
    """The two files in a user's package, installed as by pip."""
    package, about = folder / "tracking", folder / "tracking-1.0.dist-info"
    package.mkdir()
    about.mkdir()
    (package / "__init__.py").touch()
    (package / "alpha_beta.py").write_text(TITLED[ALGORITHM], encoding="utf-8")
    moved = TITLED[FAMILY].replace("reobserve.observers.alpha_beta", "tracking.alpha_beta")
    (package / "family.py").write_text(moved, encoding="utf-8")
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: tracking\nVersion: 1.0\n")
    lines = TITLED["pyproject.toml"].replace('[project.entry-points."reobserve.families"]', "")
    (about / "entry_points.txt").write_text("[reobserve.families]\n" + lines.replace('"', ""))
    return folder


@pytest.mark.parametrize("place", [copied, installed])
def test_following_the_page_adds_an_observer_to_all_commands(
    place: Callable[[Path], Path], tmp_path: Path
) -> None:
    path = os.pathsep.join([str(place(tmp_path)), str(ROOT / "src")])
    environment = {**os.environ, "PYTHONPATH": path, "NUMBA_DISABLE_JIT": "1"}

    def run(typed: str) -> str:
        words = [sys.executable, "-m", *typed.split()]
        done = subprocess.run(
            words, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    assert len(TYPED) == 5
    for typed in TYPED:
        if (
            place is installed and "--example alpha-beta" in typed
        ):  # a user's package has no examples
            run(typed.replace("--example alpha-beta", "--example levant"))
            about, _, observer = TITLED[FAMILY].partition('RECORD = """\\\n')[2].partition("\n")
            assert about.startswith("# Alpha-beta")
            columns = (tmp_path / "record.yaml").read_text().partition("columns:")[2]
            stated = observer.partition('"""')[0]
            (tmp_path / "record.yaml").write_text(f"{stated}columns:{columns}")
            continue
        reported = run(typed)
        if "--out cart.json" in typed:
            assert "poles: 0." in reported
    assert "0.2, 2.0" in (tmp_path / "code/cart.c").read_text()
    with (tmp_path / "estimates.csv").open(newline="") as stream:
        titles, *rows = csv.reader(stream)
    with (tmp_path / "record.csv").open(newline="") as stream:
        measured = np.array([float(row[1]) for row in list(csv.reader(stream))[1:]]) / 1000.0
    found = np.array([[float(row[1]), float(row[2])] for row in rows])
    assert titles[1:3] == ["state_1", "state_2"]
    # The same filter as a linear recursion x(k) = M x(k-1) + K y(k).
    K, T = np.array([0.2, 0.02 / 0.01]), 0.01
    A = np.array([[1.0, T], [0.0, 1.0]])
    M = A - np.outer(K, A[0])
    x, expected = np.array([measured[0], 0.0]), []
    for k, y in enumerate(measured):
        x = M @ x + K * y if k else x
        expected.append(x)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)
