"""A user's own samples, CSV and Parquet, behind a signal of the ledger."""

from __future__ import annotations

import io
from collections.abc import Iterator
from random import Random
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as parquet

from reobserve.timeseries.signals import Signal

from .. import mutations
from ..case import Case

_CSV = b"time,torque\n0,0\n0.5,0.1\n1.0,-0.2\n2.5,1e-3\n"
_TOKENS = [
    *(b",", b",,", b"\n", b"\r", b"\r\n", b'"', b'"a"', b"nan", b"inf", b"-inf", b"1e999", b"x"),
    b" ",
    *(b"\x00", b"\xff", b"\xc3\xa9", b"\xef\xbb\xbf", b"time", b"torque", b"time,time", b";"),
    b"\t",
    *(b"2020-01-01", b"true", b"1,2,3", b"#", b"=1+1", b"0x1", b"1_000", b"9" * 400, b"-1"),
    b"1e-400",
]  # fmt: skip


def make(random: Random) -> Case:
    """A file with a few changes, read by a term of kind samples."""
    term: Any = {"kind": "samples", "axis": 1, "column": "torque"}
    if random.random() < 0.3:
        term["interpolation"] = random.choice(["linear", "hold", mutations.value(random)])
    if random.random() < 0.15:
        term, _ = mutations.tree(random, {**term, "file": "mine.csv"})
        return case("mine.csv", _CSV, term, f"the term {term!r:.200}")
    if random.random() < 0.5:
        content, told = mutations.damaged(random, _CSV, _TOKENS)
        return case("mine.csv", content, term, f"{told}: {content!r:.200}")
    if random.random() < 0.5:
        content, told = mutations.damaged(random, _parquet({}), None)
        return case("mine.parquet", content, term, told)
    name, column = random.choice(["time", "torque"]), _column(random)
    told = f"{name} is {column.type}: {column.to_pylist()}"
    return case("mine.parquet", _parquet({name: column}), term, told)


def examples() -> Iterator[Case]:
    """Both kinds as they should be."""
    term = {"kind": "samples", "axis": 1, "column": "torque"}
    yield case("mine.csv", _CSV, term, "as it is")
    yield case("mine.parquet", _parquet({}), term, "as it is")


def case(name: str, content: bytes, term: Any, told: str) -> Case:
    """Parse the signal and ask it for values, which must be numbers."""
    named = {"file": name, **term} if isinstance(term, dict) else term

    def run() -> None:
        signal = Signal.parse("fault", [named], 1)
        values = signal(np.linspace(0.0, 3.0, 50))
        assert np.isfinite(values).all(), "accepted, but its values are not finite"

    return Case(f"{name}: {told}", run, {name: content})


def _parquet(other: dict[str, Any]) -> bytes:
    time, torque = pa.array([0.0, 0.5, 1.0, 2.5]), pa.array([0.0, 0.1, -0.2, 1e-3])
    stream = io.BytesIO()
    parquet.write_table(pa.table({"time": time, "torque": torque, **other}), stream)
    return stream.getvalue()


def _column(random: Random) -> Any:
    return random.choice([
        pa.array(["a", "b", "c", "d"]), pa.array(["0", "1", "2", "3"]), pa.nulls(4),
        pa.array([0.0, None, 1.0, 2.0]), pa.array([0, 1, 2, 3]),
        pa.array([True, False, True, True]),
        pa.array([[0.0], [1.0], [2.0], [3.0]]), pa.array([b"a", b"b", b"c", b"d"]),
        pa.array([0.0, 1.0, 1.0, 2.0]), pa.array([3.0, 2.0, 1.0, 0.0]),
        pa.array([0.0, 1.0, float("nan"), 2.0]), pa.array([0.0, 1.0, 2.0, float("inf")]),
        pa.array([2**62, 2**62 + 1, 2**62 + 2, 2**63 - 1]), pa.array([0, 1, 2, 3],
        pa.timestamp("s")),
        pa.array([{"a": 1.0}] * 4), pa.array([-1.0, 0.0, 1.0, 2.0]), pa.array([1e308] * 4),
        pa.array([0, 1, 2, 3], pa.decimal128(38, 3)), pa.array([0, 1, 2, 3], pa.float16()),
    ])  # fmt: skip
