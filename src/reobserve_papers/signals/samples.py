"""Samples of a signal from a user's file, CSV (with a header) or Parquet, and between them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from reobserve.core.errors import InputError, shown
from reobserve.core.extras import package
from reobserve.core.files import NUMBER, read_bytes
from reobserve_papers.signals.signal_shapes import SAME_INSTANT, Array, Shape


@dataclass(frozen=True, eq=False)
class Held:
    """The last of ``values`` that was taken, each at its of ``instants`` [s]."""

    instants: Array
    values: Array

    def __call__(self, time: Array, before: bool) -> Array:
        """Values at increasing times [s], with ``before`` what was held until then."""
        edge = -SAME_INSTANT if before else SAME_INSTANT
        return self.values[np.searchsorted(self.instants, time + edge, side="right") - 1]

    def derivative(self) -> Shape | None:
        """None: samples do not say what is between them."""
        return None


@dataclass(frozen=True, eq=False)
class Linear:
    """Straight lines between ``values`` at ``instants`` [s], the last of which holds."""

    instants: Array
    values: Array

    def __call__(self, time: Array, before: bool) -> Array:
        """Values at increasing times [s]."""
        return np.interp(time, self.instants, self.values)

    def derivative(self) -> None:
        """None: samples do not say what is between them."""


def read_samples(path: Path, column: str) -> tuple[Array, Array]:
    """The times and the values of a column, both finite, the former increasing.

    Raises
    ------
    InputError
        If the file cannot be read, or one of the two columns is missing or not of such numbers.
    """
    names, columns = _table(path)
    for wanted in ("time", column):
        if wanted not in names:
            problem = f"has no column {shown(wanted)}, only {', '.join(names)}"
            raise InputError(str(path), problem)
        if names.count(wanted) > 1:
            raise InputError(str(path), f"has the column {shown(wanted)} twice")
    instants, values = (
        _floats(path, name, columns[names.index(name)]) for name in ("time", column)
    )
    if len(instants) < 2 or np.any(np.diff(instants) <= 0):
        raise InputError(str(path), "times must increase, over two rows or more")
    return instants, values


def _table(path: Path) -> tuple[list[str], Any]:
    """The names of a file's columns, and these."""
    package("pyarrow", "read samples")
    import pyarrow as pa
    import pyarrow.csv as csv_reader
    import pyarrow.parquet as parquet

    if path.suffix not in (".csv", ".parquet"):
        raise InputError(str(path), "must be a .csv or a .parquet file")
    stream = pa.BufferReader(read_bytes(path))
    try:
        if path.suffix == ".csv":
            # Only an empty cell is missing: nan is a number, although an invalid one, NA is text.
            empty = csv_reader.ConvertOptions(null_values=[""])
            alone = csv_reader.ReadOptions(use_threads=False)
            table = csv_reader.read_csv(stream, read_options=alone, convert_options=empty)
        else:
            checked = parquet.ParquetFile(stream, page_checksum_verification=True)
            table = checked.read(use_threads=False)
        return table.column_names, table.columns
    except (OSError, ValueError, KeyError, MemoryError, pa.ArrowException) as error:
        raise InputError(
            str(path), f"cannot be read ({str(error) or type(error).__name__})"
        ) from None


def _floats(path: Path, name: str, column: Any) -> Array:
    """A column as finite floats, or `InputError` with the first row that is none."""
    import pyarrow as pa

    place, kind = f"column {shown(name)}", column.type
    if pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind):
        try:
            values = column.cast(pa.float64()).to_numpy()  # of empty cells nan
        except (ValueError, MemoryError, pa.ArrowException) as error:
            problem = f"{place} cannot be read ({str(error) or 'it is too large'})"
            raise InputError(str(path), problem) from None
        bad = np.flatnonzero(~np.isfinite(values))
    else:
        values, cells = np.empty(0), column.to_pylist()
        spelled = [isinstance(cell, str) and NUMBER.allows(cell.strip()) for cell in cells]
        bad = np.flatnonzero(~np.array(spelled, dtype=bool))
    if bad.size:
        cell = column[int(bad[0])].as_py()
        found = "empty" if cell is None else shown(cell)
        problem = f"{place}, row {bad[0] + 1} is {found}, must be a finite number"
        raise InputError(str(path), problem)
    if len(values) < len(column):
        raise InputError(str(path), f"{place} is of the type {kind}, must be numbers")
    return np.asarray(values, dtype=np.float64)
