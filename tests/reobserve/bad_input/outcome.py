"""The required outcome of invalid input."""

from __future__ import annotations

import contextlib
import io
import os
import resource
import sys
import tempfile
import warnings
from argparse import ArgumentParser
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import SimpleNamespace

from reobserve.cli.main import command_parser, main
from reobserve.core.errors import ReobserveError

LONGEST = 1000  # maximum length of a message
MEMORY = 4 << 30  # maximum memory that a call may request


class RefusedError(ReobserveError):
    """The command line refused, with an exit code and a one-line message."""


def is_accepted(
    call: Callable[[], object],
    files: Mapping[str, bytes] | None = None,
    project: Path | None = None,
) -> bool:
    """Make a call in a folder with these files: True if it returns, False if it refuses.

    The folder also has what it lacks of the configuration of a ``project``.

    Anything else fails: another exception, a sentence of several lines, a file left or changed by a
    refused call, a file outside the folder, or a half-written file.
    """
    with tempfile.TemporaryDirectory() as scratch:
        top = Path(scratch).resolve()
        folder = top / "above" / "here"
        folder.mkdir(parents=True)
        for name, content in (files or {}).items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(content)
        if project is not None:
            _link_project(project, folder, ("config", "workflow"))
        before = _files(top)
        refused, kind = list[str](), ""
        with contextlib.chdir(folder), limited_memory(), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                call()
            except ReobserveError as error:
                refused = [str(one) for one in getattr(error, "problems", [error])]
                kind = type(error).__name__
        after = _files(top)
        changed = {name for name in {*before, *after} if before.get(name) != after.get(name)}
        assert not kind.startswith("_"), "a private class of error"
        assert changed == set() or not refused, "a refused call changed files"
        for refusal in refused:  # all that is wrong with a record, a sentence each
            assert refusal.strip(), "an empty message"
            assert "\n" not in refusal
            assert len(refusal) <= LONGEST
        assert [name for name in changed if not name.startswith("above/here/")] == []
        assert [name for name in changed if "escaped" in name or name.endswith(".partial")] == []
        return not refused


def command(
    *words: object,
    stdin: bytes = b"",
    parse_only: bool = False,
    main: Callable[[list[str]], int] = main,
    parser: Callable[[], ArgumentParser] = command_parser,
) -> str:
    """What ``reobserve``, or only its parser, prints in this process.

    Raises `RefusedError` if it refuses.
    """
    out, err = io.StringIO(), io.StringIO()
    line, before = list(map(str, words)), sys.stdin
    sys.stdin = SimpleNamespace(buffer=io.BytesIO(stdin))  # type: ignore[assignment]
    code: object = 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code = 0 if parse_only and parser().parse_args(line) else main(line)
        except SystemExit as stop:
            code = stop.code
        finally:
            sys.stdin = before
    if code != 0:
        usage, _, said = f"\n{err.getvalue()}".partition("\nreobserve")
        messages = [line for line in f"reobserve{said}".splitlines() if line[:1] != " "]
        assert code in (1, 2)
        assert all(message.startswith("reobserve") for message in messages), messages
        assert not usage or usage.startswith("\nusage: "), usage
        assert len(messages) == 1 or line[0] == "estimate", "more than one refusal"
        raise RefusedError(messages[-1])
    return out.getvalue()


def _files(top: Path) -> dict[str, object]:
    """Files by name, with a value that changes when the file does."""
    found: dict[str, object] = {}
    for folder, _, names in os.walk(top):
        for name in names:
            path = Path(folder, name)
            about = path.lstat()
            found[path.relative_to(top).as_posix()] = (about.st_size, about.st_mtime_ns)
    return found


def _link_project(source: Path, target: Path, names: tuple[str, ...]) -> None:
    """Complete a folder with some project files by links to the others."""
    for name in names:
        if (target / name).is_dir():
            inside = tuple(path.name for path in (source / name).iterdir())
            _link_project(source / name, target / name, inside)
        elif not (target / name).exists():
            (target / name).symlink_to(source / name)


@contextlib.contextmanager
def limited_memory(most: int = MEMORY) -> Iterator[None]:
    """Let a call that requests so much more than is in use fail with a `MemoryError`."""
    used = int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[0])
    limits = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (used * resource.getpagesize() + most, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, limits)
