"""Files written whole or not at all, and small tables."""

from __future__ import annotations

import contextlib
import csv
import errno
import io
import math
import os
import re
import stat
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from reobserve.core.errors import InputError, shown
from reobserve.core.seals import opened_rows, sealed_rows
from reobserve.core.units import is_unit

MOST_BYTES = 256 * 1024 * 1024  # of a file that is read whole

# Without waiting where a fifo would make one wait; on Windows bytes as they are, not as lines.
_AS_IT_IS = getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)


def read_bytes(path: str | Path, most: int | None = MOST_BYTES) -> bytes:
    """The bytes of a file, opened without waiting, as a fifo would make one wait."""
    _check_path(path)
    try:
        handle = os.open(path, os.O_RDONLY | _AS_IT_IS)
        with open(handle, "rb") as stream:
            about = os.fstat(handle)
            if not stat.S_ISREG(about.st_mode):
                raise InputError(str(path), f"is {_kind(about.st_mode)}, must be a regular file")
            content = stream.read() if most is None else stream.read(most + 1)
    except (OSError, ValueError) as error:  # ValueError: a path that the system cannot spell
        if isinstance(error, InputError):
            raise
        raise InputError(str(path), f"cannot be read ({reason(error)})") from None
    except MemoryError:
        raise InputError(str(path), "does not fit in memory") from None
    if most is not None and len(content) > most:
        raise InputError(str(path), f"has more than {most} bytes, which is too large to be read")
    return content


def _check_path(path: object) -> None:
    if not isinstance(path, str | Path):
        raise InputError("path", f"{shown(path)} must be the name of a file")


def read_text(path: str | Path, most: int = MOST_BYTES) -> str:
    """The UTF-8 text of a file, or `InputError` as `read_bytes` or if it is not UTF-8.

    A byte order mark, which no reader would see, is left out.
    """
    try:
        return read_bytes(path, most).decode("utf-8").removeprefix("\ufeff")
    except UnicodeDecodeError as error:
        raise InputError(
            str(path), f"cannot be read (byte {error.start + 1} is not UTF-8)"
        ) from None


def write_whole(path: str | Path, write: Callable[[Path], None]) -> None:
    """Let ``write`` fill a file beside ``path``, then put it in place in one move.

    A process killed half-way leaves no half-written ``path``. The file beside it has a fixed
    name, so that the next run replaces what a killed one left; those that run at once take turns.
    """
    _check_path(path)
    path = Path(path)
    try:
        check_replaceable(path)
        partial = _partial(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        with _alone_in(path.parent):
            try:
                partial.unlink(missing_ok=True)  # whatever it is, a link to elsewhere among them
                partial.touch(exist_ok=False)  # so that the reason is the system's, whatever writes
                write(partial)
                os.replace(partial, path)
            finally:
                if not partial.is_dir():
                    partial.unlink(missing_ok=True)
    except OSError as error:
        raise InputError(str(path), f"cannot be written ({reason(error)})") from None


@contextlib.contextmanager
def _alone_in(folder: Path) -> Iterator[None]:
    """Hold a folder against others that write in it, where the system knows how, until we end."""
    with contextlib.ExitStack() as held:
        with contextlib.suppress(ImportError, OSError):
            import fcntl

            handle = os.open(folder, os.O_RDONLY)
            held.callback(os.close, handle)
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield


def check_replaceable(path: Path) -> None:
    """Refuse to put a file where something else stands: a folder, a device, a link, a fifo."""
    if path.name:
        check_folder(path)
    try:
        mode = os.lstat(path).st_mode
    except FileNotFoundError:
        return
    except (OSError, ValueError) as error:
        raise InputError(str(path), f"cannot be written ({reason(error)})") from None
    if not stat.S_ISREG(mode):
        raise InputError(str(path), f"is {_kind(mode)}, only regular files are replaced")
    if not mode & 0o222 or not os.access(path, os.W_OK):
        raise InputError(str(path), "is read-only, and so it is not replaced")


def check_folder(path: Path) -> None:
    """Refuse what no file system would take, before work is done that would then be lost."""
    try:
        folder = next(one for one in path.absolute().parents if os.path.lexists(one))
        if not folder.is_dir() or not os.access(folder, os.W_OK | os.X_OK):
            code = errno.EACCES if folder.is_dir() else errno.ENOTDIR
            raise OSError(code, os.strerror(code))
        os.lstat(folder / _partial(path).name)
    except FileNotFoundError:
        return
    except (OSError, ValueError) as error:
        raise InputError(str(path), f"cannot be written ({reason(error)})") from None


def _partial(path: Path) -> Path:
    """The file in which `write_whole` writes before it moves it to its place."""
    return path.with_name(f".{path.name}.partial")


def check_not_read(written: Iterable[Path], read: Iterable[Path]) -> None:
    """Refuse to write a file that is read, by any of its names."""
    names = list(read)
    for path in written:
        if any(_same(path, name) for name in names):
            problem = "is read here, and would be overwritten; name another file"
            raise InputError(str(path), problem)


def _same(path: Path, name: Path) -> bool:
    try:
        return path.samefile(name)
    except (OSError, ValueError):  # one is missing, or no path at all
        return False


def _kind(mode: int) -> str:
    if stat.S_ISDIR(mode):
        return "a folder"
    return "a symbolic link" if stat.S_ISLNK(mode) else "a device, fifo or socket"


def reason(error: Exception) -> str:
    """The system's message of an error."""
    return getattr(error, "strerror", None) or str(error)


def write_text(path: str | Path, text: str) -> None:
    """Write UTF-8 text whole or not at all."""
    write_bytes(path, text.encode("utf-8"))


def write_bytes(path: str | Path, content: bytes) -> None:
    """Write bytes whole or not at all."""

    def write(partial: Path) -> None:
        partial.write_bytes(content)

    write_whole(path, write)


def write_table(
    path: str | Path,
    rows: Iterable[Mapping[str, Any]],
    header: Sequence[str],
    *,
    seal: bool = False,
) -> None:
    """Write rows to CSV, floats in the shortest form that reads back to the same number.

    With ``seal`` the file carries a digest, by which `read_rows` sees that it was changed.
    """

    def write(partial: Path) -> None:
        lines = [[cell(row.get(key)) for key in header] for row in rows]
        with partial.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream, lineterminator="\n")
            writer.writerows(sealed_rows(header, lines) if seal else [header, *lines])

    write_whole(path, write)


def cell(value: Any) -> str:
    """A value as it stands in a table, or nothing for None."""
    if value is None:
        return ""
    return repr(float(value)) if isinstance(value, float) else str(value)


def read_rows(path: str | Path) -> tuple[list[str], list[list[str]]]:
    """The header of a CSV and its rows, all cells as text."""
    text = read_text(path)
    try:
        header, *rows = list(csv.reader(io.StringIO(text, newline=""), strict=True)) or [[]]
    except csv.Error as error:
        raise InputError(str(path), f"cannot be read ({error})") from None
    for number, row in enumerate(rows, start=2):
        if len(row) != len(header):
            raise InputError(str(path), f"line {number} has not {len(header)} cells")
    return opened_rows(str(path), header, rows)


def read_table(
    path: str | Path,
    header: Sequence[str],
    kinds: Mapping[str, Kind] | None = None,
    key: Sequence[str] = (),
) -> list[dict[str, str]]:
    """Read a CSV with exactly these columns, all cells as text, checked whole.

    Parameters
    ----------
    path, header
        The file, and its columns in order.
    kinds
        What the cells of a column must be, where they are not any text.
    key
        Columns whose cells together name a row: no two rows have the same.
    """
    found, lines = read_rows(path)
    if found != list(header):
        raise InputError(str(path), f"has the columns {shown(found)}, must have {list(header)}")
    rows, seen = [], set()
    for number, line in enumerate(lines, start=2):
        row = dict(zip(header, line, strict=True))
        for column, kind in (kinds or {}).items():
            if not kind.allows(row[column]):
                raise InputError(
                    str(path),
                    f"line {number}, {column}: {shown(row[column])} must be {kind.text}",
                )
        name = tuple(row[column] for column in key)
        if key and name in seen:
            raise InputError(str(path), f"line {number} repeats {shown(', '.join(name))}")
        seen.add(name)
        rows.append(row)
    return rows


@dataclass(frozen=True)
class Kind:
    """The kind of cells that a column may have: a test, and its name in a sentence."""

    allows: Callable[[str], bool]
    text: str


def _number(cell: str) -> float:
    """The number that a cell spells as Python or C would, or nan for what is none."""
    return float(cell) if _NUMBER.fullmatch(cell) else math.nan


_NUMBER = re.compile(r"[+-]?(\d{1,40}\.?\d{0,40}|\.\d{1,40})([eE][+-]?\d{1,4})?", re.ASCII)

_NO_SCORE = ("nan", "inf", "-inf")  # of what does not exist, or diverged

NUMBER = Kind(lambda cell: math.isfinite(_number(cell)), "a finite number")
SCORE = Kind(lambda cell: cell in _NO_SCORE or NUMBER.allows(cell), "a number, nan or inf")
GAP = Kind(lambda cell: not cell or NUMBER.allows(cell), "a finite number or empty")
WHOLE = Kind(lambda cell: re.fullmatch(r"-?\d{1,15}", cell, re.ASCII) is not None, "a whole number")
COUNT = Kind(lambda cell: not cell or WHOLE.allows(cell), "a whole number or empty")
UNIT = Kind(is_unit, "a unit")
NAME = Kind(lambda cell: bool(cell.strip()) and cell.isprintable(), "a name")
YES_NO = Kind(lambda cell: cell in ("yes", "no"), "yes or no")
