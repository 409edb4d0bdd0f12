"""Errors that arise in the modules of a paper outside this package: where, in one sentence."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import reobserve
import reobserve_papers
from reobserve.core.errors import ReobserveError, one_line

_OURS = [Path(str(package.__file__)).parent for package in (reobserve, reobserve_papers)]


def explained(error: Exception) -> str | None:
    """The sentence on an error, with file and line if it arose in a module below ``src``.

    None for an error that is neither a user's nor of such a module.
    """
    place = _place(error)
    if isinstance(error, ReobserveError):
        return f"{error} ({place})" if place else str(error)
    if not place:
        return None
    said = error.msg if isinstance(error, SyntaxError) else str(error)
    return one_line(
        f"{place}: {type(error).__name__}: {said}; the command with --traceback shows all"
    )


@contextmanager
def refused_in_one_sentence() -> Iterator[None]:
    """End the process with that sentence, if there is one."""
    try:
        yield
    except Exception as error:
        said = explained(error)
        if said is None:
            raise
        sys.exit(f"reobserve-papers: {said}")


def _place(error: BaseException | None) -> str:
    """The innermost line of such a module, in the error or in what led to it."""
    place = ""
    while error is not None:
        lines = [(call.filename, call.lineno) for call in traceback.extract_tb(error.__traceback__)]
        if isinstance(error, SyntaxError):
            lines.append((error.filename or "", error.lineno))
        own = [f"{path}, line {line}" for file, line in lines if (path := _own(file))]
        place = own[-1] if own else place
        error = error.__context__
    return place


def _own(file: str) -> str:
    """The path below this folder of such a module, or nothing."""
    path, here = Path(file), Path.cwd()
    own = path.is_relative_to(here / "src") and not any(map(path.is_relative_to, _OURS))
    return str(path.relative_to(here)) if own else ""
