"""Interrupts of compiled loops: what the handler of a signal raises ends them, as it ends Python.

A loop asks every tenth of a second or so, by a call of Python, in which handlers of signals run:

    due = FIRST
    for row in range(rows):
        if row >= due:
            due = poll(row)
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numba
from numba import types
from numba.extending import intrinsic

FIRST = 128
"""The row before which a loop polls first: a row takes well below ten milliseconds."""

_PERIOD = 0.1  # s between two polls
_FACTOR = 16  # by which the rows between two polls grow or shrink at most


class _OfThread(threading.local):
    """The last poll of a loop of this thread, and what tells its loops to stop."""

    row = 0
    moment = 0.0
    stop: threading.Event | None = None


_OF_THREAD = _OfThread()


@contextmanager
def stopped_by(stop: threading.Event) -> Iterator[None]:
    """End the loops of this thread within the context when the event is set, by KeyboardInterrupt.

    Python runs handlers of signals in the main thread alone.
    """
    _OF_THREAD.stop = stop
    try:
        yield
    finally:
        _OF_THREAD.stop = None


def next_poll(row: int) -> int:
    """The row before which a loop has to poll next. Called by loops, where a handler may raise."""
    it, now = _OF_THREAD, time.monotonic()
    if it.stop is not None and it.stop.is_set():
        raise KeyboardInterrupt
    rows, taken = row - it.row, now - it.moment
    if row < 2 * FIRST or rows <= 0:  # what was seen last was another loop
        rows = FIRST
    else:
        rows = int(min(max(rows * _PERIOD / max(taken, 1e-9), rows / _FACTOR), rows * _FACTOR)) + 1
    it.row, it.moment = row, now
    return row + rows


def _compile_poll(_: Any, row: Any) -> Any:
    """Compile ``poll(row)`` by numba: `next_poll`, and an end with what that raises."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        python = context.get_python_api(builder)
        lock = python.gil_ensure()
        name = context.insert_const_string(builder.module, __name__)
        module = python.import_module(name)
        function = python.object_getattr_string(module, "next_poll")
        argument = python.long_from_longlong(args[0])
        result = python.call_function_objargs(function, (argument,))
        for reference in (module, function, argument):
            python.decref(reference)
        raised = builder.icmp_unsigned("==", result, python.get_null_object())
        with builder.if_then(raised, likely=False):
            python.gil_release(lock)
            context.call_conv.return_exc(builder)
        due = python.long_as_longlong(result)
        python.decref(result)
        python.gil_release(lock)
        return due

    return types.int64(types.int64), generate


poll: Any = intrinsic(_compile_poll)

_settings: Any = numba.config
if _settings.DISABLE_JIT:  # to debug kernels as Python, which may be interrupted anywhere

    def poll(row: int) -> int:
        """The row before which a loop of Python has to poll next."""
        return row + FIRST
