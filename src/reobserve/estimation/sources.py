"""Records that are no files on a disk: data frames and open files, read as `File` reads those."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from reobserve.core.errors import InputError, shown
from reobserve.core.extras import package
from reobserve.estimation.dialect import Dialect
from reobserve.estimation.record_file import File, Tell
from reobserve.estimation.specification import Specification

if TYPE_CHECKING:
    import pandas as pd

_TEXT = "the open file"


@dataclass(frozen=True)
class Content(File):
    """The bytes of an open file, whose name says what they are."""

    content: bytes = b""

    def __post_init__(self) -> None:
        self.check_ending()

    def packed(self) -> Any:
        """The bytes."""
        import pyarrow as pa

        return pa.BufferReader(self.content)


@dataclass(frozen=True)
class Frame(File):
    """A data frame, of which columns are converted when they are read."""

    frame: Any = None

    def __post_init__(self) -> None:
        pass

    @property
    def columnar(self) -> bool:
        """True: it is no text."""
        return True

    def header(self) -> list[str]:
        """The names of the columns."""
        return [str(name) for name in self.frame.columns]

    def _batches(self, columns: list[str], tell: Tell | None) -> Iterator[Any]:
        import pyarrow as pa

        titles = self.header()
        cells = [self._cells(title, titles.index(title)) for title in columns]
        yield from pa.table(cells, columns).to_batches(max(1, self.block // (8 * len(columns))))

    def _cells(self, title: str, place: int) -> Any:
        """A column as pyarrow has it, if its cells are of one kind."""
        import pyarrow as pa

        column = self.frame.iloc[:, place]
        try:
            return pa.Array.from_pandas(column)
        except (pa.ArrowException, TypeError, ValueError, OverflowError):
            for row, cell in enumerate(column.tolist(), 1):
                if not isinstance(cell, int | float) or isinstance(cell, bool):
                    problem = f"row {row} of column {shown(title)} is {shown(cell)}"
                    raise InputError(str(self.path), f"{problem}, must be a number") from None
            raise


def source(data: Any, specification: Specification) -> File:
    """The record in ``data``: a path, an open file, or a frame, with an index of times as a column.

    Raises
    ------
    InputError
        If there is no such file, or the data is none of these.
    """
    pd = package("pandas", "estimate a data frame")
    dialect = Dialect.of(specification)
    if isinstance(data, str | Path):
        return File(Path(data), dialect)
    if isinstance(data, pd.DataFrame):
        return Frame(Path("the frame"), dialect, frame=_with_index(data, specification))
    content, name = None, getattr(data, "name", None)
    with suppress(OSError, ValueError, TypeError, AttributeError):  # of what is no open file
        content = data.read()
    if isinstance(content, str):
        dialect = replace(dialect, encoding="utf-8")
        content = content.encode(errors="surrogateescape")
    if not isinstance(content, bytes):
        problem = f"is {shown(data)}, must be a path, an open file or a DataFrame of pandas"
        raise InputError("data", problem)
    return Content(Path(name if isinstance(name, str) else _TEXT), dialect, content=content)


def _with_index(frame: pd.DataFrame, specification: Specification) -> pd.DataFrame:
    """A frame whose index is a column if it has a name or dates.

    Without a name it takes that of the column of timestamps.
    """
    pd = package("pandas", "estimate a data frame")
    index, stated = frame.index, specification.columns.time.columns
    named = [str(name) for name in index.names if name is not None]
    if not named and isinstance(index, pd.DatetimeIndex) and len(stated) == 1:
        named = [stated[0]]
        frame = frame.rename_axis(named[0])
    if not named or any(name in map(str, frame.columns) for name in named):
        return frame
    return frame.reset_index()
