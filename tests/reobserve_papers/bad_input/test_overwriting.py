"""No command of the papers overwrites a file that it reads."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.reobserve.bad_input.test_overwriting import refused

from .outcome import main

PARTS = [
    "p.json", "fig1", "--plant-file", "r.parquet", "--estimate-files", "e.parquet", "f.parquet",
]  # fmt: skip
PLOT = ["stage", "plot", *PARTS, "--metrics-file", "m.csv", "--template", "t.rst"]
LINES = {
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
    for name in ("d", "p.json", "table.csv", "m.csv", "t.rst", "claims.csv", "r.csv",
                 "r.parquet", "e.parquet", "f.parquet", "config/papers/ilo.yaml"):  # fmt: skip
        (tmp_path / name).write_bytes(b"mine")


@pytest.mark.parametrize("what", LINES)
def test_input_file_is_not_overwritten(what: str, capsys: pytest.CaptureFixture[str]) -> None:
    refused(LINES[what].split(), capsys, main)
