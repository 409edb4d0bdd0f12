"""Files written whole or not at all, and small tables."""

from __future__ import annotations

import csv
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.errors import InputError


def write_whole(path: str | Path, write: Callable[[Path], None]) -> None:
    """Let ``write`` fill a file beside ``path``, then put it in place in one move.

    A process killed half-way leaves no half-written ``path``. The file beside it has a fixed
    name, so that the next run replaces what a killed one left.

    Raises
    ------
    InputError
        If the folder cannot be written.
    """
    path = Path(path)
    partial = path.with_name(f".{path.name}.partial")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            partial.touch()  # so that the reason is the system's, whatever library writes
            write(partial)
            os.replace(partial, path)
        finally:
            partial.unlink(missing_ok=True)
    except OSError as error:
        raise InputError(str(path), f"cannot be written ({error.strerror or error})") from None


def write_text(path: str | Path, text: str) -> None:
    """Write UTF-8 text whole or not at all."""
    write_whole(path, lambda partial: _put(partial, text))


def _put(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")


def write_table(path: str | Path, rows: Iterable[Mapping[str, Any]], header: Sequence[str]) -> None:
    """Write rows to CSV, floats in the shortest form that reads back to the same number."""

    def write(partial: Path) -> None:
        with partial.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.DictWriter(stream, header, lineterminator="\n")
            writer.writeheader()
            for row in rows:
                writer.writerow({key: cell(value) for key, value in row.items()})

    write_whole(path, write)


def cell(value: Any) -> str:
    """A value as it stands in a table; nothing for None."""
    if value is None:
        return ""
    return repr(float(value)) if isinstance(value, float) else str(value)


def read_table(path: str | Path, header: Sequence[str]) -> list[dict[str, str]]:
    """Read a CSV with exactly these columns, all cells as text.

    Raises
    ------
    InputError
        If the file is missing or its columns are others.
    """
    try:
        with Path(path).open(newline="", encoding="utf-8") as stream:
            reader = csv.DictReader(stream, strict=True)
            rows = list(reader)
            found = list(reader.fieldnames or ())
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(str(path), f"cannot be read ({reason})") from None
    if found != list(header):
        raise InputError(str(path), f"has the columns {found}, must have {list(header)}")
    for number, row in enumerate(rows, start=2):
        if None in row or None in row.values():
            raise InputError(str(path), f"line {number} has not {len(header)} cells")
    return rows


def read_columns(path: str | Path) -> dict[str, NDArray[np.float64]]:
    """The numeric columns of a user's CSV (with a header) or Parquet file.

    Raises
    ------
    InputError
        If the file is missing, of another kind, damaged, or holds text in a column.
    """
    path = Path(path)
    if path.suffix not in (".csv", ".parquet"):
        raise InputError(str(path), "must be a .csv or a .parquet file")
    import pyarrow as pa

    try:
        if path.suffix == ".csv":
            import pyarrow.csv as reader

            table = reader.read_csv(path)
        else:
            import pyarrow.parquet as parquet

            table = parquet.read_table(path)
        return {
            name: table[name].cast(pa.float64()).to_numpy(zero_copy_only=False)
            for name in table.column_names
        }
    except (OSError, KeyError, pa.ArrowException) as error:  # KeyError: a column named twice
        reason = str(error).splitlines()[0]
        raise InputError(str(path), f"cannot be read ({reason})") from None
