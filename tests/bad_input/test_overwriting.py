"""No command overwrites a file that it reads, under whatever name."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from reobserve.cli.main import main

from . import valid
from .odd import as_yaml

PARTS = [
    "p.json", "fig1", "--plant-file", "r.parquet", "--estimate-files", "e.parquet", "f.parquet",
]  # fmt: skip
PLOT = ["stage", "plot", *PARTS, "--metrics-file", "m.csv", "--template", "t.rst"]
LINES = {
    "a model": "design kalman model.yaml --out model.yaml",
    "a model by another path": "design kalman model.yaml --out folder/../model.yaml",
    "a design": "export d.c --out .",
    "a specification": "estimate s.yaml r.csv --out e.csv --report s.yaml",
    "a record": "estimate s.yaml r.csv --out r.csv",
    "the state of a stream": "estimate s.yaml r.csv --follow --state r.csv",
    "a table": "latex table.csv --output table.csv",
    "parameters": "stage plant p.json fault --output p.json",
    "a plant": "stage observe p.json r.parquet sampled --output r.parquet",
    "the design of a paper": "stage observe p.json r.parquet sampled --design-file d --output d",
    "one of several estimates": " ".join(["stage metrics", *PARTS, "--output", "f.parquet"]),
    "metrics": " ".join([*PLOT, "--caption", "m.csv", "--outputs", "a.pdf"]),
    "a template": " ".join([*PLOT, "--caption", "c.rst", "--outputs", "a.pdf", "t.rst"]),
    "claims": "stage verdicts claims.csv --output claims.csv",
    "a product of an archive": "stage archive table.csv r.csv --output r.csv",
    "a file of the configuration": "stage parameters ilo --output config/papers/ilo.yaml",
    "accepted figures": "figdiff --reference folder --output folder",
}


@pytest.fixture(autouse=True)
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    (tmp_path / "config/papers").mkdir(parents=True)
    for name in ("model.yaml", "d", "p.json", "table.csv", "m.csv", "t.rst", "claims.csv", "r.csv",
                 "r.parquet", "e.parquet", "f.parquet", "config/papers/ilo.yaml"):  # fmt: skip
        (tmp_path / name).write_bytes(b"mine")
    (tmp_path / "s.yaml").write_bytes(as_yaml(valid.specification("kalman")))
    (tmp_path / "d.c").write_bytes(valid.saved_design("kalman"))


def refused(line: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    before = {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()}
    assert main(line) == 1
    reported = capsys.readouterr().err
    assert reported.endswith("is read here, and would be overwritten; name another file\n")
    assert reported.count("\n") == 1
    assert {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()} == before


@pytest.mark.parametrize("what", LINES)
def test_input_file_is_not_overwritten(what: str, capsys: pytest.CaptureFixture[str]) -> None:
    refused(LINES[what].split(), capsys)


def test_input_file_is_not_overwritten_under_another_name(
    capsys: pytest.CaptureFixture[str],
) -> None:
    os.link("table.csv", "same.tex")
    refused(["latex", "table.csv", "--output", "same.tex"], capsys)


def test_design_named_in_specification_is_not_overwritten(
    capsys: pytest.CaptureFixture[str],
) -> None:
    tree = valid.specification("kalman")
    tree["observer"] = {"kind": "design", "file": "d.c"}
    Path("s.yaml").write_bytes(as_yaml(tree))
    refused(["estimate", "s.yaml", "r.csv", "--out", "e.csv", "--report", "d.c"], capsys)
