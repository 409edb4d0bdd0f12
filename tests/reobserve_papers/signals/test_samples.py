"""Samples from files of a user's: what they must hold, and errors that name the cell."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as parquet
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from reobserve.core.errors import InputError
from reobserve_papers.signals.samples import read_samples

NUMBERS = st.floats(allow_nan=False, allow_infinity=False)

INVALID: list[tuple[bytes | str, str]] = [
    ("time,torque\nnan,1\n1,2\n", r"column 'time', row 1 is nan, must be a finite number$"),
    ("time,force\n0,1\n1,2\n", r"has no column 'torque', only time, force$"),
    ("clock,torque\n0,1\n1,2\n", r"has no column 'time', only clock, torque$"),
    ("time,torque\n0,1\n2,2\n2,3\n", r"times must increase, over two rows or more$"),
    ("time,torque\n1,1\n0,2\n", r"times must increase, over two rows or more$"),
    ("time,torque\n0,1\n", r"times must increase, over two rows or more$"),
    ("time,torque\n", r"times must increase, over two rows or more$"),
    ("time,torque\n0,true\n", r"column 'torque', row 1 is True, must be a finite number$"),
    ("time,torque\n0,2007-05-01\n", r"row 1 is an object of type date, must be a finite number$"),
    ("time,torque\n0,1\n1\n", r"cannot be read \(.*\)$"),
    ("time,torque,torque\n0,1,1\n1,2,2\n", r"has the column 'torque' twice$"),
    ("time,time,torque\n0,0,1\n1,1,2\n", r"has the column 'time' twice$"),
    ("", r"cannot be read \(.*\)$"),
    ("time,tørque\n0,1\n".encode("latin-1"), r"cannot be read \(.+\)$"),
    (b"\0\0\0", r"cannot be read \(.+\)$"),
]


@pytest.mark.parametrize(("content", "said"), INVALID)
def test_invalid_table_is_refused(tmp_path: Path, content: bytes | str, said: str) -> None:
    path = tmp_path / "torque.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InputError, match=said) as caught:
        read_samples(path, "torque")
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


@given(
    st.lists(NUMBERS, min_size=1, max_size=5),
    st.sampled_from(["", "nan", "inf", "NA", "high", "1+2j", "1_0", "0x1"]),
    st.data(),
)
def test_first_cell_that_is_no_number_is_named(
    tmp_path_factory: pytest.TempPathFactory, values: list[float], cell: str, data: st.DataObject
) -> None:
    row = data.draw(st.integers(0, len(values)))
    cells = [*map(repr, values[:row]), cell, *map(repr, values[row:])]
    path = tmp_path_factory.getbasetemp() / "torque.csv"
    lines = [f"{k},{one}\n" for k, one in enumerate(cells)]
    path.write_text("time,torque\n" + "".join(lines))
    found = "empty" if not cell else cell if cell in ("nan", "inf") else f"'{cell}'"
    with pytest.raises(InputError) as caught:
        read_samples(path, "torque")
    problem = f"column 'torque', row {row + 1} is {found}, must be a finite number"
    assert str(caught.value) == f"{path}: {problem}"


@given(st.lists(NUMBERS, min_size=2, max_size=5), st.sampled_from(["csv", "parquet"]))
@example([1.0, 2.0], "csv")
def test_other_columns_may_hold_anything(
    tmp_path_factory: pytest.TempPathFactory, values: list[float], kind: str
) -> None:
    path = tmp_path_factory.getbasetemp() / f"read.{kind}"
    if kind == "csv":
        lines = [f"{k},,{one!r}\n" for k, one in enumerate(values)]
        path.write_text("time,note,torque\n" + "".join(lines))
    else:
        whole, notes = pa.array(range(len(values)), pa.int8()), ["on"] * len(values)
        parquet.write_table(pa.table({"time": whole, "note": notes, "torque": values}), path)
    time, torque = read_samples(path, "torque")
    assert np.array_equal(time, np.arange(len(values)))
    assert torque.tolist() == values


def test_parquet_columns_must_be_numeric(tmp_path: Path) -> None:
    path = tmp_path / "torque.parquet"
    for column, said in (
        (pa.array([1.0, None]), "row 2 is empty"),
        (pa.array(["1", "x"]), "row 2 is 'x', must be a finite number"),
        (pa.array([[1.0], [2.0]]), r"row 1 is \[1.0\], must be a finite number"),
        (pa.array([2**60 + 1, 1]), "cannot be read"),
        (pa.array(["1", "2"]), "is of the type string, must be numbers"),
    ):
        parquet.write_table(pa.table({"time": [0, 1], "a": column}), path)
        with pytest.raises(InputError, match=f"column 'a',? ?{said}"):
            read_samples(path, "a")


def test_file_that_is_missing_or_of_another_format_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no.csv: cannot be read \(No such file or directory\)$"):
        read_samples(tmp_path / "no.csv", "torque")
    with pytest.raises(InputError, match=r"torque.txt: must be a .csv or a .parquet file$"):
        read_samples(tmp_path / "torque.txt", "torque")


def test_truncated_parquet_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "torque.parquet"
    parquet.write_table(pa.table({"time": [0.0, 1.0], "torque": [1.0, 3.0]}), path)
    whole = path.read_bytes()
    for length in (0, 3, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:length])
        with pytest.raises(InputError, match=r"torque.parquet: cannot be read \(.*\)$"):
            read_samples(path, "torque")
