"""Command lines of the papers: unknown, missing and odd arguments, and odd overrides."""

from __future__ import annotations

import os
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from reobserve.core.errors import InputError
from reobserve_papers.parameters.parameters import Parameters
from tests.reobserve.bad_input.odd import as_yaml, changed, values, words
from tests.reobserve.bad_input.program import Program
from tests.reobserve.bad_input.test_command_line import (
    FILES,
    odd_line,
    places,
    test_closed_pipe_is_not_an_error,
    test_closed_standard_output_is_not_an_error,
    test_full_disk_is_reported_in_one_sentence,
    test_output_file_may_have_any_name,
    test_output_to_anything_but_a_regular_file_is_refused,
)

from . import valid
from .outcome import PACKAGE, ROOT, command, is_accepted, main

# Tests of any program, here of the one in the fixture `program`.
__all__ = [
    "places",
    "test_closed_pipe_is_not_an_error",
    "test_closed_standard_output_is_not_an_error",
    "test_full_disk_is_reported_in_one_sentence",
    "test_output_file_may_have_any_name",
    "test_output_to_anything_but_a_regular_file_is_refused",
]

Capture = pytest.CaptureFixture[str]

OPTIONS = [
    "--output", "--project", "--help", "--samples", "--seed", "--why",
    "--nope", "-x", "--", "--out",
    "--overrides", "--formats", "--papers", "--built", "--reason",
]  # fmt: skip
# Commands that build for minutes or change the project are only parsed.
SLOW = {
    "figdiff", "accept", "samples", "check", "metrics", "report", "robustness",
    "sensitivity", "sample", "search", "theory", "study", "archive", "tune", "score", "moved",
}  # fmt: skip


@pytest.fixture
def program() -> Program:
    root = ["--project", os.fspath(ROOT)]
    return Program(
        f"{PACKAGE}.cli.main", command, ["list", *root],
        lambda output: ["stage", "parameters", "ilo", *root, "--output", output],
    )  # fmt: skip


@cache
def lines() -> list[list[str]]:
    """Valid command lines."""
    out, root = ["--output", "out"], ["--project", os.fspath(ROOT)]
    imm, lie = (os.fspath(valid.parameters(paper)) for paper in ("imm", "lie"))
    valid.record("imm")
    valid.design("lie", "linear")
    inertia = '{"plant": {"inertia": 0.02}}'
    return [
        ["list", *root],
        ["list", "ilo", "eso", *root],
        ["params", "ilo", "sampled", "--why", *root],
        ["stage", "parameters", "imm", "--seed", "3", *out, *root],
        ["stage", "parameters", "eso", "--overrides", inertia, *out, *root],
        ["stage", "plant", imm, "plain"],
        ["stage", "observe", imm, "plain", "kalman"],
        ["stage", "design", lie, "linear"],
        ["stage", "table", lie, "table_coefficients"],
        ["stage", "plot", lie, "fig1", "--formats", "pdf", "png", "--no-notes"],
        ["stage", "claims", lie, imm],
        ["stage", "verdicts", lie],
        ["latex", "table.csv", "--digits", "3", *out],
        ["check", "eso", "--overrides", '{"eso": {"plant": {"inertia": 0.02}}}', *root],
        ["samples", "eso", "--max-samples", "20", "--check", *root],
        ["metrics", *root],
        ["report", "--papers", "eso", "--formats", "pdf", "png", *out, *root],
        ["figdiff", "--reference", "folder", "--results", "folder", *root],
        ["accept", "eso", "--reason", "a reason of four", "--cores", "2", *root],
        ["stage", "study", imm, "causes"],
        ["stage", "search", imm, "calibrated"],
        ["stage", "theory", lie],
        ["stage", "robustness", lie, "0-3", "4-7", "--samples", "8", "--no-cached"],
        ["stage", "sample", lie, "0-3"],
        ["stage", "alternatives", lie],
        ["stage", "sensitivity", lie, "--formats", "pdf", "png"],
        ["stage", "archive", "results/lie/fig1.pdf", *out, *root],
    ]


@given(st.data())
def test_odd_command_lines_are_accepted_or_refused(data: st.DataObject) -> None:
    line = odd_line(data, lines(), OPTIONS)
    is_accepted(lambda: command(*line, parse_only=not SLOW.isdisjoint(line)), FILES)


@given(st.sampled_from(valid.PAPERS), st.data())
def test_odd_overrides_are_accepted_or_refused(paper: str, data: st.DataObject) -> None:
    tree = valid.paper(paper)
    section = data.draw(st.sampled_from([key for key in tree if isinstance(tree[key], dict)]))
    name = data.draw(st.sampled_from(list(tree[section])))
    if data.draw(st.booleans()):
        over = {section: {name: data.draw(values | changed(tree[section][name]))}}
    else:  # a user-defined entry that starts from another
        added = {"like": name, **data.draw(st.dictionaries(words, values, max_size=1))}
        over = {section: {data.draw(st.just("mine") | words): added}}
    text = as_yaml(over).decode(errors="replace")
    line = ["stage", "parameters", paper, "--overrides", text]
    is_accepted(lambda: command(*line, "--project", ROOT, "--output", "out.json"))


def test_empty_override_is_refused() -> None:
    with pytest.raises(InputError, match=r"^eso\.plant\.inertia: \{\} must be a value"):
        Parameters.load(ROOT, "eso", {"plant": {"inertia": {}}})


@pytest.mark.parametrize(
    "line",
    [
        ["stage", "plant", "fifo", "plain"],
        ["stage", "plant", "/dev/zero", "plain"],
        ["list", "ilo", "--project", "fifo"],
        ["list", "ilo", "--project", "x" * 300],
    ],
)
def test_input_that_is_not_a_file_is_refused(places: Path, line: list[str]) -> None:
    assert not is_accepted(lambda: (os.chdir(places), command(*line)))
    assert not list(places.rglob("*.parquet"))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (
            ["stage", "parameters", "ilo", "--seed", "-5"],
            "--seed: '-5' must be a whole number from 0 to 9007199",
        ),
        (
            ["stage", "robustness", "l.json", "--samples", "0"],
            "--samples: '0' must be a whole number from 1 to",
        ),
        (["report", "--formats", "gif"], "argument --formats: invalid choice: 'gif'"),
        (
            ["stage", "parameters", "ilo", "--overrides", '{"a": 1, "a": 1}'],
            "has the key 'a' twice",
        ),
    ],
)
def test_invalid_command_line_arguments_are_refused_by_the_parser(
    arguments: list[str], said: str, tmp_path: Path, capsys: Capture
) -> None:
    with pytest.raises(SystemExit) as caught:
        main([*arguments, "--output", str(tmp_path / "out")])
    assert caught.value.code == 2
    last = capsys.readouterr().err.splitlines()[-1]
    assert said in last
    assert len(last) < 1000
    assert os.listdir(tmp_path) == []


def test_names_beyond_the_terminal_encoding_are_printed(tmp_path: Path) -> None:
    """The list has names with accents, and a path has characters that the locale cannot encode."""
    ascii_only = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONIOENCODING": "ascii"}
    reported = {**os.environ, **ascii_only, "PYTHONCOERCECLOCALE": "0"}
    folder = tmp_path / "née"
    for arguments, code in (
        (["list", "delay"], 0),
        (["stage", "parameters", "ilo", "--output", f"{folder}/parameters.json"], 0),
        (
            [
                "stage",
                "plant",
                f"{folder}/none.json",
                "constant",
            ],
            1,
        ),
    ):
        project = ["--project", str(ROOT)] if "plant" not in arguments else []
        command = [sys.executable, "-m", PACKAGE, *arguments, *project]
        done = subprocess.run(command, env=reported, capture_output=True, text=True, check=False)
        assert done.returncode == code, done.stderr
        assert "Traceback" not in done.stderr
    assert os.listdir(folder) == ["parameters.json"]
