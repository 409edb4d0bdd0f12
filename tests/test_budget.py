"""The size of each part is within `tests/budget.toml`, so that growth is seen with its reason."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from tests import ROOT
from tests.budget import counted, differences, job_seconds, run, stated
from tests.cpu_budget import beyond


def test_no_part_is_above_its_size_or_far_below_it() -> None:
    assert differences(stated(), counted()) == []


@pytest.mark.parametrize(("size", "is_within"), [(200, 1), (194, 1), (201, 0), (193, 0), (0, 0)])
def test_sizes_are_held_from_both_sides(size: int, is_within: bool) -> None:
    found = differences({"lines of x": {"a": 200, "b": 7}}, {"lines of x": {"a": size, "b": 7}})
    assert (found == []) == is_within
    said = f"lines of x a: {size}, where tests/budget.toml has 200: put 'a = {size}' under "
    assert all(one.startswith(said) and "reason" in one for one in found)


def test_new_and_removed_parts_are_named() -> None:
    one, other = {"lines of x": {"a": 2, "b": 0}}, {"lines of x": {"a": 2}}
    assert "put 'no b'" in differences(one, other)[0]
    assert "put 'b = 0'" in differences(other, one)[0]


def test_lines_and_words_are_counted(tmp_path: Path) -> None:
    files = {
        "src/reobserve/core/a.py": "1\n2\n",
        "src/reobserve/core/deep/b.py": "3\n",
        "src/reobserve/core/data.csv": "4\n",
        "src/reobserve/top.py": "5\n",
        "src/reobserve_papers/ilo/a.py": "",
        "tests/reobserve/core/test_a.py": "1\n" * 6,
        "tests/reobserve_papers/ilo/test_a.py": "1\n",
        "tests/conftest.py": "1\n",
        "docs/outputs.py": "1\n",
        "docs/generate/a.py": "1\n",
        "docs/pages/index.md": "one two\n",
        "docs/pages/start/a.md": "one, two three",
        "benchmarks/a.py": "1\n",
        "workflow/rules/a.smk": "1\n2\n",
        "README.md": "a b c d",
        "CHANGELOG.md": "",
        "CONTRIBUTING.md": "",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    found = counted(tmp_path)
    assert found["lines of src/reobserve"] == {"core": 3, "files beside": 1}
    assert found["lines of tests/reobserve"] == {"core": 6, "files beside": 0}
    assert found["lines of tests"] == {"files beside": 1}
    assert found["lines of"] == {"docs": 2, "benchmarks": 1, "workflow": 2}
    assert found["words of"]["README.md"] == 4
    assert found["words of"]["docs/pages/start"] == 3
    assert found["words of"]["docs/pages"] == 2


def test_seconds_of_jobs_are_those_of_benchmark_files(tmp_path: Path) -> None:
    for name, seconds in (("ilo/fig1.plot", "1.5"), ("report", "2.25")):
        path = tmp_path / f"{name}.tsv"
        path.parent.mkdir(exist_ok=True)
        path.write_text(f"s\th:m:s\tmax_rss\n{seconds}\t0:00:01\t3\n")
    assert job_seconds(tmp_path) == 3.75


def test_command_that_the_table_does_not_have_is_refused() -> None:
    with pytest.raises(SystemExit, match=r"budget.toml: \[seconds\] has no 'true', only make test"):
        run(["true"])


def cases(**seconds: list[float]) -> dict[str, float]:
    """CPU seconds by the name of each case."""
    return {f"t.py::{name}[{n}]": s for name, each in seconds.items() for n, s in enumerate(each)}


@pytest.mark.parametrize(
    ("seconds", "said"),
    [
        ([2.9], []),
        ([3.1], ["t.py::a[0]: 3.1 CPU s, a case may take 3"]),
        ([1.0, 0.9], []),
        (
            [0.9, 0.9, 0.5],
            ["t.py::a: 2.3 CPU s in 3 cases, a function may take 2"],
        ),
        # The first case stays, and so do others that cost next to nothing.
        ([2.9, 0.1], []),
        ([2.9, 0.3], ["t.py::a: 3.2 CPU s in 2 cases, a function may take 2"]),
    ],
)
def test_cases_and_functions_have_a_budget(seconds: list[float], said: list[str]) -> None:
    assert beyond(cases(a=seconds)) == said


def test_twice_the_budget_is_for_cases_and_functions() -> None:
    assert beyond(cases(a=[5.9], b=[1.9, 1.9]), 2.0) == []
    assert [one.partition(":: ")[0][:9] for one in beyond(cases(a=[6.1], b=[2.1, 2.1]), 2.0)] == [
        "t.py::a[0", "t.py::b: ",
    ]  # fmt: skip


BURN = """
import subprocess, sys
import numba
import pytest

BUSY = "import time\\nwhile time.process_time() < {}: pass"


@pytest.fixture(scope="session")
def shared():
    subprocess.run([sys.executable, "-c", BUSY.format(0.5)])


@pytest.mark.nightly_after(3)
@pytest.mark.nightly_cases("0")
@pytest.mark.parametrize("one", [1, 0, 2, 3])
def test_burns(shared, one):
    numba.njit(lambda x: x + one)(1.0)
    subprocess.run([sys.executable, "-c", BUSY.format(0.15 * one)])
"""


@pytest.mark.nightly_after(1)
@pytest.mark.parametrize("processes", ["0", "1"])
def test_plugin_measures_cases_and_leaves_late_ones_to_the_night(
    tmp_path: Path, processes: str
) -> None:
    """Children count, fixtures that tests share and compilation do not; one process or several."""
    (tmp_path / "test_burn.py").write_text(BURN)
    (tmp_path / "pytest.ini").write_text(
        "[pytest]\nmarkers = nightly\n  nightly_after\n  nightly_cases\n"
    )
    command = [
        sys.executable, "-m", "pytest", "-p", "tests.cpu_budget", "-n", processes,
        "--rootdir", str(tmp_path), "-m", "not nightly", "--junitxml", "report.xml",
    ]  # fmt: skip
    done = subprocess.run(
        command, cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(ROOT)},
        check=True, capture_output=True, text=True,
    )  # fmt: skip
    found = {
        case.get("name"): float(one.get("value", ""))
        for case in ElementTree.parse(tmp_path / "report.xml").iter("testcase")
        for one in case.iter("property")
    }
    assert set(found) == {"test_burns[1]", "test_burns[2]"}
    assert 0.15 < found["test_burns[1]"] < 0.4  # 0.65 with the fixture, 0.45 with compilation
    assert 0.3 < found["test_burns[2]"] < 0.6
    assert "in 2 cases that are not nightly; 0 beyond the budget" in done.stdout
