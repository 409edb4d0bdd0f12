"""No command of the papers overwrites a file that it reads."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.reobserve.bad_input.test_overwriting import refused

from .outcome import main

LINES = {
    "a table": "latex table.csv --output table.csv",
    "a product of an archive": "stage archive table.csv r.csv --output r.csv",
    "a file of the configuration": "stage parameters ilo --output config/papers/ilo.yaml",
    "accepted figures": "figdiff --reference folder --output folder",
}


@pytest.fixture(autouse=True)
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    (tmp_path / "config/papers").mkdir(parents=True)
    for name in ("table.csv", "r.csv", "config/papers/ilo.yaml"):
        (tmp_path / name).write_bytes(b"mine")


@pytest.mark.parametrize("what", LINES)
def test_input_file_is_not_overwritten(what: str, capsys: pytest.CaptureFixture[str]) -> None:
    refused(LINES[what].split(), capsys, main)
