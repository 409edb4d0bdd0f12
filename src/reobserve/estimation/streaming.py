"""Lines as they come: from standard input, or from a file that grows, by its name.

A file that is followed may be replaced: renamed, with a new one in its place, or truncated, as logs
are that are rotated. Its lines end then, and those of the new file are another `Lines`.
"""

from __future__ import annotations

import codecs
import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any, BinaryIO

from reobserve.core.errors import InputError
from reobserve.core.files import reason
from reobserve.estimation.dialect import Dialect

_POLL = 0.02  # [s] between looks at a file that has not grown
_LATE = 1.0  # [s] in which the last line of a file that was renamed may still get its end
LONGEST = 2**20  # bytes of a line
REPLACED, TRUNCATED = "replaced", "truncated"


class _Stopped(BaseException):
    """A signal came while a line was waited for."""


class Stop:
    """Lets SIGINT, SIGTERM and SIGHUP end a stream between two lines, not within work on one."""

    def __init__(self) -> None:
        self.asked = self.waiting = False

    @contextmanager
    def listening(self) -> Iterator[None]:
        """Take these signals, and give them back to whom they were."""
        before = {}
        hangup = getattr(signal, "SIGHUP", signal.SIGTERM)
        if signal.getsignal(hangup) is signal.SIG_IGN:  # as with nohup
            hangup = signal.SIGTERM
        for number in {signal.SIGINT, signal.SIGTERM, hangup}:
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

    def wait(self, act: Callable[[Any], Any], given: Any) -> Any:
        """The result of an act that may take long, or None if one is to stop."""
        try:
            self.waiting = True
            return None if self.asked else act(given)
        except _Stopped:
            return None
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
    path
        The file that is followed. ``replaced`` says whether, and how, another file came in its
        place; ``rest`` is what it then has of a line without an end. ``last`` is the last line.
    """

    def __init__(
        self,
        stream: BinaryIO,
        stop: Stop,
        place: str,
        idle: float = 0.0,
        dialect: Dialect | None = None,
        path: Path | None = None,
    ) -> None:
        self.stop, self.place, self.idle, self.path = stop, place, idle, path
        self.dialect = dialect or Dialect()
        self.begin(stream)

    def begin(self, stream: BinaryIO) -> None:
        """Read a file from its beginning."""
        self.stream, self.offset, self.end = stream, 0, b"\n"
        self.decoder: codecs.IncrementalDecoder | None = None
        self.replaced = self.rest = self.last = ""
        self._noticed = 0.0

    def close(self) -> None:
        """Close the file."""
        self.stream.close()

    def __iter__(self) -> Iterator[str]:
        begun, since = b"", time.monotonic()
        while True:
            try:
                read = self.stop.wait(self.stream.readline, LONGEST + 1) or b""
                begun += read
                if len(self._end(begun)) == 2 and len(begun) % 2:
                    begun += self.stop.wait(self.stream.readline, 1) or b""
            except (OSError, ValueError) as error:
                raise InputError(self.place, f"cannot be read ({reason(error)})") from None
            if len(begun) > LONGEST and not begun.strip(b"\0"):  # of a file made too long
                self.offset += len(begun) - 2
                begun = b"\0\0"
            if len(begun) > LONGEST:
                raise InputError(self.place, f"has a line of more than {LONGEST} bytes")
            if begun.endswith(self.end):
                self.last = self._text(begun)
                yield self.last
                begun, since = b"", time.monotonic()
            elif read.endswith(b"\n"):  # half of a character
                continue
            elif self.stop.asked or not self._waits(begun, since):
                break
        if self.replaced and not self.stop.asked:
            self.rest = self._text(begun)
            return
        self.replaced = ""
        if begun and not self.idle and not self.stop.asked:
            yield self._text(begun)  # the last line of a pipe may lack its end

    def _waits(self, begun: bytes, since: float) -> bool:
        """Wait for more of a line, or return False if there will be none."""
        now = time.monotonic()
        if not self.replaced and self._is_replaced():
            self._noticed = now  # what was written before is read next
            return True
        late = now - (self._noticed if self.replaced else since)
        if self.replaced == TRUNCATED or (self.replaced and not begun):
            return False
        if late >= (_LATE if self.replaced else self.idle):
            return False
        self.stop.wait(time.sleep, _POLL)
        return True

    def _is_replaced(self) -> bool:
        """True if the file's name is that of another file, or less is there than was read."""
        if self.path is None:
            return False
        try:
            there, own = self.path.stat(), os.fstat(self.stream.fileno())
        except OSError:  # there is no file of the name at the moment
            return False
        if not os.path.samestat(there, own):
            self.replaced = REPLACED
        elif own.st_size < self.stream.tell():
            self.replaced = TRUNCATED
        return bool(self.replaced)

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


def open_file(path: Path) -> Any:
    """A file to follow."""
    try:
        return path.open("rb")
    except OSError as error:
        raise InputError(str(path), f"cannot be read ({reason(error)})") from None
