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

    To take apart an interpreter that holds compiled loops takes longer than most jobs compute.
    Plots go to files, whatever a notebook has set for the windows of its own process. Plugins of
    pydantic, which it would look for among all packages, have no part in this.
    """
    collect_rarely()
    os.environ["MPLBACKEND"] = "agg"
    os.environ["PYDANTIC_DISABLE_PLUGINS"] = "__all__"
    code = main()
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            stream.flush()
    os._exit(code)


def collect_rarely() -> None:
    """Look for cycles only among more objects than a short process makes.

    Those that imports make live as long as the process; to search them again and again takes a
    fifth of a short job. A long one is searched, so that its memory stays bounded.
    """
    gc.set_threshold(_MANY)


if __name__ == "__main__":
    run()
