"""Equations as documents: nothing sticks out of a page, and where there is a LaTeX it compiles."""

from __future__ import annotations

import itertools
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from reobserve.cli.main import main
from reobserve.codegen.latex import _symbol
from reobserve.codegen.statements import Program


@pytest.mark.parametrize(
    ("kind", "tables"), [("eso", ["\\Phi", "\\Gamma_0", "\\Gamma_1", "\\Gamma_u"]), ("imm", [])]
)
def test_a_document_stays_on_its_pages(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str, tables: list[str]
) -> None:
    """The transition of the first has eight columns, the names of the second's estimates are long.

    A matrix of amsmath takes ten columns at most, and more than six are wider than a page.
    """
    monkeypatch.chdir(tmp_path)
    for words in (["--example", "m.yaml"], ["m.yaml", "--out", "m.json"]):
        assert main(["design", kind, *words]) == 0
    assert main(["export", "m.json", "--to", "latex", "--out", "told"]) == 0
    (path,) = (tmp_path / "told").glob("*.tex")
    text = path.read_text()
    fitted = r"\\begin\{table\}\[ht\]\\centering\n\\caption\{\$(.*)\$\}\n\\resizebox\{.*%\n\\begin"
    found = re.findall(fitted, text)
    assert len(found) == text.count("\\begin{tabular}")
    assert set(tables) <= set(found)
    assert ("In $z$ stand the filter of the measurements," in text) == (kind == "eso")
    for matrix in re.findall(r"\\begin\{bmatrix\}(.*?)\\end", text):
        assert max(row.count("&") for row in matrix.split(r"\\")) < 6
    told = re.findall(r"^&.*$", text, flags=re.MULTILINE)
    for line, following in itertools.pairwise(told):  # what belongs to a line stands further in
        further = following.count(r"\quad") - line.count(r"\quad")
        assert further == 1 if r"\colon" in line[-10:] else further <= 0, (line, following)
    if compiler := shutil.which("pdflatex"):
        command = (compiler, "-interaction=nonstopmode", "-halt-on-error", path.name)
        said = subprocess.run(command, cwd=path.parent, capture_output=True, text=True, check=False)
        assert said.returncode == 0, said.stdout
        assert "Overfull" not in said.stdout


def test_a_name_of_a_program_is_a_symbol_with_an_index_or_a_word_in_one_piece() -> None:
    names = {"W_1": "W_{1}", "W_before": "W_{before}", "trial": r"\mathit{trial}", "x": "x"}
    assert {name: _symbol(Program("", 1, 1), name) for name in names} == names
    assert _symbol(Program("", 1, 1, symbols={"tau": r"\hat\tau"}), "tau") == r"\hat\tau"
