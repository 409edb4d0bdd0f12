"""Parquet records: damaged bytes, other columns, odd values, metadata of another kind."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from functools import cache
from random import Random
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as parquet

from .. import material, mutations
from ..case import Case, command

_KEY = b"reobserve"


def make(random: Random) -> Case:
    """The record of a paper with a change, and the observer that reads it."""
    paper = random.choice(material.PAPERS)
    act = random.randrange(3)
    if random.random() < 0.1:
        kind, rows = random.choice(["none", "snappy", "gzip"]), random.choice([None, 100, 10_000])
        stream = io.BytesIO()
        parquet.write_table(_table(paper), stream, compression=kind, row_group_size=rows)
        return case(paper, stream.getvalue(), f"the same, packed by {kind} in groups of {rows}")
    if act == 0:
        content, told = mutations.damaged(random, _small(paper))
        return case(paper, content, told, cut=True)
    table = _table(paper)
    if act == 1:
        about = json.loads(table.schema.metadata[_KEY])
        changed, told = mutations.tree(random, about)
        table = table.replace_schema_metadata({_KEY: json.dumps(changed).encode()})
    else:
        table, told = _other_columns(random, table)
    return case(paper, _bytes(table), told)


def examples() -> Iterator[Case]:
    """The records as they are."""
    for paper in material.PAPERS:
        yield case(paper, material.record(paper).read_bytes(), "as it is")


def case(paper: str, content: bytes, told: str, *, cut: bool = False) -> Case:
    """Let an observer of the paper read it."""
    observer, design = material.OBSERVERS[paper][1:]
    chosen = [] if design is None else ["--design-file", material.design(paper, design)]
    ledger = material.ledger_file(paper)
    return Case(
        f"{paper}{' cut' if cut else ''}: {told}",
        lambda: command(
            "stage", "observe", ledger, "r.parquet", observer, *chosen, "--output", "e.parquet"
        ),
        {"r.parquet": content},
    )


@cache
def _table(paper: str) -> pa.Table:
    return parquet.ParquetFile(material.record(paper)).read()


@cache
def _small(paper: str) -> bytes:
    """So few rows that damage meets the structure of the file as often as the numbers."""
    return _bytes(_table(paper).slice(0, 41))


def _bytes(table: pa.Table) -> bytes:
    stream = io.BytesIO()
    parquet.write_table(table, stream, use_dictionary=False)
    return stream.getvalue()


def _other_columns(random: Random, table: pa.Table) -> tuple[pa.Table, str]:
    index = random.randrange(table.num_columns) if random.random() < 0.6 else 0
    name, rows = table.column_names[index], table.num_rows
    values = table[name].to_numpy(zero_copy_only=False).copy()
    acts: list[tuple[str, Any]] = [
        ("missing", None),
        ("text", pa.array(["x"] * rows)),
        ("numbers as text", pa.array([str(value) for value in values[:50]] + ["0"] * (rows - 50))),
        ("nulls", pa.array(values, mask=np.arange(rows) % 7 == 3)),
        ("all null", pa.nulls(rows, pa.float64())),
        ("of type null", pa.nulls(rows)),
        ("integers", pa.array(np.arange(rows))),
        ("short floats", pa.array(values.astype(np.float32))),
        ("truths", pa.array(values > 0)),
        ("lists", pa.array([[1.0, 2.0]] * rows)),
        ("times", pa.array(np.arange(rows), pa.timestamp("s"))),
        ("bytes", pa.array([b"\xff"] * rows)),
        ("words of a dictionary", pa.array(["a", "b"] * rows)[:rows].dictionary_encode()),
        ("nan", pa.array(_with(random, values, np.nan))),
        ("inf", pa.array(_with(random, values, np.inf))),
        ("inf at the end", pa.array(np.append(values[:-1], np.inf))),
        ("huge", pa.array(values * 1e300)),
        ("backwards", pa.array(values[::-1].copy())),
        ("doubled", pa.array(values * 2.0)),
        ("uneven", pa.array(values + 1e-3 * np.abs(np.sin(np.arange(rows))))),
        ("all the same", pa.array(np.zeros(rows))),
    ]
    if random.random() < 0.2:
        return _other_shape(random, table, name)
    told, column = random.choice(acts)
    if column is None:
        return table.drop_columns([name]), f"{name} missing"
    return table.set_column(index, name, column), f"{name}: {told}"


def _other_shape(random: Random, table: pa.Table, name: str) -> tuple[pa.Table, str]:
    act = random.randrange(6)
    if act == 0:
        return table.slice(0, random.choice([0, 1, 2, 3, 100])), "few rows"
    if act == 1:
        return table.append_column(name, table[name]), f"{name} twice"
    if act == 2:
        return table.append_column("other", table[name]), "a column more"
    if act == 3:
        names = [mutations.word(random) if n == name else n for n in table.column_names]
        names = [n.encode(errors="replace").decode() for n in names]
        return table.rename_columns(names), f"{name} renamed"
    if act == 4:
        return table.replace_schema_metadata(None), "no metadata"
    text = random.choice([b"", b"null", b"[]", b"{", b"\xff", b"1", b'{"channels": {}}', b"NaN"])
    return table.replace_schema_metadata({_KEY: text}), f"metadata {text!r}"


def _with(random: Random, values: Any, odd: float) -> Any:
    changed = values.astype(np.float64)
    changed[random.randrange(len(values))] = odd
    return changed
