"""Files read by commands, with a few changes."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reobserve.core.documents import parse_yaml, read_yaml
from reobserve.estimation.families import FAMILIES, family
from reobserve.replication.prepare import load_parameters
from reobserve.signals.inputs import Signal

from . import valid
from .odd import as_json, as_yaml, changed, damaged
from .outcome import command, is_accepted


@dataclass(frozen=True)
class Reader:
    """A reader of a file: ``tree`` or ``content`` is valid, ``others`` are files next to it."""

    file: str
    call: Callable[[], object]
    tree: Any = None
    content: bytes = b""
    others: Mapping[str, bytes] = field(default_factory=dict)

    def accepts(self, content: bytes) -> bool:
        """Whether other content of the file is accepted."""
        return is_accepted(self.call, {**self.others, self.file: content})

    @cached_property
    def valid(self) -> bytes:
        """The valid file."""
        return self.content or self.dumped(self.tree)

    def dumped(self, tree: Any) -> bytes:
        """A tree in the format of the file."""
        return as_json(tree) if self.file.endswith(".json") else as_yaml(tree)


def words(*line: object) -> Callable[[], object]:
    return lambda: command(*line)


def parameter_file(paper: str) -> Reader:
    line = words("stage", "parameters", paper, "--project", ".", "--output", "out.json")
    return Reader(f"config/papers/{paper}.yaml", line, valid.paper(paper))


def checked_file(paper: str) -> Reader:
    line = words("check", paper, "--project", ".")
    return Reader(f"config/papers/{paper}.yaml", line, valid.paper(paper))


def settings() -> Reader:
    def load() -> None:
        load_parameters(Path(), read_yaml(Path("config/config.yaml")))

    return Reader("config/config.yaml", load, valid.tree("config/config.yaml"))


def claims() -> Reader:
    line = words("stage", "claims", "eso", "--project", ".", "--output", "claims.csv")
    path = "config/claims/eso.yaml"
    return Reader(path, line, valid.tree(path), others=valid.results())


def errata() -> Reader:
    line = words("report", "--papers", "lie", "--project", ".", "--output", "report.html")
    return Reader("config/errata/lie.yaml", line, valid.tree("config/errata/lie.yaml"))


def stored_parameters(paper: str) -> Reader:
    line = words("stage", "plant", "in.json", valid.OBSERVERS[paper][0], "--output", "out.parquet")
    return Reader("in.json", line, json.loads(valid.parameters(paper).read_bytes()))


def paper_design(paper: str) -> Reader:
    observer, design = valid.OBSERVERS[paper][1:]
    line = ["stage", "observe", valid.parameters(paper), valid.record(paper), observer]
    read = words(*line, "--design-file", "in.json", "--output", "out.parquet")
    return Reader("in.json", read, json.loads(valid.design(paper, design).read_bytes()))


def user_design(kind: str) -> Reader:
    line = words("export", "in.json", "--to", "c", "--out", "code")
    return Reader("in.json", line, json.loads(valid.saved_design(kind)))


def user_model(kind: str) -> Reader:
    line = words("design", kind, "in.yaml", "--out", "out.json")
    return Reader("in.yaml", line, parse_yaml(family(kind).example, "in.yaml"))


def specification(name: str) -> Reader:
    line = words("estimate", "in.yaml", "r.csv", "--out", "e.csv", "--report", "e.json")
    return Reader("in.yaml", line, valid.specification(name), others=record(name))


def estimated_record(name: str) -> Reader:
    line = words("estimate", "s.yaml", "in.csv", "--out", "e.csv", "--report", "e.json")
    others = {"s.yaml": as_yaml(valid.specification(name))}
    return Reader("in.csv", line, content=valid.csv_record(name), others=others)


def streamed_record(name: str) -> Reader:
    def read() -> None:
        command("estimate", "s.yaml", "--stream", stdin=Path("in.csv").read_bytes())

    others = {"s.yaml": as_yaml(valid.specification(name))}
    return Reader("in.csv", read, content=valid.csv_record(name), others=others)


def observed_record(paper: str) -> Reader:
    line = words(*valid.observing(paper))
    return Reader("in.parquet", line, content=valid.record(paper).read_bytes())


def samples() -> Reader:
    def read() -> None:
        term = {"kind": "samples", "axis": 1, "file": "in.csv", "column": "torque"}
        values = Signal.parse("fault", [term], 1)(np.linspace(0.0, 3.0, 50))
        assert np.isfinite(values).all()

    return Reader("in.csv", read, content=b"time,torque\n0,0\n0.5,0.1\n1.0,-0.2\n2.5,1e-3\n")


def metrics() -> Reader:
    line = words("stage", "claims", "eso", "--project", ".", "--output", "claims.csv")
    path = "results/eso/fig2.metrics.csv"
    return Reader(path, line, content=valid.results()[path], others=valid.results())


def robustness() -> Reader:
    line = words("stage", "claims", "eso", "--project", ".", "--output", "claims.csv")
    path = "results/eso/robustness.json"
    return Reader(path, line, json.loads(valid.results()[path]), others=valid.results())


def study_table() -> Reader:
    study, estimates = valid.study()
    line = ["stage", "metrics", valid.parameters("lie"), "fig1_orders"]
    line += ["--plant-file", valid.record("lie"), "--study-file", "in.csv"]
    read = words(*line, "--estimate-files", *estimates, "--output", "m.csv")
    return Reader("in.csv", read, content=study.read_bytes())


def claims_table() -> Reader:
    line = words("stage", "verdicts", "in.csv", "--output", "v.md")
    return Reader("in.csv", line, content=valid.claims_table())


def record(name: str) -> dict[str, bytes]:
    return {"r.csv": valid.csv_record(name)}


EXAMPLES = ("kalman", "levant", "eso", "adaptive-pi", "luenberger-gain", "svsf")
QUICK = [kind for kind in FAMILIES if kind != "eso"]  # other choices take a solver seconds
READERS: dict[Callable[..., Reader], list[Any]] = {
    parameter_file: [*valid.PAPERS],
    checked_file: ["eso"],
    settings: [],
    claims: [],
    errata: [],
    stored_parameters: [*valid.PAPERS],
    paper_design: ["lie", "eso"],
    user_design: QUICK,
    user_model: QUICK,
    specification: [*EXAMPLES],
    estimated_record: [*EXAMPLES],
    streamed_record: [*EXAMPLES],
    observed_record: [*valid.PAPERS],
    samples: [],
    metrics: [],
    robustness: [],
    study_table: [],
    claims_table: [],
}

YAML = [
    b"&a ", b"*a", b"&a [*a]", b"<<: *a", b"<<: {b: 1}", b"!!binary aGk=", b"!!set {a}", b"!x",
    b"!!python/object/apply:os.system [touch escaped]", b"!!python/name:os.system", b"!!",
    b"2020-01-01", b"2020-01-01T00:00:00Z", b"1" * 5000, b"1e999", b".nan", b"-.inf", b"0b12",
    b"12:30:45", b"? ", b"? [a]\n: 1\n", b": ", b"- ", b"\t", b"\r", b"\x00", b"\xff\xfe", b"%",
    b"\xef\xbb\xbf", b"\xc3\x28", b"\xe2\x80\xa8", b"[" * 2000, b"{a: " * 1000, b"---\n",
    b"...\n", b"|\n", b">-\n", b"'", b'"', b'"\\uD800"', b"#", b"@", b"`", b"a: 1\na: 2\n",
    b"1: 2\n", b"null", b"\xf0\x9f\x98\x80", b"yes", b"!!omap [a: 1]", b"!!int x",
    b"!!float []", b"!!timestamp x",
]  # fmt: skip
CSV = [
    b",", b",,", b"\n", b"\n\n", b"\r", b"\r\n", b'"', b'""', b'"a"', b"nan", b"NA", b"inf",
    b"-inf", b"1e999", b"x", b" ", b" [", b"\x00", b"\xff", b"\xc3\xa9", b"\xef\xbb\xbf",
    b"\xd9\xa3", b"time", b"t", b"time,time", b"speed [rpm]", b";", b"\t", b"2020-01-01", b"true",
    b"1,2,3", b"0,0\n", b"#", b"=1+1", b"0x1", b"1_000", b"9" * 400, b"-1", b"-", b"1e-400",
    b"1e308", b"$(touch escaped)", b"a" * 20_000, b"observer,metric,value,unit\n",
]  # fmt: skip
TOKENS = {"yaml": YAML, "json": YAML, "csv": CSV, "parquet": None}


def made(reader: Callable[..., Reader], arguments: Any) -> Reader:
    return reader(*(arguments if isinstance(arguments, tuple) else (arguments,)))


@pytest.mark.parametrize("reader", READERS)
def test_changed_files_are_accepted_or_refused(reader: Callable[..., Reader]) -> None:
    every = [made(reader, one) for one in READERS[reader] or [()]]
    for one in every:
        assert one.accepts(one.valid)

    @given(st.data())
    def try_one(data: st.DataObject) -> None:
        one = data.draw(st.sampled_from(every))
        contents = [damaged(one.valid, TOKENS[one.file.rpartition(".")[2]])]
        if one.tree is not None:
            contents += [changed(one.tree).map(one.dumped)] * 3
        one.accepts(data.draw(st.one_of(contents)))

    try_one()


def bomb(width: int, depth: int) -> bytes:
    """Each line refers to the previous one several times: short to write, endless to expand."""
    lines = [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * width)}]" for k in range(1, depth)]
    return "\n".join(["a0: &a0 [x]", *lines]).encode()


@pytest.mark.parametrize("token", [*YAML, *(bomb(*size) for size in ((2, 30), (9, 9), (9, 30)))])
def test_yaml_that_once_raised_other_errors_is_refused(token: bytes) -> None:
    for reader in (parameter_file("ilo"), specification("kalman"), user_model("kalman")):
        for content in (token, b"a: " + token, reader.valid + token, b"a: 1\nb: &b " + token):
            reader.accepts(content)
    whole = parameter_file("ilo")
    for encoding in ("utf-16", "utf-32"):
        assert not whole.accepts(whole.valid.decode().encode(encoding))
