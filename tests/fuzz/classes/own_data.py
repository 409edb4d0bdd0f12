"""Records of one's own: specifications, files, streams and saved states with something odd."""

from __future__ import annotations

import io
import json
import sys
from collections.abc import Callable, Iterator
from functools import cache
from random import Random
from types import SimpleNamespace
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as parquet
import yaml

from reobserve.own_data.examples import simulated, specification_text
from reobserve.plain_data.documents import parse_yaml

from .. import mutations
from ..case import Case, command

# One of each family; those that need no minute of compiling or synthesis at each change.
_NAMES = ("kalman", "levant", "eso", "pi", "fixed-gain", "delay-least-squares", "svsf")
_ROWS = 60
_TOKENS = [
    *(b",", b",,", b"\n", b"\r", b"\r\n", b'"', b"nan", b"NA", b"inf", b"-inf", b"x"),
    *(b"", b"1e999"),
    *(b"\x00", b"\xff", b"\xc3\xa9", b"\xef\xbb\xbf", b"t", b"speed [rpm]", b" [", b";", b"-"),
    *(b"2020-01-01", b"true", b"0x1", b"1_000", b"9" * 400, b"-1", b"1e-400", b"1e308", b"0,0\n"),
]  # fmt: skip
_POLICIES = {
    "uneven": ("refuse", "linear", "previous", "pchip"),
    "missing": ("refuse", "interpolate", "skip"),
    "at_gap": ("refuse", "restart", "coast"),
    "gap": (0.0, 0.03, 1e9),
    "jitter": (0.0, 0.3),
}


def make(random: Random) -> Case:
    """A change to one of them."""
    name = random.choice(_NAMES)
    tree, content = parse_yaml(specification_text(name), name), _csv(name)
    act = random.randrange(6)
    if act == 0:
        tree, told = mutations.tree(random, tree)
        return _case(name, tree, {"r.csv": content}, told)
    if act == 1:
        branch = random.choice(["columns", "sampling", "alarms", "estimates"])
        part = tree.get(branch, {})
        tree[branch], told = mutations.tree(random, part) if part else (mutations.value(random), "")
        return _case(name, tree, {"r.csv": content}, f"{branch}: {told}")
    for key, choices in _POLICIES.items():
        if random.random() < 0.4:
            tree["sampling"][key] = random.choice(choices)
    if act == 2:
        table = parquet_of(name, random)
        return _case(name, tree, {"r.parquet": table[0]}, table[1], "r.parquet")
    if act == 3 and random.random() < 0.5:
        return _resumed(random, name, tree, content)
    content, told = mutations.damaged(random, content, _TOKENS)
    if act == 4:
        return _case(name, tree, {"r.csv": content}, told)
    return _stream(name, tree, content, told, {})


def examples() -> Iterator[Case]:
    """Each as it is, as a file and as a stream."""
    for name in _NAMES:
        tree, content = parse_yaml(specification_text(name), name), _csv(name)
        yield _case(name, tree, {"r.csv": content}, "as it is")
        yield _stream(name, tree, content, "as it is", {})


def parquet_of(name: str, random: Random) -> tuple[bytes, str]:
    """The record as Parquet, damaged or with a column of another kind."""
    columns: dict[str, Any] = dict(_columns(name))
    told = "as it is"
    if random.random() < 0.6:
        title = random.choice(list(columns))
        values = columns[title]
        kinds: dict[str, Any] = {
            "text": [str(value) for value in values], "truths": values > 0,
            "nulls": pa.nulls(_ROWS), "whole": (values * 10).astype(int), "lists": [[1.0]] * _ROWS,
            "times": pa.array(values.astype(int), pa.timestamp("ms")), "huge": values * 1e300,
            "short": values.astype(np.float32), "backwards": values[::-1],
        }  # fmt: skip
        told = random.choice(list(kinds))
        columns[title] = kinds[told]
        told = f"{title}: {told}"
    stream = io.BytesIO()
    parquet.write_table(pa.table(columns), stream)
    if random.random() < 0.4:
        return mutations.damaged(random, stream.getvalue())
    return stream.getvalue(), told


@cache
def _columns(name: str) -> dict[str, Any]:
    return {title: values[:_ROWS] for title, values in simulated(name).record().items()}


@cache
def _csv(name: str) -> bytes:
    columns = _columns(name)
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    lines = [",".join(columns), *(",".join(f"{value:.9g}" for value in row) for row in rows)]
    return ("\n".join(lines) + "\n").encode()


def _written(tree: Any) -> bytes:
    return yaml.safe_dump(tree, allow_unicode=True, sort_keys=False).encode(errors="replace")


def _case(name: str, tree: Any, files: dict[str, bytes], told: str, record: str = "r.csv") -> Case:
    run: Callable[[], object] = lambda: command(  # noqa: E731
        "estimate", "s.yaml", record, "--out", "e.csv", "--report", "e.json"
    )
    return Case(f"{name}, {record}: {told}", run, {"s.yaml": _written(tree), **files})


def _stream(name: str, tree: Any, content: bytes, told: str, files: dict[str, bytes]) -> Case:
    state = ("--state", "state.json") if files else ()

    def run() -> None:
        before = sys.stdin
        sys.stdin = SimpleNamespace(buffer=io.BytesIO(content))  # type: ignore[assignment]
        try:
            command("estimate", "s.yaml", "--stream", *state)
        finally:
            sys.stdin = before

    return Case(f"{name}, stream: {told}", run, {"s.yaml": _written(tree), **files})


def _resumed(random: Random, name: str, tree: Any, content: bytes) -> Case:
    """A state that was saved by hand, in which something is odd."""
    from reobserve.own_data import state_file

    text = _written(tree).decode()
    state = {
        "format": state_file.FORMAT, "schema": state_file.SCHEMA, "offset": None, "begun": [],
        "specification": state_file.digest_of(text), "observer": None, "alarms": [],
        "account": {"rows": 3}, "interpolation": {}, "gaps": {},
    }  # fmt: skip
    changed, told = mutations.tree(random, state)
    return _stream(name, tree, content, told, {"state.json": json.dumps(changed).encode()})
