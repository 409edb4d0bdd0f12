"""Lines as they come: from standard input, or from a file that grows."""

from __future__ import annotations

import codecs
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any, BinaryIO

from reobserve.core.errors import InputError
from reobserve.core.files import reason
from reobserve.estimation.dialect import Dialect

_POLL = 0.02  # [s] between looks at a file that has not grown
LONGEST = 2**20  # bytes of a line


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

    def line(self, stream: BinaryIO, most: int = LONGEST + 1) -> bytes:
        """The next line or what there is of it, or nothing if there is no more or to stop."""
        if self.asked:
            return b""
        try:
            self.waiting = True
            return stream.readline(most)
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
    dialect
        Of the text.
    """

    def __init__(
        self,
        stream: BinaryIO,
        stop: Stop,
        place: str,
        idle: float = 0.0,
        dialect: Dialect | None = None,
    ) -> None:
        self.stream, self.stop, self.place, self.idle = stream, stop, place, idle
        self.dialect = dialect or Dialect()
        self.decoder: codecs.IncrementalDecoder | None = None
        self.end = b"\n"
        self.offset = 0

    def pass_over(self, offset: int) -> int:
        """Go on at a byte of the stream, and return the number of lines before it."""
        lines = 0
        self.stream.seek(0)
        self._end(self.stream.read(2))
        self.stream.seek(0)
        while chunk := self.stream.read(min(LONGEST, offset - self.offset)):
            lines += self._text(chunk).count("\n")
        return lines

    def __iter__(self) -> Iterator[str]:
        begun, since = b"", time.monotonic()
        while True:
            try:
                read = self.stop.line(self.stream)
                begun += read
                if len(self._end(begun)) == 2 and len(begun) % 2:
                    begun += self.stop.line(self.stream, 1)
            except (OSError, ValueError) as error:
                raise InputError(self.place, f"cannot be read ({reason(error)})") from None
            if len(begun) > LONGEST and not begun.strip(b"\0"):  # of a file made too long
                self.offset += len(begun) - 2
                begun = b"\0\0"
            if len(begun) > LONGEST:
                raise InputError(self.place, f"has a line of more than {LONGEST} bytes")
            if begun.endswith(self.end):
                yield self._text(begun)
                begun, since = b"", time.monotonic()
            elif read.endswith(b"\n"):  # half of a character
                continue
            elif self.stop.asked or time.monotonic() - since >= self.idle:
                break
            else:
                self.stop.pause(_POLL)
        if begun and not self.idle and not self.stop.asked:
            yield self._text(begun)  # the last line of a pipe may lack its end

    def _end(self, begun: bytes) -> bytes:
        """A line feed, whose bytes depend on the beginning of the stream."""
        if self.offset == 0 and self.dialect.codec(begun)[0].startswith("utf-16"):
            self.end = b"\0\n" if begun.startswith(codecs.BOM_UTF16_BE) else b"\n\0"
        return self.end

    def _text(self, line: bytes) -> str:
        if self.decoder is None:
            codec, errors = self.dialect.codec(line)
            self.decoder = codecs.getincrementaldecoder(codec)(errors)
        self.offset += len(line)
        return self.decoder.decode(line)


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
