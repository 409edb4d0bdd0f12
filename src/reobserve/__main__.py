"""The command line as a shell calls it: ``reobserve``, or ``python -m reobserve``."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Callable
from typing import NoReturn

_MANY = 300_000  # objects, some tens of megabytes


def run() -> NoReturn:
    """Run one sub-command of `reobserve` and leave."""
    from reobserve.cli.main import main

    leave(main)


def leave(main: Callable[[], int]) -> NoReturn:
    """Run a command line and leave at once, with all files written.

    To take apart an interpreter that holds compiled loops takes longer than most jobs compute. So
    does the search for cycles among the objects that imports make, which live as long as the
    interpreter. It begins after as many objects as no short job makes; a long one is searched then,
    and its memory stays bounded.
    """
    gc.set_threshold(_MANY)
    code = main()
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            stream.flush()
    os._exit(code)


if __name__ == "__main__":
    run()
