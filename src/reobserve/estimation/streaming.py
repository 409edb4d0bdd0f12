"""Lines as they come: from standard input, or from a file that grows."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any, BinaryIO

from reobserve.core.errors import InputError, shown
from reobserve.core.files import reason

_POLL = 0.02  # [s] between looks at a file that has not grown
_LONGEST = 2**20  # bytes of a line


class _Stopped(BaseException):
    """A signal came while a line was waited for."""


class Stop:
    """Lets SIGINT and SIGTERM end a stream between two lines, and not within the work on one."""

    def __init__(self) -> None:
        self.asked = self.waiting = False

    @contextmanager
    def listening(self) -> Iterator[None]:
        """Take these signals, and give them back to whom they were."""
        before = {}
        for number in (signal.SIGINT, signal.SIGTERM):
            try:
                before[number] = signal.signal(number, self._take)
            except ValueError:  # not the main thread, which alone may ask for signals
                break
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    def _take(self, number: int, frame: FrameType | None) -> None:
        self.asked = True
        if self.waiting:
            raise _Stopped

    def line(self, stream: BinaryIO) -> bytes:
        """The next line or what there is of it, or nothing if there is no more or to stop."""
        if self.asked:
            return b""
        try:
            self.waiting = True
            return stream.readline(_LONGEST + 1)
        except _Stopped:
            return b""
        finally:
            self.waiting = False

    def pause(self, seconds: float) -> None:
        """Sleep, unless one is to stop."""
        try:
            self.waiting = True
            if not self.asked:
                time.sleep(seconds)
        except _Stopped:
            pass
        finally:
            self.waiting = False


class Lines:
    """Whole lines of a stream. ``offset`` counts the bytes of those that were given.

    Parameters
    ----------
    stream
        Of bytes.
    idle
        How long [s] to wait for more at its end; 0 for a pipe, whose end is its end.
    encoding
        Of the text.
    """

    def __init__(
        self, stream: BinaryIO, stop: Stop, place: str, idle: float = 0.0, encoding: str = "utf-8"
    ) -> None:
        self.stream, self.stop, self.place, self.idle = stream, stop, place, idle
        self.encoding = encoding
        self.offset = 0

    def __iter__(self) -> Iterator[str]:
        begun, since = b"", time.monotonic()
        while True:
            try:
                begun += self.stop.line(self.stream)
            except (OSError, ValueError) as error:
                raise InputError(self.place, f"cannot be read ({reason(error)})") from None
            if len(begun) > _LONGEST:
                raise InputError(self.place, f"has a line of more than {_LONGEST} bytes")
            if begun.endswith(b"\n"):
                yield self._text(begun)
                begun, since = b"", time.monotonic()
            elif self.stop.asked or time.monotonic() - since >= self.idle:
                break
            else:
                self.stop.pause(_POLL)
        if begun and not self.idle and not self.stop.asked:
            yield self._text(begun)  # the last line of a pipe may lack its end

    def _text(self, line: bytes) -> str:
        self.offset += len(line)
        try:
            begins = self.offset == len(line) and self.encoding == "utf-8"
            return line.decode("utf-8-sig" if begins else self.encoding)
        except UnicodeDecodeError:
            problem = f"{shown(line)} is not {self.encoding.upper()}, see columns.encoding"
            raise InputError(self.place, problem) from None


def open_file(path: Path, offset: int) -> Any:
    """A file to follow, from a byte on.

    Raises
    ------
    InputError
        If it cannot be read, or is shorter than it was.
    """
    try:
        stream = path.open("rb")
        size = path.stat().st_size
    except OSError as error:
        raise InputError(str(path), f"cannot be read ({reason(error)})") from None
    if size < offset:
        stream.close()
        raise InputError(str(path), f"has {size} bytes, of which {offset} were read before")
    stream.seek(offset)
    return stream
