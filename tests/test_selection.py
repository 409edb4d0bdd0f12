"""Which tests run for a change, and in which order and process."""

from __future__ import annotations

import subprocess

import pytest

from tests import ROOT
from tests.conftest import FIRST, SHARED

PACKAGES = ("reobserve", "reobserve_papers")
GOLDEN = "tests/reobserve_papers/golden/test_golden.py"


def affected(changed: str, *options: str) -> list[str]:
    """The tests that `tests/affected.sh` prints for a changed file."""
    command = ["sh", "tests/affected.sh", *options]
    done = subprocess.run(
        command, input=f"{changed}\n", cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stderr == ""
    return done.stdout.split()


@pytest.mark.parametrize("package", PACKAGES)
def test_change_of_any_module_runs_tests_of_its_package_only(package: str) -> None:
    for path in sorted((ROOT / "src" / package).rglob("*.py")):
        found = affected(str(path.relative_to(ROOT)))
        assert found, path
        assert all(one.startswith(f"tests/{package}/") for one in found), path
        assert all((ROOT / one).exists() for one in found), path


@pytest.mark.parametrize(
    "name",
    [
        "reobserve/observers/{}imm.py",
        "reobserve/tuning/{}recorded.py",
        "reobserve_papers/papers/ilo/{}study.py",
    ],
)
def test_change_of_a_module_runs_its_own_test_file(name: str) -> None:
    test = f"tests/{name.format('test_')}"
    assert (ROOT / test).is_file()
    assert affected(f"src/{name.format('')}") == [test]


def test_change_of_the_library_in_a_branch_runs_the_golden_numbers_of_the_papers() -> None:
    assert GOLDEN in affected("src/reobserve/observers/imm.py", "golden")
    assert GOLDEN not in affected("src/reobserve_papers/papers/ilo/study.py", "golden")
    assert (ROOT / GOLDEN).is_file()


def test_files_that_share_a_process_or_start_first_exist() -> None:
    """Else two processes would edit one built project, or all would wait for the build."""
    assert {file for file in (*SHARED, *FIRST) if not (ROOT / file).is_file()} == set()
    assert {SHARED.get(file) for file in FIRST} == {"reobserve_papers/pipeline", None}
