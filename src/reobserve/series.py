"""Named time series with units and provenance, and their Parquet form."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from reobserve.errors import InputError
from reobserve.files import write_whole

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

Array = NDArray[np.float64]

_KEY = b"reobserve"


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
        Shape (n,), seconds, increasing.
    channels
        Signals by name, each with n rows.
    events
        Named times [s], such as fault onsets, that belong to the record.
    provenance
        What made the series: plain JSON values.

    Raises
    ------
    InputError
        If the time does not increase or a channel has another number of rows.
    """

    time: Array
    channels: Mapping[str, Channel]
    events: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.time.ndim != 1 or not np.all(np.diff(self.time) > 0):
            raise InputError("time", "must be one column of increasing numbers")
        for name, channel in self.channels.items():
            if channel.values.ndim not in (1, 2) or len(channel.values) != len(self.time):
                raise InputError(
                    name, f"has shape {channel.values.shape}, must have {len(self.time)} rows"
                )

    def __getitem__(self, name: str) -> Array:
        """The values of a channel; `InputError` lists the channels if there is no such one."""
        if name not in self.channels:
            raise InputError(name, f"no such channel; there are {', '.join(self.channels)}")
        return self.channels[name].values

    @property
    def step(self) -> float:
        """The sampling period [s] of an evenly sampled series.

        Raises
        ------
        InputError
            If the samples are not evenly spaced, or there is one only.
        """
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
        """A data frame indexed by time; units and provenance are in ``attrs``."""
        import pandas as pd

        frame = pd.DataFrame(self.flat(), index=pd.Index(self.time, name="time"))
        frame.attrs = {
            "units": {name: channel.unit for name, channel in self.channels.items()},
            "provenance": dict(self.provenance),
        }
        return frame

    def write(self, path: str | Path) -> None:
        """Write to Parquet, whole or not at all; the same series gives the same bytes.

        Raises
        ------
        InputError
            If the folder cannot be written.
        """
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
        table = table.replace_schema_metadata({_KEY: json.dumps(about).encode()})
        write_whole(path, lambda partial: parquet.write_table(table, partial, use_dictionary=False))

    @classmethod
    def read(cls, path: str | Path) -> Series:
        """Read what `write` wrote.

        Raises
        ------
        InputError
            If the file is missing, cut short or not one of ours.
        """
        import pyarrow as pa
        import pyarrow.parquet as parquet

        try:
            table = parquet.ParquetFile(path).read()
        except FileNotFoundError:
            raise InputError(str(path), "there is no such file") from None
        except (OSError, pa.ArrowException) as error:
            reason = str(error).splitlines()[0]
            raise InputError(str(path), f"is damaged or no Parquet file ({reason})") from None
        about = json.loads((table.schema.metadata or {}).get(_KEY, b"null"))
        if about is None:
            raise InputError(str(path), "has no reobserve metadata; it was written elsewhere")
        return cls(
            _values(table, "time"),
            {
                name: Channel(_gather(table, name, entry["components"]), entry["unit"])
                for name, entry in about["channels"].items()
            },
            {name: tuple(times) for name, times in about["events"].items()},
            about["provenance"],
        )


def _column(values: Array) -> pa.Array:
    """An Arrow column over the same memory; ``pa.array`` would import pandas to look at it."""
    import pyarrow as pa

    values = np.ascontiguousarray(values, dtype=np.float64)
    return pa.Array.from_buffers(pa.float64(), len(values), [None, pa.py_buffer(values)])


def _values(table: pa.Table, name: str) -> Array:
    """A column as numpy; ``to_numpy`` would import pandas to look at it."""
    column: Array = np.asarray(np.from_dlpack(table[name].combine_chunks()), dtype=np.float64)
    return column


def _gather(table: pa.Table, name: str, components: int | None) -> Array:
    if components is None:
        return _values(table, name)
    return np.column_stack([_values(table, f"{name}_{i + 1}") for i in range(components)])
