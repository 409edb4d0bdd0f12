"""LaTeX: text read back by a LaTeX parser, numbers and tables by hand."""

from __future__ import annotations

import math
import unicodedata
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pylatexenc.latex2text import LatexNodes2Text

from reobserve.core.errors import InputError
from reobserve_papers.cli.stages import latex as stage
from reobserve_papers.plotting.latex_text import booktabs, latex, latex_number

WRITTEN = {
    "K₁ = Γτ/2": r"K\textsubscript{1} = \ensuremath{\Gamma}\ensuremath{\tau}/2",
    "x̂₁₂ − x": r"\ensuremath{\hat{x}}\textsubscript{12} \ensuremath{-} x",
    "10⁻¹²": r"10\textsuperscript{-12}",
    "50 % & a_b #1 {x}": r"50 \% \& a\_b \#1 \{x\}",
    "~ ^ \\ $": r"{\textasciitilde} {\textasciicircum} {\textbackslash} \$",
    "a|b [1] <2>": r"a\textbar{}b {[}1{]} \ensuremath{<}2\ensuremath{>}",
    "--flag": "-{}-flag",
    "⅓ ◂ é": r"\ensuremath{\frac{1}{3}} \ensuremath{\triangleleft} \'e",
    "two\n lines": "two lines",
}


@pytest.mark.parametrize("text", WRITTEN)
def test_text_uses_only_standard_latex_commands(text: str) -> None:
    assert latex(text) == WRITTEN[text]


ASCII = st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=40)


@settings(max_examples=100)
@given(ASCII)
def test_latex_text_round_trips(text: str) -> None:
    known = latex(text).replace(r"\textbar{}", "|")  # a command that the parser does not know
    found = LatexNodes2Text(strict_latex_spaces=True).latex_to_text(known)
    alike = str.maketrans({"ˆ": "^", "˜": "~", "”": '"', "’": "'", "‘": "`"})
    reported = unicodedata.normalize("NFKC", found.translate(alike)).replace('"', "''")
    wanted = " ".join(text.split()).replace('"', "''")
    assert reported.replace(" ", "") == wanted.replace(" ", "")


NUMBERS = [
    (0.0, "0"), (5248.0, "5248"), (0.0123456, "0.0123"), (0.1, "0.100"), (99.96, "100"),
    (12345.678, "12300"), (-5.0, r"\ensuremath{-5}"), (math.nan, "--"),
    (1.23456e-7, r"\ensuremath{1.23 \times 10^{-7}}"), (-math.inf, r"\ensuremath{-\infty}"),
    (-2.5e9, r"\ensuremath{-2.50 \times 10^{9}}"), (9.999e-5, r"\ensuremath{1.00 \times 10^{-4}}"),
]  # fmt: skip


@pytest.mark.parametrize(("value", "written"), NUMBERS)
def test_numbers_have_three_digits(value: float, written: str) -> None:
    assert latex_number(value, 3) == written


def test_table_uses_booktabs_rules() -> None:
    assert booktabs(["a", "b"], [["1", r"x\_y"]], "rl") == (
        "\\begin{tabular}{rl}\n\\toprule\na & b \\\\\n\\midrule\n1 & x\\_y \\\\\n\\bottomrule\n"
        "\\end{tabular}\n"
    )


def test_metrics_table_has_one_column_per_observer(tmp_path: Path) -> None:
    source, output = tmp_path / "fig1.metrics.csv", tmp_path / "fig1.metrics.tex"
    source.write_text(
        "observer,metric,value,unit\nsampled,rms_error,0.0123456,N m\n"
        "slow_one,rms_error,1.5,N m\nslow_one,settling_time,nan,s\n"
    )
    stage.run(source, output)
    assert output.read_text().splitlines()[2:7] == [
        r"metric & sampled & slow one & unit \\",
        r"\midrule",
        r"rms error & 0.0123 & 1.50 & N m \\",
        r"settling time &  & -- & s \\",
        r"\bottomrule",
    ]


def test_other_tables_are_unchanged_unless_digits_are_requested(tmp_path: Path) -> None:
    source, output = tmp_path / "table.csv", tmp_path / "table.tex"
    source.write_text("term,exact,decimal\nz1^2 z2,1/36,0.0277777778\n")
    stage.run(source, output)
    row = r"z1{\textasciicircum}2 z2 & 1/36 & 0.0277777778 \\"
    assert output.read_text().splitlines()[:5:4] == [r"\begin{tabular}{llr}", row]
    stage.run(source, output, digits=2)
    assert output.read_text().splitlines()[4].endswith(r"& 1/36 & 0.028 \\")


def test_other_tables_have_minus_signs_and_powers_of_ten(tmp_path: Path) -> None:
    source, output = tmp_path / "table.csv", tmp_path / "table.tex"
    source.write_text("a,b,c,d\n-0.584013,-1.20e-05,3e7,-inf\n0.5,2,,nan\n")
    stage.run(source, output)
    first = (
        r"\ensuremath{-0.584013} & \ensuremath{-1.20 \times 10^{-5}} & "
        r"\ensuremath{3 \times 10^{7}} & \ensuremath{-\infty} \\"
    )
    assert output.read_text().splitlines()[4:6] == [first, r"0.5 & 2 &  & -- \\"]


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.txt", "", "must be a .csv or a .rst file"),
        ("a.csv", "", "is empty, must be a table with a header"),
        ("a.csv", "x,y\n1\n", "line 2 has not 2 cells"),
    ],
)
def test_invalid_table_is_refused(tmp_path: Path, name: str, content: str, said: str) -> None:
    source = tmp_path / name
    source.write_text(content)
    with pytest.raises(InputError, match=f"{name}: {said}"):
        stage.run(source, tmp_path / "a.tex")
    assert not (tmp_path / "a.tex").exists()
