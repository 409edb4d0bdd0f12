"""The listing commands before any build, word by word, on the toy paper."""

from __future__ import annotations

import argparse
import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from reobserve_papers.cli.main import command_parser, main
from reobserve_papers.parameters.parameters import Parameters
from tests.reobserve_papers.report.project import make_project

Capture = pytest.CaptureFixture[str]


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The paper `toy` with nothing built; a terminal of 200 columns."""
    folder = make_project(tmp_path)
    shutil.rmtree(folder / "results")
    monkeypatch.chdir(folder)
    monkeypatch.setenv("COLUMNS", "200")
    return folder


def printed(capsys: Capture, *command: str) -> list[str]:
    """The printed lines of a command, with single spaces between words."""
    assert main(list(command)) == 0
    return [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()]


def test_parameters_are_listed_with_unit_source_and_range(project: Path, capsys: Capture) -> None:
    assert printed(capsys, "params", "toy", "observers.slow") == [
        "key value unit source range",
        " ".join("-" * width for width in (44, 26, 12, 40, 24)),
        "observers.slow.gains [1.0, 1.0] 1/s, 1/s^2 assumed *: 0.5 to 5",
        "",
        "1 entries, 1 of them assumed: the paper does not give them.",
        "--why shows the reason for each assumption.",
    ]
    reported = printed(capsys, "params", "toy", "observers.slow", "--why")
    assert reported[3:] == ["Not given.", "", reported[-1]]
    assert reported[-1].startswith("1 entries, 1 of them assumed")
    stated = printed(capsys, "params", "toy", "scenarios")
    assert stated[2:] == [
        "scenarios.push.disturbance 2 1/s Section 2",
        "",
        "1 entries, 0 of them assumed: the paper does not give them.",
    ]


def test_parameters_of_a_build_are_those_used(project: Path, capsys: Capture) -> None:
    parameters = Parameters.load(project, "toy", {"scenarios": {"push": {"disturbance": 3.0}}})
    path = project / "results/toy/parameters.json"
    path.parent.mkdir(parents=True)
    path.write_text(parameters.text())
    stated, built = (
        printed(capsys, "params", "toy", "scenarios", *option)[2] for option in ([], ["--built"])
    )
    assert stated == "scenarios.push.disturbance 2 1/s Section 2"
    assert built == "scenarios.push.disturbance 3 1/s user override"


def test_signals_choices_and_ranges_are_printed(
    project: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = project / "config/papers/toy.yaml"
    open_entries = """  waves:
    value: [{kind: sine, axis: 1, size: 2.0}, {kind: constant, size: 1}]
    unit: V
    source: (4)
  word: {value: a, unit: word, source: assumed, why: "So.", range: {choices: [a, b]}}
  span: {value: 0.25, unit: s, source: assumed, why: "So.", range: [0.125, 1.0e+3]}
"""
    text = path.read_text()
    path.write_text(text.replace("\ndesigns:\n", f"{open_entries}\ndesigns:\n", 1))
    rows = {line.split()[0]: line for line in printed(capsys, "params", "toy", "plant.") if line}
    assert rows["plant.waves"].startswith("plant.waves sine axis=1 size=2.0; V (4)")
    assert rows["plant.word"] == "plant.word a word assumed one of a, b"
    assert rows["plant.span"] == "plant.span 0.25 s assumed 0.125 to 1000"
    monkeypatch.setenv("COLUMNS", "80")
    narrow = printed(capsys, "params", "toy", "plant.span")
    assert narrow[1] == " ".join("-" * width for width in (36, 20, 9, 26, 18))


def test_paper_is_listed_with_its_build_state(project: Path, capsys: Capture) -> None:
    listed = printed(capsys, "list", "toy")
    assert listed[0].startswith("toy ")
    assert "fig1 A disturbance estimated not built" in listed
    assert "figures (make one: snakemake --cores 2 results/toy/FIGURE.pdf)" in listed
    assert "searches" not in listed
    for name in ("fig1.svg", "table1.csv", "gains.design.json", "push/slow.parquet"):
        file = project / "results/toy" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.touch()
    listed = printed(capsys, "list", "toy")
    for line in (
        "fig1 A disturbance estimated built: svg",
        "table1 Gains built",
        "gains gains that put both poles in one place built",
        "push a constant push not built",
        "slow slow run on: push",
        "placed poles placed",
        "faster all gains times a factor not built",
    ):
        assert line in listed


def test_searches_are_listed(capsys: Capture) -> None:
    listed = printed(capsys, "list", "imm")
    row = listed.index("searches")
    assert listed[row + 1].startswith("calibrated ")


def options(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """The options of a command and all its sub-commands."""
    for action in parser._actions:
        yield action
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from options(command)


def test_defaults_agree_with_the_help() -> None:
    """Words such as `all` or `this one` stand for a missing option."""
    said = {
        (action.dest, match[1], str(action.default))
        for action in options(command_parser())
        if (match := re.search(r"\(default: ([^)]*)\)", action.help or ""))
        and action.default not in (None, False, [], Path())
    }
    assert {("cores", "2", "2"), ("results", "results", "results")} <= said
    assert [each for each in said if each[1] != each[2]] == []
