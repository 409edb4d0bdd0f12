"""The page on adding an observer, followed literally in a copy of the project."""

from __future__ import annotations

import csv
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from reobserve.core.discretisation import zero_order_hold
from tests.docs.hand_written import PAGES, ROOT, blocks

PAGE = PAGES / "how-to" / "add-an-observer.md"
FOLDERS = {"reobserve": "src", "observers": "tests/reobserve"}  # which the page leaves out


def place_of(title: str) -> str:
    """A file of the page by its place in the project."""
    folder = FOLDERS.get(title.partition("/")[0])
    return f"{folder}/{title}" if folder else title


TITLED = {place_of(found[1]): block.text for block in blocks(PAGE)
          if (found := re.fullmatch(r'title="(.*)"', block.options))}  # fmt: skip
ALGORITHM = "src/reobserve/observers/clipped_kalman.py"
FAMILY = "src/reobserve/estimation/families/clipped_kalman.py"
CASES = "tests/reobserve/observers/cases_clipped_kalman.py"
PUBLIC, TABLE = "src/reobserve/__init__.pyi", "src/reobserve/estimation/families/__init__.py"
TYPED = [line[2:] for block in blocks(PAGE) if block.language == "console"
         for line in block.text.splitlines()]  # fmt: skip
# Of the tests and the documentation, what is run in the copy, with few of the other cases.
COPIED = (
    "src", "tests/__init__.py", "tests/conftest.py", "tests/cpu_budget.py", "tests/forks.py",
    "tests/reobserve",
    "docs/generate",
)  # fmt: skip


def copied(folder: Path) -> Path:
    """The three files and the two lines in a copy of the project."""
    for name in COPIED:
        if (ROOT / name).is_dir():
            hidden = shutil.ignore_patterns("__pycache__")
            shutil.copytree(ROOT / name, folder / name, ignore=hidden)
        else:
            (folder / name).parent.mkdir(exist_ok=True)
            shutil.copy2(ROOT / name, folder / name)
    for name in (ALGORITHM, FAMILY, CASES):
        assert not (folder / name).exists()
        (folder / name).write_text(TITLED[name], encoding="utf-8")
    for name, before in ((PUBLIC, "\n__all__"), (TABLE, "}\n\n\ndef family")):
        text = (folder / name).read_text(encoding="utf-8")
        assert text.count(before) == len(TITLED[name].splitlines()) == 1
        whole = text.replace(before, f"{TITLED[name]}{before}")
        (folder / name).write_text(whole, encoding="utf-8")
    return folder / "src"


def run_in(folder: Path, source: Path, *words: str) -> str:
    """What Python prints in a folder, with the packages in ``source`` first."""
    path = os.pathsep.join([str(source), str(folder), str(ROOT / "src")])
    environment = {**os.environ, "PYTHONPATH": path, "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(
        [sys.executable, *words], cwd=folder, env=environment, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_the_page_states_all_files_and_lines() -> None:
    assert set(TITLED) == {ALGORITHM, FAMILY, CASES, PUBLIC, TABLE}
    assert len(TYPED) == 5


@pytest.mark.nightly
def test_following_the_page_adds_an_observer_to_all_commands(tmp_path: Path) -> None:
    source = copied(tmp_path)
    for typed in TYPED:
        if typed == TYPED[-1]:
            add_outliers(tmp_path / "record.csv")
        reported = run_in(tmp_path, source, "-m", *typed.split())
        if "--out motor.json" in typed:
            assert "clipped from 10 deviations on" in reported
    assert "static void clipped_gain(" in (tmp_path / "code/motor.c").read_text()
    with (tmp_path / "estimates.csv").open(newline="") as stream:
        titles, *rows = csv.reader(stream)
    with (tmp_path / "record.csv").open(newline="") as stream:
        _, *record = csv.reader(stream)
    y = np.array([[float(one or "nan") for one in row[1:]] for row in record])
    wanted = by_numpy(y[:, :2] * [2.0 * np.pi / 60.0, 1e-3], y[:, 2:])
    speed, current = (titles.index(title) for title in ("speed [rad/s]", "current [A]"))
    found = np.array([[float(row[speed]), float(row[current])] for row in rows])
    np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-12)


def add_outliers(path: Path) -> None:
    """Thousands of rpm too much in every fiftieth row."""
    titles, *rows = path.read_text(encoding="utf-8").splitlines()
    for k in range(49, len(rows), 50):
        time, speed, *rest = rows[k].split(",")
        rows[k] = ",".join([time, str(3000.0 + float(speed or 0.0)), *rest])
    path.write_text("\n".join([titles, *rows, ""]), encoding="utf-8")


def by_numpy(y: np.ndarray, u: np.ndarray) -> np.ndarray:
    """The filter of the example, over y in the model's units."""
    A, B = zero_order_hold([[-10.0, 40.0], [-0.4, -20.0]], [[0.0], [20.0]], 0.01)
    x, P, rows, clipped = np.zeros(2), np.eye(2), [], 0
    for k in range(len(y)):
        if k:
            x, P = A @ x + B @ u[k - 1], A @ P @ A.T + 1e-4 * np.eye(2)
        there = ~np.isnan(y[k])
        C, R = np.eye(2)[there], np.diag([1e-3, 1e-4])[np.ix_(there, there)]
        e, S = y[k][there] - C @ x, C @ P @ C.T + R
        K = P @ C.T @ np.linalg.inv(S)
        distance = np.sqrt(e @ np.linalg.solve(S, e)) if there.any() else 0.0
        K, clipped = K * 10.0 / max(distance, 10.0), clipped + (distance > 10.0)
        x, M = x + K @ e, np.eye(2) - K @ C
        P = M @ P @ M.T + K @ R @ K.T
        rows.append(x)
    assert clipped >= 10
    return np.array(rows)


OUTSIDE = """
import numpy as np
from reobserve import LinearModel
from tracking.clipped_kalman import ClippedKalmanFilter
A, B, y, u = np.load("record.npz").values()
observer = ClippedKalmanFilter(LinearModel(A, B, np.eye(2), Q=1e-4, R=[1e-3, 1e-4]), b=10.0)
np.save("found.npy", observer.run(y, u, start=observer.init([0.0, 0.0], 1.0))["state"])
"""


def test_algorithm_in_another_package_runs_in_python(tmp_path: Path) -> None:
    (tmp_path / "tracking").mkdir()
    (tmp_path / "tracking/clipped_kalman.py").write_text(TITLED[ALGORITHM], encoding="utf-8")
    A, B = zero_order_hold([[-10.0, 40.0], [-0.4, -20.0]], [[0.0], [20.0]], 0.01)
    y, u = np.zeros((100, 2)), np.ones((100, 1))
    y[4::9, 0], y[7::9, 1] = 300.0, np.nan
    np.savez(tmp_path / "record.npz", A=A, B=B, y=y, u=u)
    run_in(tmp_path, tmp_path, "-c", OUTSIDE)
    np.testing.assert_allclose(np.load(tmp_path / "found.npy"), by_numpy(y, u), rtol=1e-9)


@pytest.mark.nightly
def test_following_the_page_adds_an_observer_to_the_tests(tmp_path: Path) -> None:
    source = copied(tmp_path)
    folder = tmp_path / "tests/reobserve/observers"
    for path in folder.glob("cases_*.py"):
        if path.name not in (Path(CASES).name, "cases_filters.py"):
            path.unlink()  # to construct them takes long, uncompiled
    tests = [f"tests/reobserve/{name}" for name in (
        "observers/test_contract.py", "estimation/test_examples.py",
        "library/test_packages.py",
    )]  # fmt: skip
    chosen = ["-k", "clipped or Clipped or listed", "-p", "no:cacheprovider", "-n0", "-q"]
    reported = run_in(tmp_path, source, "-m", "pytest", *chosen, *tests)
    assert int(re.findall(r"(\d+) passed", reported)[-1]) > 45
    listed = run_in(tmp_path, source, "-c", "from docs.generate import abilities as a; "
                    "print(a.abilities())")  # fmt: skip
    rows = "".join(line for line in listed.splitlines() if "[`Clipped" in line)
    assert rows.count(" yes ") == 11
    assert rows.count("`clipped-kalman`") == 1
