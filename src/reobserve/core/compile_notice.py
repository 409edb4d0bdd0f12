"""A line on a terminal where compilation takes long, so that nobody takes it for a hang."""

from __future__ import annotations

import sys
import threading
from contextlib import suppress
from typing import Any

from numba.core import event

_LONG = 2.0  # s
_NOTICE = "compiling the loop of this observer for this size, once on this computer ..."


class _Notice(event.Listener):
    """Prints the line once where a kernel of ours takes longer than `_LONG` to compile."""

    def __init__(self) -> None:
        self._depth, self._timer = 0, threading.Timer(0.0, _say)

    def on_start(self, event: Any) -> None:
        """Wait, if it is not a part of something that is compiled already."""
        with suppress(Exception):  # numba may come to tell other things
            ours = "reobserve" in event.data["dispatcher"].py_func.__module__.split(".")
            if self._depth == 0 and ours and sys.stderr is not None and sys.stderr.isatty():
                self._timer = threading.Timer(_LONG, _say)
                self._timer.daemon = True
                self._timer.start()
        self._depth += 1

    def on_end(self, event: Any) -> None:
        """Wait no longer."""
        self._depth -= 1
        if self._depth == 0:
            self._timer.cancel()


def _say() -> None:
    print(_NOTICE, file=sys.stderr, flush=True)


def install() -> None:
    """Have numba tell of what it compiles, if it can."""
    with suppress(Exception):
        event.register("numba:compile", _Notice())  # type: ignore[no-untyped-call]
