"""Parquet records with columns of other types, odd values and other metadata."""

from __future__ import annotations

import io
import warnings
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as parquet
import pytest
from hypothesis import given
from hypothesis import strategies as st

from . import valid
from .odd import WORDS, as_yaml
from .outcome import command, is_accepted

KEY = b"reobserve"
ROWS = 41


def kinds(values: Any) -> dict[str, Any]:
    """Replacements of a column, by name."""
    rows = len(values)
    at = np.arange(rows)
    return {
        "text": pa.array(["x"] * rows),
        "numbers as text": pa.array([str(value) for value in values]),
        "nulls": pa.array(values, mask=at % 7 == 3),
        "all null": pa.nulls(rows, pa.float64()),
        "of type null": pa.nulls(rows),
        "integers": pa.array(at),
        "large integers": pa.array(at + 2**62),
        "short floats": pa.array(values.astype(np.float32)),
        "half floats": pa.array(values.astype(np.float16)),
        "decimals": pa.array(at.tolist(), pa.decimal128(38, 3)),
        "booleans": pa.array(values > 0),
        "lists": pa.array([[1.0, 2.0]] * rows),
        "structures": pa.array([{"a": 1.0}] * rows),
        "times": pa.array(at, pa.timestamp("s")),
        "bytes": pa.array([b"\xff"] * rows),
        "words of a dictionary": pa.array(["a", "b"] * rows)[:rows].dictionary_encode(),
        "not a number": pa.array(np.where(at == 5, np.nan, values)),
        "infinite": pa.array(np.where(at == 5, np.inf, values)),
        "infinite at the end": pa.array(np.append(values[:-1], np.inf)),
        "huge": pa.array(values * 1e300),
        "near the largest": pa.array(np.where(at == 5, 1e308, values)),
        "backwards": pa.array(values[::-1].copy()),
        "doubled": pa.array(values * 2.0),
        "uneven": pa.array(values + 1e-3 * np.abs(np.sin(at))),
        "all zero": pa.array(np.zeros(rows)),
    }


def shapes(table: pa.Table, name: str) -> dict[str, pa.Table]:
    """Replacements of a table, by name."""
    names = table.column_names
    texts = [b"", b"null", b"[]", b"{", b"\xff", b"1", b'{"channels": {}}', b"NaN"]
    renamed = [word.encode(errors="replace").decode() for word in WORDS]
    return {
        "no column": table.drop_columns([name]),
        "a column twice": table.append_column(name, table[name]),
        "a column more": table.append_column("other", table[name]),
        "no metadata": table.replace_schema_metadata(None),
        **{f"{rows} rows": table.slice(0, rows) for rows in (0, 1, 2, 3)},
        **{f"metadata {t!r}": table.replace_schema_metadata({KEY: t}) for t in texts},
        **{
            f"renamed {word!r:.40}": table.rename_columns(
                [word if one == name else one for one in names]
            )
            for word in renamed
        },
    }


def written(table: pa.Table, **options: Any) -> bytes:
    stream = io.BytesIO()
    parquet.write_table(table, stream, **options)
    return stream.getvalue()


@st.composite
def changed_table(draw: st.DrawFn, table: pa.Table) -> pa.Table:
    """A table with one column or something else replaced."""
    name = draw(st.sampled_from(table.column_names))
    columns = kinds(table[name].to_numpy(zero_copy_only=False))
    whole = shapes(table, name)
    kind = draw(st.sampled_from([*columns, *whole]))
    if kind in whole:
        return whole[kind]
    return table.set_column(table.column_names.index(name), name, columns[kind])


def estimated(name: str, content: bytes) -> bool:
    files = {"s.yaml": as_yaml(valid.specification(name)), "in.parquet": content}
    return is_accepted(lambda: command("estimate", "s.yaml", "in.parquet", "--out", "e.csv"), files)


@given(st.data())
def test_changed_columns_are_accepted_or_refused(data: st.DataObject) -> None:
    name = data.draw(st.sampled_from(["kalman", "levant"]))
    estimated(name, written(data.draw(changed_table(pa.table(valid.columns(name))))))


@pytest.mark.parametrize("name", ["levant", "eso", "extended-high-gain"])
def test_measurement_near_the_largest_float_gives_no_warning(name: str) -> None:
    rows = valid.csv_record(name).decode().splitlines()
    time, _, *others = rows[5].split(",")
    rows[5] = ",".join([time, "1e308", *others])
    files = {"s.yaml": as_yaml(valid.specification(name)), "r.csv": "\n".join(rows).encode()}

    def estimate() -> None:
        warnings.simplefilter("error", RuntimeWarning)
        command("estimate", "s.yaml", "r.csv", "--out", "e.csv")

    is_accepted(estimate, files)
