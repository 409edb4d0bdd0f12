"""No command of the papers overwrites a file that it reads."""

from __future__ import annotations

from pathlib import Path

import pytest

from reobserve_papers.cli.main import command_parser
from tests.reobserve.bad_input.test_overwriting import refused
from tests.reobserve.core.commands import commands

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


# By command: its arguments, and how files begin that it writes.
WRITTEN = {
    "stage parameters": ("ilo", ['{\n "paper": "ilo"']),
    "latex": ("folder", ["\\caption[A", "\\begin{tabular}{lr"]),
    "report": ("", ["<!doctype html>\n"]),
    "stage archive": ("nowhere.csv", ["PK"]),
    "bench moved": ("task.yaml --cached folder --again folder", ["method,condition,ratio,low"]),
    "bench table": ("folder", ["### A task"]),
}
KEPT = ["all:\n\ttouch all\n", "{}\n", *(text for _, own in WRITTEN.values() for text in own)]


def test_all_commands_with_an_output_are_tried() -> None:
    found = {one.prog for one in commands(command_parser()) if one.get_default("begins")}
    assert found == {f"reobserve-papers {words}" for words in WRITTEN}


@pytest.mark.parametrize("words", WRITTEN)
@pytest.mark.parametrize("kept", KEPT)
def test_file_of_another_kind_is_not_replaced(
    words: str, kept: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """All pairs of a command and a file. What would be replaced fails for want of valid input."""
    arguments, own = WRITTEN[words]
    Path("Makefile").write_text(kept, encoding="utf-8")
    assert main([*words.split(), *arguments.split(), "--output", "Makefile"]) == 1
    said = "Makefile: is no file that this command writes, and so it is not replaced\n"
    assert capsys.readouterr().err.endswith(said) == (kept not in own)
    assert Path("Makefile").read_text(encoding="utf-8") == kept
