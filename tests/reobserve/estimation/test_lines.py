"""Lines of a stream: complete ones, until it ends, falls silent for too long or a signal
arrives."""

from __future__ import annotations

import io
import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from reobserve.core.errors import InputError
from reobserve.estimation.streaming import Lines, Stop, open_file

LONGEST = 2**20  # bytes in a line


def reported(content: bytes) -> list[str]:
    return list(Lines(io.BytesIO(content), Stop(), "the pipe"))


@contextmanager
def soon(*acts: Any) -> Iterator[None]:
    """Make the first call after 0.1 s and the second, if any, 3 s later."""
    timers = [threading.Timer(0.1 + 3.0 * k, act) for k, act in enumerate(acts)]
    for timer in timers:
        timer.start()
    try:
        yield
    finally:
        for timer in timers:
            timer.cancel()
            timer.join()


def ask_to_stop() -> None:
    os.kill(os.getpid(), signal.SIGTERM)


def test_last_line_of_a_pipe_may_lack_a_newline() -> None:
    assert reported(b"a,b\n1,2\n3,4") == ["a,b\n", "1,2\n", "3,4"]
    assert reported(b"") == []


def test_utf8_byte_order_mark_is_skipped_only_at_the_start() -> None:
    mark = "\ufeff"
    assert reported(f"{mark}a\n{mark}b\n".encode()) == ["a\n", f"{mark}b\n"]
    assert reported(b"a\n\xe9\n") == ["a\n", "\udce9\n"]  # refused in cells that are read


def test_endless_line_is_refused() -> None:
    longest = b"1" * (LONGEST - 1) + b"\n"
    assert reported(2 * longest) == [longest.decode()] * 2
    with pytest.raises(InputError, match=f"^the pipe: has a line of more than {LONGEST} bytes$"):
        reported(b"a\n" + b"1" * (LONGEST + 1))


def test_unreadable_stream_is_named() -> None:
    stream = io.BytesIO(b"a\n")
    stream.close()
    with pytest.raises(InputError, match=r"^the pipe: cannot be read \(.*closed file.*\)$"):
        next(iter(Lines(stream, Stop(), "the pipe")))


def test_signal_ends_the_wait_for_a_line_and_handler_is_restored() -> None:
    reading, writing = os.pipe()
    before = signal.getsignal(signal.SIGTERM), signal.getsignal(signal.SIGINT)
    stop = Stop()
    with os.fdopen(reading, "rb") as stream, stop.listening():
        assert stop.asked is False
        with soon(ask_to_stop, lambda: os.write(writing, b"too late\n")):
            assert next(iter(Lines(stream, stop, "the pipe")), "") == ""
        os.close(writing)
    assert stop.asked is True
    assert (signal.getsignal(signal.SIGTERM), signal.getsignal(signal.SIGINT)) == before


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signal_during_processing_waits_for_the_end_of_the_line(number: signal.Signals) -> None:
    stop = Stop()
    lines = Lines(io.BytesIO(b"a\nb\nc\n"), stop, "the pipe")
    with stop.listening():
        found = []
        for line in lines:
            signal.raise_signal(number)
            found.append(line)
    assert (found, lines.offset) == (["a\n"], 2)


def followed(path: Path, idle: float, *acts: Any) -> tuple[list[str], int, float]:
    """The lines, their bytes, and the time [s] taken."""
    stop = Stop()
    with open_file(path) as stream, stop.listening(), soon(*acts):
        since = time.monotonic()
        lines = Lines(stream, stop, str(path), idle)
        found = list(lines)
        return found, lines.offset, time.monotonic() - since


def test_followed_file_ends_after_silence_and_keeps_the_incomplete_line(
    tmp_path: Path,
) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes(b"a\nb\nbeg")

    def grow() -> None:
        with path.open("ab") as stream:
            stream.write(b"un\nc\nunfin")

    found, offset, taken = followed(path, 1.0, grow)
    assert (found, offset) == (["a\n", "b\n", "begun\n", "c\n"], 12)
    assert taken >= 1.05  # the file grew in between, and silence counts from its last line


def test_signal_ends_the_wait_for_a_file_that_stops_growing(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes(b"a\nbegun")
    found, offset, taken = followed(path, 5.0, ask_to_stop)
    assert (found, offset) == (["a\n"], 2)
    assert taken < 4.0
