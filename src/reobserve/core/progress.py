"""A line on standard error that shows how far a long computation is."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def progress(line: str) -> Iterator[Callable[..., None]]:
    """A line on standard error that is written again, if that is a terminal.

    ``line`` is a format of what it is then called with.
    """
    seen = sys.stderr is not None and sys.stderr.isatty()
    begun = False

    def tell(*values: float) -> None:
        nonlocal begun
        if seen:
            begun = True
            print(f"\r{line.format(*values)} ", end="", file=sys.stderr, flush=True)

    try:
        yield tell
    finally:
        if begun:
            print(file=sys.stderr)
