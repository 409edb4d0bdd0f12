"""What a change touches, and running that within a time."""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

from tests.mutations.fresh import room

_PYTEST = ("pytest", "-q", "-x", "--no-header", "-p", "no:cacheprovider")


@dataclass(frozen=True)
class Ended:
    """A check that was run, or was not run to its end."""

    told: str
    verdict: str  # passed, failed or not ended
    printed: str = ""


def changed_files(root: Path, since: str) -> list[str]:
    """The files below a folder that differ from a commit, new ones too, that are still there.

    Raises
    ------
    SystemExit
        If git knows no such commit.
    """
    found: set[str] = set()
    for command in (
        ["diff", "--name-only", since, "--"], ["ls-files", "--others", "--exclude-standard"],
    ):  # fmt: skip
        done = subprocess.run(
            ["git", *command], cwd=root, capture_output=True, text=True, check=False
        )
        if done.returncode:
            raise SystemExit(done.stderr.strip())
        found.update(done.stdout.splitlines())
    return sorted(file for file in found if (root / file).is_file())


_OF_FOLDERS = {
    "config/papers": "tests/ledger/test_ledger.py",
    "config/claims": "tests/evidence/claims/test_registry.py",
    "config/errata": "tests/evidence/claims/test_registry.py",
    "config/equations": "tests/evidence/equations",
}
_PAGES = ("docs/pages/tutorials", "docs/pages/how-to", "docs/pages/explanation")


def room_tests(file: str) -> str:
    """The tests that a file is tried by, as arguments of pytest; empty if there are none."""
    folder, _, name = file.rpartition("/")
    if file.startswith("tests/"):
        return file if name.startswith("test_") and name.endswith(".py") else ""
    if folder in _OF_FOLDERS:
        return _OF_FOLDERS[folder]
    if folder in _PAGES:
        return f'tests/docs/test_hand_written.py -k "{folder.rpartition("/")[2]}/{name}"'
    if file == "mkdocs.yml" or file.startswith("docs/"):
        return "tests/docs/test_pages.py"
    if file.startswith(("src/", "workflow/")):
        return room(file)
    return "tests/test_project.py"


def checks_of(root: Path, files: Iterable[str]) -> list[list[str]]:
    """Commands that try what is in these files: style and types first, one pytest for each room."""
    files = list(files)
    python = [file for file in files if file.endswith(".py")]
    papers = {
        Path(file).stem for file in files if file.startswith("config/papers/")
    }  # their ledgers as a build checks them
    checks: list[list[str]] = []
    if python:
        checks += [["ruff", "check", *python], ["ruff", "format", "--check", *python], ["mypy"]]
    if papers:
        checks.append([sys.executable, "-m", "reobserve", "check", *sorted(papers)])
    plain = dict.fromkeys(["tests/test_project.py"])
    chosen: dict[str, None] = {}
    for file in files:
        tests = room_tests(file)
        if " -k " in tests:
            chosen[tests] = None
        else:
            plain.update(dict.fromkeys(tests.split()))
    return [*checks, *([*_PYTEST, *shlex.split(line)] for line in (*plain, *chosen))]


def run_checks(
    commands: Sequence[Sequence[str]], root: Path, deadline: float, at_once: int = 2
) -> Iterator[Ended]:
    """Run commands, so many at a time, until a time of `time.monotonic`; as they end."""
    with ThreadPoolExecutor(at_once) as pool:
        waiting = [pool.submit(_run, command, root, deadline) for command in commands]
        for future in as_completed(waiting):
            yield future.result()


def _run(command: Sequence[str], root: Path, deadline: float) -> Ended:
    told = shlex.join(word for word in command if word not in _PYTEST[1:] and word != "pytest")
    left = deadline - time.monotonic()
    if left <= 0:
        return Ended(told, "not ended")
    process = subprocess.Popen(
        [sys.executable, "-m", *command] if command[0] != sys.executable else command,
        cwd=root, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace",
        start_new_session=True,
    )  # fmt: skip
    try:
        printed, _ = process.communicate(timeout=left)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        return Ended(told, "not ended")
    # 5: of what was chosen there is no test.
    return Ended(told, "passed" if process.returncode in (0, 5) else "failed", printed)
