"""`make quick` runs what a change touches, and tells what it had no time for."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.quick.checks import changed_files, checks_of, room_tests, run_checks

ROOT = Path(__file__).parents[2]


def git(folder: Path, *words: str) -> None:
    name = ("-c", "user.name=t", "-c", "user.email=t@example.org")
    subprocess.run(["git", *name, *words], cwd=folder, check=True, capture_output=True)


def test_what_changed_is_what_differs_or_is_new(tmp_path: Path) -> None:
    git(tmp_path, "init", "--quiet")
    for name in ("kept", "edited", "gone", ".gitignore"):
        (tmp_path / name).write_text("ignored\n")
    git(tmp_path, "add", "--all")
    git(tmp_path, "commit", "--quiet", "--message", "first")
    (tmp_path / "edited").write_text("otherwise\n")
    (tmp_path / "gone").unlink()
    for name in ("new", "ignored"):
        (tmp_path / name).touch()
    assert changed_files(tmp_path, "HEAD") == ["edited", "new"]
    git(tmp_path, "add", "--all")
    git(tmp_path, "commit", "--quiet", "--message", "second")
    assert changed_files(tmp_path, "HEAD") == []
    assert changed_files(tmp_path, "HEAD~1") == ["edited", "new"]
    with pytest.raises(SystemExit, match="nowhere"):
        changed_files(tmp_path, "nowhere")


def test_a_change_is_tried_by_the_room_tests_its_room() -> None:
    assert room_tests("src/reobserve/drawing/captions.py") == "tests/drawing/test_captions.py"
    assert room_tests("tests/drawing/test_captions.py") == "tests/drawing/test_captions.py"
    assert room_tests("tests/pipeline/conftest.py") == ""
    assert room_tests("docs/pages/index.md") == "tests/docs/test_pages.py"
    assert room_tests("config/papers/ilo.yaml") == "tests/ledger/test_ledger.py"
    assert room_tests("docs/pages/tutorials/ilo.md").endswith(' -k "tutorials/ilo.md"')
    files = [
        "config/papers/ilo.yaml", "src/reobserve/drawing/captions.py", "src/reobserve/cli.py",
        "workflow/rules/figures.smk",
    ]  # fmt: skip
    commands = checks_of(ROOT, files)
    assert ["ruff", "check", *files[1:3]] in commands
    assert [sys.executable, "-m", "reobserve", "check", "ilo"] in commands
    tried = [command for command in commands if command[0] == "pytest"]
    assert sum("tests/drawing/test_captions.py" in command for command in tried) == 1
    assert any(command[-2:] == ["-k", "not snakemake"] for command in tried)


def test_it_ends_in_time_and_says_what_did_not() -> None:
    def code(text: str) -> list[str]:
        return [sys.executable, "-c", text]

    begun = time.monotonic()
    commands = [code("pass"), code("exit(3)"), code("import time; time.sleep(60)"), code("exit(5)")]
    ended = list(run_checks(commands, ROOT, begun + 5.0))
    assert time.monotonic() - begun < 30
    found = {end.told.split(" -c ")[1]: end.verdict for end in ended}
    assert found == {
        "pass": "passed", "'exit(3)'": "failed", "'exit(5)'": "passed",
        "'import time; time.sleep(60)'": "not ended",
    }  # fmt: skip
    late = list(run_checks(commands[:1], ROOT, time.monotonic() - 1.0))
    assert [end.verdict for end in late] == ["not ended"]
