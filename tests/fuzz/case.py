"""A case: what is handed in, and what takes it."""

from __future__ import annotations

import contextlib
import io
import reprlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import Any, Protocol

LONGEST = 1000  # characters of what a user is told


@dataclass(frozen=True)
class Case:
    """Run in a folder of its own: ``files`` are written there first, paths to them are relative.

    ``text`` is what a person needs to see. ``run`` returns if the input is accepted and raises if
    it is refused. ``never`` says why the input may not be accepted, if it may not.
    """

    text: str
    run: Callable[[], object]
    files: Mapping[str, bytes] = field(default_factory=dict)
    never: str = ""


class Maker(Protocol):
    """What a module of `classes` offers: the case that a stream of random numbers makes.

    The first call with ``None`` gives the example with no change, which must be accepted.
    """

    def __call__(self, random: Random | None) -> Case: ...


class Refused(Exception):  # noqa: N818  (no error: what should happen)
    """The command line refused, as it should: in one sentence, with an exit code."""


class ImproperError(Exception):
    """The command line refused in another way than it should."""


def command(*arguments: object, parse_only: bool = False) -> None:
    """Run ``reobserve`` in this process, or its parser alone.

    Raises
    ------
    Refused
        If it says in one bounded line why it does not do it.
    ImproperError
        If it fails in any other way.
    """
    from reobserve.cli import command_parser, main

    out, err = io.StringIO(), io.StringIO()
    code: object
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            line = [str(argument) for argument in arguments]
            code = main(line) if not parse_only else int(not command_parser().parse_args(line))
        except SystemExit as stop:
            code = stop.code
    if code == 0:
        return
    told = err.getvalue()
    usage, _, last = told.rstrip("\n").rpartition("\n")
    if not isinstance(code, int) or not last.startswith("reobserve") or ": " not in last:
        raise ImproperError(f"exit {code!r}: {shown(told)}")
    if "Traceback" in told or (usage and not usage.startswith("usage: ")):
        raise ImproperError(f"more than one line: {shown(told)}")
    if len(last) > LONGEST:
        raise ImproperError(f"a line of {len(last)} characters: {shown(last)}")
    raise Refused(last)


_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = 160


def shown(value: Any) -> str:
    """A short form of any value, for people."""
    try:
        return _SHORT.repr(value)
    except Exception as error:
        return f"<{type(value).__name__}, whose repr raises {type(error).__name__}>"


def inside(path: Path, folder: Path) -> bool:
    """Whether a path leads to something in a folder, or to the folder itself."""
    return path == folder or folder in path.parents
