"""The command line as a shell calls it: ``reobserve``, or ``python -m reobserve``."""

from __future__ import annotations

import os
import sys
from typing import NoReturn

from reobserve.forking.client import SOCKET, ask


def run() -> NoReturn:
    """Run one sub-command and leave at once, with all files written.

    To take apart an interpreter that holds compiled loops takes longer than most jobs compute, and
    so does its start: where a build has a process to fork jobs from, this one only waits.
    """
    code = _ask_server()
    if code is None:
        from reobserve.cli import main

        code = main()
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            stream.flush()
    os._exit(code)


def _ask_server() -> int | None:
    path = os.environ.get(SOCKET)
    if path is None:
        return None
    try:
        return ask(path)
    except KeyboardInterrupt:
        return 130


if __name__ == "__main__":
    run()
