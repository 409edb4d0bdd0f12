"""What became of a case, found in the process that runs it."""

from __future__ import annotations

import os
import resource
import shutil
import signal
import sys
import tempfile
import traceback
import warnings
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

from reobserve.errors import ReobserveError

from .case import LONGEST, Case, ImproperError, Refused, inside, shown

ACCEPTED, REFUSED = "accepted", "refused"
SECONDS = 10  # of processor time for one case; the processor may be busy with others
MEMORY = 4 << 30  # bytes that a case may ask for beside what the process has


@dataclass(frozen=True)
class Verdict:
    """What became of a case: `ACCEPTED`, `REFUSED` or a word for what is wrong, and details."""

    word: str
    detail: str = ""

    @property
    def good(self) -> bool:
        """Whether it is what must become of every case."""
        return self.word in (ACCEPTED, REFUSED)


class _TooLong(BaseException):
    """More time than a case may take."""


class _Escape(BaseException):
    """A write outside the case's folder, or a program that is started: it is not done."""


# Events of Python's own audit with the paths that they write; those with none start programs.
_WRITES = {
    **dict.fromkeys(("os.remove", "os.rmdir", "os.truncate", "os.chmod", "os.mkdir"), (0,)),
    **dict.fromkeys(("os.rename", "os.link", "os.symlink"), (0, 1)),
    **{"os.system": (), "subprocess.Popen": (), "os.exec": (), "os.posix_spawn": ()},
    **{"os.fork": (), "socket.connect": ()},
}
# The folder of the case that runs, if one does.
_watched: list[Path] = []


def watch() -> None:
    """From now on refuse what escapes from a case; cannot be undone in this process."""
    sys.addaudithook(_audit)


def _audit(event: str, arguments: tuple[Any, ...]) -> None:
    if not _watched:
        return
    if event == "open":
        path, mode, flags = arguments
        writes = flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT) if isinstance(flags, int) else 0
        if not writes and not (isinstance(mode, str) and set(mode) & set("wax+")):
            return
        _stay(event, path)
    elif event in _WRITES:
        if not _WRITES[event]:
            raise _Escape(f"{event} {shown(arguments)}")
        for place in _WRITES[event]:
            _stay(event, arguments[place])


def _stay(event: str, path: Any) -> None:
    if not isinstance(path, str | bytes | os.PathLike):
        return  # a descriptor, which was opened before
    where = os.path.realpath(os.fsdecode(path))
    if event == "os.mkdir" and os.path.isdir(where):
        return  # it only looks whether there is one
    if not any(inside(Path(where), folder) for folder in _watched) and not _of_a_cache(where):
        raise _Escape(f"{event} {where}")


def _of_a_cache(path: str) -> bool:
    return any(part in path for part in ("__pycache__", ".cache", "matplotlib"))


def limit_memory() -> None:
    """Let this process have `MEMORY` more than it has."""
    used = (
        int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[0])
        * resource.getpagesize()
    )
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, -1))


def _too_long(number: int, frame: FrameType | None) -> None:
    raise _TooLong


def judge(case: Case, seconds: float = SECONDS) -> Verdict:
    """Run a case in a new folder and say what became of it."""
    top = Path(tempfile.mkdtemp(prefix="fuzz-")).resolve()
    folder = top / "project" / "here"
    folder.mkdir(parents=True)
    before, previous = Path.cwd(), signal.signal(signal.SIGPROF, _too_long)
    try:
        for name, content in case.files.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(content)
        had = _contents(top)
        os.chdir(folder)
        _watched[:] = [folder]
        signal.setitimer(signal.ITIMER_PROF, seconds)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            verdict = _outcome(case)
        signal.setitimer(signal.ITIMER_PROF, 0)
        _watched.clear()
        return _with_files(verdict, had, _contents(top), folder)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        _watched.clear()
        os.chdir(before)
        signal.signal(signal.SIGPROF, previous)
        shutil.rmtree(top, ignore_errors=True)


def _outcome(case: Case) -> Verdict:
    try:
        case.run()
    except BaseException as error:
        return _raised(error)
    return Verdict("wrongly accepted", case.never) if case.never else Verdict(ACCEPTED)


def _raised(error: BaseException) -> Verdict:
    match error:
        case Refused():
            return Verdict(REFUSED, str(error))
        case ReobserveError():
            return _sentence(str(error))
        case ImproperError():
            return Verdict("improper", str(error))
        case _TooLong():
            return Verdict("hang", f"more than {SECONDS} s of processor time; {_place()}")
        case _Escape():
            return Verdict("escape", f"{error}; {_place()}")
    word = "memory" if isinstance(error, MemoryError) else "traceback"
    return Verdict(word, f"{type(error).__name__}: {shown(str(error))}; {_place()}")


def _sentence(text: str) -> Verdict:
    if len(text) > LONGEST:
        return Verdict("improper", f"a message of {len(text)} characters: {shown(text)}")
    if not text.strip() or "\n" in text:
        return Verdict("improper", f"a message that is not one line: {shown(text)}")
    return Verdict(REFUSED, text)


def _place() -> str:
    """The deepest line of ours in the traceback at hand."""
    frames = traceback.extract_tb(sys.exc_info()[2])
    ours = [frame for frame in frames if "/reobserve/" in frame.filename] or frames
    last = ours[-1]
    return f"{last.filename.rpartition('/src/')[2]}:{last.lineno}"


def _contents(top: Path) -> dict[Path, tuple[int, int]]:
    found = {}
    for path in top.rglob("*"):
        about = path.lstat()
        found[path] = (about.st_size, about.st_mtime_ns) if path.is_file() else (0, 0)
    return found


def _with_files(
    verdict: Verdict,
    before: dict[Path, tuple[int, int]],
    after: dict[Path, tuple[int, int]],
    folder: Path,
) -> Verdict:
    changed = [path for path, about in after.items() if before.get(path) != about]
    changed += [path for path in before if path not in after]
    outside = [path for path in changed if not inside(path, folder)]
    if outside:
        return Verdict("escape", f"changed {outside[0]}")
    left = [path for path in changed if path.name.endswith(".partial")]
    if verdict.word != ACCEPTED:  # what a refused command has changed, empty folders apart
        left += [path for path in changed if path not in after or path.is_file()]
    if left and verdict.good:
        return Verdict("half-written", f"{left[0].name} after it was {verdict.word}")
    return verdict
