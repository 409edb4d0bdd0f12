"""No command overwrites a file that it reads, under whatever name."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from reobserve.cli.main import main

from . import valid
from .odd import as_yaml

LINES = {
    "a model": "design kalman model.yaml --out model.yaml",
    "a model by another path": "design kalman model.yaml --out folder/../model.yaml",
    "a design": "export d.c --out .",
    "a specification": "estimate s.yaml r.csv --out e.csv --report s.yaml",
    "a record": "estimate s.yaml r.csv --out r.csv",
    "the state of a stream": "estimate s.yaml r.csv --follow --state r.csv",
}


@pytest.fixture(autouse=True)
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    for name in ("model.yaml", "r.csv"):
        (tmp_path / name).write_bytes(b"mine")
    (tmp_path / "s.yaml").write_bytes(as_yaml(valid.specification("kalman")))
    (tmp_path / "d.c").write_bytes(valid.saved_design("kalman"))


def refused(
    line: list[str],
    capsys: pytest.CaptureFixture[str],
    main: Callable[[list[str]], int] = main,
) -> None:
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
    os.link("model.yaml", "same.json")
    refused(["design", "kalman", "model.yaml", "--out", "same.json"], capsys)


def test_design_named_in_specification_is_not_overwritten(
    capsys: pytest.CaptureFixture[str],
) -> None:
    tree = valid.specification("kalman")
    tree["observer"] = {"kind": "design", "file": "d.c"}
    Path("s.yaml").write_bytes(as_yaml(tree))
    refused(["estimate", "s.yaml", "r.csv", "--out", "e.csv", "--report", "d.c"], capsys)
