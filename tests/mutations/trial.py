"""One change at a time, made in a copy of the project and judged by the tests of its room."""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
import sys
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, field
from importlib.util import cache_from_source
from pathlib import Path
from queue import SimpleQueue

import yaml

from tests.project_copy import copy_environment, copy_project

PATCHES = Path(__file__).with_name("patches.yaml")

LONGEST = 1800  # [s] that the tests of one change may take: a loop that never ends is noticed, too
_AROUND = 24  # characters shown before and after what is different
_NO_TESTS = (4, 5)  # exit codes of pytest: wrong arguments, nothing collected
_FAILED = ("FAILED ", "ERROR ")  # how pytest begins the line that sums up a test


@dataclass(frozen=True)
class Mutation:
    """The text ``old``, which ``file`` has once, replaced by ``new``, and the tests to notice it.

    ``tests`` are arguments of pytest. ``equivalent`` says why nothing can notice it, if so.
    """

    file: str
    old: str
    new: str
    tests: str
    equivalent: str = ""
    line: int = 0

    def applied(self, text: str) -> str:
        """The file's text with the change; `LookupError` if the place is not there once.

        A fresh one knows its line, so its text may stand elsewhere, too.
        """
        if self.line:
            lines = text.splitlines(keepends=True)
            before = sum(map(len, lines[: self.line - 1]))
            if not text.startswith(self.old, before):
                raise LookupError
            return text[:before] + self.new + text[before + len(self.old) :]
        if text.count(self.old) != 1:
            raise LookupError
        return text.replace(self.old, self.new)

    def __str__(self) -> str:
        """The file and what is different, in one line."""
        place = f"{self.file}:{self.line}" if self.line else self.file
        before = _alike(self.old, self.new)
        after = _alike(self.old[:before:-1], self.new[:before:-1])
        start, end = max(0, before - _AROUND), max(0, after - _AROUND)
        old, new = (text[start : len(text) - end] for text in (self.old, self.new))
        return f"{place}: {_in_one_line(old)} -> {_in_one_line(new)}"


def _alike(one: str, other: str) -> int:
    """How many characters two texts begin with alike."""
    pairs = zip(one, other, strict=False)
    return next((k for k, (a, b) in enumerate(pairs) if a != b), min(len(one), len(other)))


def _in_one_line(text: str) -> str:
    return " ".join(text.split()) or "nothing"


@dataclass(frozen=True)
class Outcome:
    """caught, survived, equivalent, stale (the place is gone) or broken (the tests fail anyway)."""

    mutation: Mutation
    verdict: str
    said: str = ""


def kept() -> list[Mutation]:
    """The list of changes that were tried before."""
    return [Mutation(**body) for body in yaml.safe_load(PATCHES.read_text(encoding="utf-8"))]


@dataclass
class Trials:
    """Copies of ``project``, one a job.

    A change is caught by a test that fails with it and passes without it.
    """

    project: Path
    folder: Path
    jobs: int = 1
    _sound: dict[str, bool] = field(default_factory=dict)

    def run(self, mutations: Iterable[Mutation]) -> Iterator[tuple[int, Outcome]]:
        """The outcomes as they come, each with the place of its mutation in the list."""
        copies: SimpleQueue[Path] = SimpleQueue()
        for number in range(self.jobs):
            copies.put(self._copy(number))
        with ThreadPoolExecutor(self.jobs) as pool:
            pending = {
                pool.submit(self._judged, mutation, copies): place
                for place, mutation in enumerate(mutations)
            }
            for done in as_completed(pending):
                yield pending[done], done.result()

    def _copy(self, number: int) -> Path:
        copy = self.folder / str(number)
        copy_project(self.project, copy)
        git = ("git", "-c", "user.name=t", "-c", "user.email=t@example.org")
        for words in (["init", "--quiet"], ["add", "--all"], ["commit", "--quiet", "-m", "all"]):
            subprocess.run([*git, *words], cwd=copy, check=True)
        return copy

    def _judged(self, mutation: Mutation, copies: SimpleQueue[Path]) -> Outcome:
        copy = copies.get()
        try:
            return self._judge(mutation, copy)
        finally:
            copies.put(copy)

    def _judge(self, mutation: Mutation, copy: Path) -> Outcome:
        path = copy / mutation.file
        try:
            before, status = path.read_text(encoding="utf-8"), path.stat()
            after = mutation.applied(before)
        except (OSError, LookupError):
            return Outcome(mutation, "stale")
        cached = Path(cache_from_source(str(path)))
        path.write_text(after, encoding="utf-8")
        cached.unlink(missing_ok=True)
        try:
            code, said = _tested(copy, mutation.tests)
        finally:
            path.write_text(before, encoding="utf-8")
            os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))
            cached.unlink(missing_ok=True)
        if code == 0:
            return Outcome(mutation, "equivalent" if mutation.equivalent else "survived")
        if code in _NO_TESTS or not self._passes(copy, said):
            return Outcome(mutation, "broken", said)
        return Outcome(mutation, "caught", said)

    def _passes(self, copy: Path, said: str) -> bool:
        """Whether the test that failed passes in the copy as it is."""
        if not said.startswith(_FAILED):
            return True
        test = said.split()[1].partition("[")[0]
        if test not in self._sound:
            self._sound[test] = _tested(copy, shlex.quote(test))[0] == 0
        return self._sound[test]


def _tested(copy: Path, tests: str) -> tuple[int, str]:
    """The exit code of pytest in the copy, and its last line on what failed."""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider"]
    process = subprocess.Popen(
        [*command, *shlex.split(tests)],
        cwd=copy, env=copy_environment(copy), start_new_session=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace",
    )  # fmt: skip
    try:
        printed, _ = process.communicate(timeout=LONGEST)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        return 1, f"did not end in {LONGEST} s"
    lines = printed.splitlines()
    failed = [line for line in lines if line.startswith(_FAILED)]
    return process.returncode, (failed or lines or [""])[-1][:200]
