"""Named time series with units and provenance, and their Parquet form."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.arguments import as_kind
from reobserve.core.documents import parse_json
from reobserve.core.errors import InputError, located, shown
from reobserve.core.extras import package
from reobserve.core.files import read_bytes, write_whole
from reobserve.core.matrices import as_numbers
from reobserve.core.units import is_unit
from reobserve.core.validation import parse

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

Array = NDArray[np.float64]

_KEY = b"reobserve"
_DIGEST = b"reobserve.sha256"  # of what stands under the key, and of all values
_MOST_COMPONENTS = 1000


@dataclass(frozen=True)
class Channel:
    """One signal over time: ``values`` of shape (n,) or (n, components), and its unit."""

    values: Array
    unit: str


@dataclass(frozen=True)
class Series:
    """Signals over one time axis.

    Parameters
    ----------
    time
        Shape (n,), seconds, finite and increasing.
    channels
        Signals by name, each with n rows.
    events
        Named times [s], such as fault onsets, that belong to the record.
    provenance
        What made the series: plain JSON values.
    """

    time: Array
    channels: Mapping[str, Channel]
    events: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "time", as_numbers("time", self.time))
        increasing = self.time.ndim == 1 and np.all(np.diff(self.time) > 0)
        if not increasing or not np.all(np.isfinite(self.time)):
            raise InputError("time", "must be one column of increasing numbers")
        for part in ("channels", "events", "provenance"):
            as_kind(part, getattr(self, part), Mapping)  # type: ignore[type-abstract]
        for name, channel in self.channels.items():
            as_kind(str(name), as_kind(str(name), channel, Channel).values, np.ndarray)
            if channel.values.ndim not in (1, 2) or len(channel.values) != len(self.time):
                raise InputError(
                    name, f"has shape {channel.values.shape}, must have {len(self.time)} rows"
                )

    def __getitem__(self, name: str) -> Array:
        """The values of a channel, or `InputError` with all channels if there is no such one."""
        if name not in self.channels:
            raise InputError(name, f"no such channel; there are {', '.join(self.channels)}")
        return self.channels[name].values

    @property
    def step(self) -> float:
        """The sampling period [s] of an evenly sampled series."""
        if len(self.time) < 2:
            raise InputError("time", "must have two samples or more for a period")
        step = float(self.time[-1] - self.time[0]) / (len(self.time) - 1)
        if np.max(np.abs(np.diff(self.time) - step)) > 1e-6 * step:
            raise InputError("time", "must be evenly spaced")
        return step

    def flat(self) -> dict[str, Array]:
        """The channels as columns: component i of ``name`` becomes ``name_i``, from 1."""
        columns = {}
        for name, channel in self.channels.items():
            if channel.values.ndim == 1:
                columns[name] = channel.values
            else:
                for i in range(channel.values.shape[1]):
                    columns[f"{name}_{i + 1}"] = np.ascontiguousarray(channel.values[:, i])
        return columns

    def to_pandas(self) -> pd.DataFrame:
        """A data frame indexed by time, with units and provenance in ``attrs``."""
        package("pandas", "make a data frame")
        import pandas as pd

        frame = pd.DataFrame(self.flat(), index=pd.Index(self.time, name="time"))
        frame.attrs = {
            "units": {name: channel.unit for name, channel in self.channels.items()},
            "provenance": dict(self.provenance),
        }
        return frame

    def write(self, path: str | Path) -> None:
        """Write to Parquet, whole or not at all, the same bytes for the same series."""
        package("pyarrow", "write Parquet files")
        import pyarrow as pa
        import pyarrow.parquet as parquet

        about = {
            "channels": {
                name: {
                    "unit": channel.unit,
                    "components": channel.values.shape[1] if channel.values.ndim == 2 else None,
                }
                for name, channel in self.channels.items()
            },
            "events": {name: list(times) for name, times in self.events.items()},
            "provenance": self.provenance,
        }
        columns = {"time": self.time, **self.flat()}
        table = pa.table({name: _column(values) for name, values in columns.items()})
        metadata = json.dumps(about, allow_nan=False).encode()
        digest = _digest(metadata, columns).encode()
        table = table.replace_schema_metadata({_KEY: metadata, _DIGEST: digest})

        def write(partial: Path) -> None:
            with partial.open("wb") as stream:  # not every path can be spelled for Arrow
                parquet.write_table(table, stream, use_dictionary=False)

        write_whole(path, write)

    @classmethod
    def read(cls, path: str | Path) -> Series:
        """Read what `write` wrote, and nothing else: the file carries a digest of its content."""
        # Of any size: a record that one step could write, the next must be able to read.
        about, columns = _read(str(path), read_bytes(path, None))
        with located(str(path)):
            channels = {
                name: Channel(_gather(columns, name, one.components), one.unit)
                for name, one in about.channels.items()
            }
            return cls(columns["time"], channels, about.events, about.provenance)


@dataclass(frozen=True)
class _StoredChannel:
    unit: str
    components: int | None


@dataclass(frozen=True)
class _Stored:
    """Contents of the key of the metadata."""

    channels: dict[str, _StoredChannel]
    events: dict[str, tuple[float, ...]]
    provenance: dict[str, Any]

    def __post_init__(self) -> None:
        for name, channel in self.channels.items():
            if channel.components is not None and not 0 < channel.components <= _MOST_COMPONENTS:
                raise InputError(f"channels.{name}.components", "must be a number of columns")
            if not is_unit(channel.unit):
                raise InputError(f"channels.{name}.unit", f"{shown(channel.unit)} is no unit")

    def columns(self) -> list[str]:
        """The columns that the file must have, in order."""
        return ["time", *(one for name in self.channels for one in self.flat_names(name))]

    def flat_names(self, name: str) -> list[str]:
        """The columns of a channel."""
        components = self.channels[name].components
        return [name] if components is None else [f"{name}_{i + 1}" for i in range(components)]


def _read(place: str, content: bytes) -> tuple[_Stored, dict[str, Array]]:
    """The metadata, and the columns, as they were written."""
    package("pyarrow", "read Parquet files")
    import pyarrow as pa
    import pyarrow.parquet as parquet

    try:
        # In this thread alone: a pool that is still ending when a short job exits aborts it.
        table = parquet.ParquetFile(pa.BufferReader(content)).read(use_threads=False)
        metadata = (table.schema.metadata or {}).get(_KEY)
        digest = (table.schema.metadata or {}).get(_DIGEST, b"")
        names = table.column_names
    except (OSError, ValueError, LookupError, MemoryError, pa.ArrowException) as error:
        reason = next(iter(str(error).splitlines()), type(error).__name__)
        raise InputError(place, f"is damaged or no Parquet file ({reason})") from None
    if metadata is None:
        raise InputError(place, "has no reobserve metadata; it was written elsewhere")
    if not digest:
        raise InputError(place, "has no digest of its values; it was not written by this version")
    try:
        about = parse(_Stored, parse_json(metadata.decode("utf-8"), place), place)
    except UnicodeDecodeError:
        raise InputError(place, "has metadata that are not UTF-8") from None
    if names != about.columns():
        raise InputError(place, f"has the columns {shown(names)}, not those of its metadata")
    for name, column in zip(names, table.columns, strict=True):
        if column.type != pa.float64() or column.null_count:
            raise InputError(place, f"the column {shown(name)} must hold floats, and no gaps")
    columns = {name: _values(table, name) for name in names}
    if digest.decode("ascii", "replace") != _digest(metadata, columns):
        raise InputError(place, "is damaged: its values are not those that were written")
    return about, columns


def _digest(metadata: bytes, columns: Mapping[str, Array]) -> str:
    """A digest of the metadata and of the columns, name by name."""
    whole = hashlib.sha256(metadata)
    for name, values in columns.items():
        whole.update(f"\n{name} {len(values)}\n".encode())
        whole.update(np.ascontiguousarray(values, dtype="<f8").tobytes())
    return whole.hexdigest()


def _column(values: Array) -> pa.Array:
    """An Arrow column over the same memory, as ``pa.array`` would import pandas to look at it."""
    import pyarrow as pa

    values = np.ascontiguousarray(values, dtype=np.float64)
    return pa.Array.from_buffers(pa.float64(), len(values), [None, pa.py_buffer(values)])


def _values(table: pa.Table, name: str) -> Array:
    """A column as numpy, as ``to_numpy`` would import pandas to look at it."""
    column: Array = np.asarray(np.from_dlpack(table[name].combine_chunks()), dtype=np.float64)
    return column


def _gather(columns: Mapping[str, Array], name: str, components: int | None) -> Array:
    if components is None:
        return columns[name]
    return np.column_stack([columns[f"{name}_{i + 1}"] for i in range(components)])
