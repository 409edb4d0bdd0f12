"""Many cases, each judged by a worker that is replaced when one kills it."""

from __future__ import annotations

import json
import os
import selectors
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from .judge import SECONDS, Verdict

ROOT = Path(__file__).parents[2]

# The number that asks what became of the valid examples of a class.
EXAMPLES = -1

# A worker that has used so many seconds of processor time, or waited so long, hangs where it cannot
# interrupt itself: in compiled code, or before a device.
_BUSY = SECONDS + 2
_IDLE = 6 * SECONDS
_AT_FIRST = 900  # the first case of a class comes after all that is compiled or made once


@dataclass(frozen=True)
class Failure:
    """A case that was neither accepted nor refused in one sentence."""

    name: str
    seed: int
    number: int
    verdict: Verdict
    text: str

    def __str__(self) -> str:
        again = f"python -m tests.fuzz --class {self.name} --seed {self.seed} --case {self.number}"
        return f"{again}\n    {self.verdict.word}: {self.verdict.detail}\n    {self.text}"


@dataclass
class Tally:
    """What became of the cases of a class."""

    counts: Counter[str] = field(default_factory=Counter)
    failures: list[Failure] = field(default_factory=list)


class Worker:
    """A process that judges cases; it is started anew where one ended it."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[str] | None = None
        self._known: set[str] = set()

    def judge(self, name: str, seed: int, number: int) -> tuple[Verdict, str]:
        """What became of one case, and the case in short."""
        process = self._running()
        assert process.stdin is not None
        assert process.stdout is not None
        known = name in self._known
        self._known.add(name)
        try:
            process.stdin.write(f"{name} {seed} {number}\n")
            process.stdin.flush()
        except BrokenPipeError:
            return self._ended(), ""
        if not _answers(process, (_BUSY, _IDLE) if known else (_AT_FIRST, _AT_FIRST)):
            self.close()
            return Verdict("hang", "no answer, and it cannot be interrupted"), ""
        answer = process.stdout.readline()
        if not answer:
            return self._ended(), ""
        word, detail, text = json.loads(answer)
        return Verdict(word, detail), text

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
        self._process, self._known = None, set()

    def _running(self) -> subprocess.Popen[str]:
        if self._process is None:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "tests.fuzz.worker"], cwd=ROOT, text=True,
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            )  # fmt: skip
        return self._process

    def _ended(self) -> Verdict:
        assert self._process is not None
        code = self._process.wait()
        self.close()
        return Verdict("crash", f"the process ended with {code}")


def _answers(process: subprocess.Popen[str], limits: tuple[float, float]) -> bool:
    """Whether there is an answer before so much processor time, and time, has passed [s]."""
    begun, before = time.monotonic(), _used(process)
    with selectors.DefaultSelector() as ready:
        ready.register(process.stdout, selectors.EVENT_READ)  # type: ignore[arg-type]
        while not ready.select(1.0):
            if _used(process) - before > limits[0] or time.monotonic() - begun > limits[1]:
                return False
    return True


def _used(process: subprocess.Popen[str]) -> float:
    """Processor time of a process [s], of the system and its own."""
    fields = (
        Path(f"/proc/{process.pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    )
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def run(worker: Worker, name: str, seed: int, numbers: Iterable[int]) -> Tally:
    """Judge these cases of a class."""
    tally = Tally()
    for number in numbers:
        verdict, text = worker.judge(name, seed, number)
        tally.counts[verdict.word] += 1
        if not verdict.good:
            tally.failures.append(Failure(name, seed, number, verdict, text))
    return tally


def distinct(failures: Iterable[Failure]) -> Iterator[Failure]:
    """The first failure of each kind: the same word at the same place."""
    seen = set()
    for failure in failures:
        word, detail = failure.verdict.word, failure.verdict.detail
        kind = (failure.name, word, detail.partition(":")[0], detail.rpartition("; ")[2])
        if kind not in seen:
            seen.add(kind)
            yield failure
