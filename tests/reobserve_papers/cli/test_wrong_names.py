"""Misspelt names on the command line: exit code 1, one sentence, with the near name."""

from __future__ import annotations

from pathlib import Path

import pytest

from reobserve.core.files import write_text
from reobserve_papers.cli.bench import BENCH
from reobserve_papers.cli.main import COMMANDS, main
from reobserve_papers.cli.stage_commands import STAGES
from reobserve_papers.parameters.config import known_styles
from reobserve_papers.parameters.parameters import Parameters
from tests import ROOT

OUTPUT = "--output {here}/out"
TUNED = "--tuned config/bench/tuned/torque"
SCORE = "bench score config/bench/torque.yaml --outputs {here}/a.csv {here}/b.csv"
# By command line: the name that it should have.
WRONG = {
    "list iol": "ilo",
    "list ilo dealy": "delay",
    "list --project {here}/../cofnig": "reobserve-papers new NAME",
    "params iol": "ilo",
    "params ilo smapled": "sampled",
    "params ilo observers.smapled --why": "observers.sampled",
    "params lie horizn": "horizon",
    "check iol": "ilo",
    "check ilo dealy": "delay",
    'check ilo --overrides {{"dealy":{{}}}}': "delay",
    "metrics iol": "ilo",
    "samples iol": "ilo",
    "samples ilo --claim any_falt": "any_fault",
    "samples ilo --check --claim any_falt": "any_fault",
    "figdiff iol": "ilo",
    "figdiff ilo/fgi1": "fig1",
    "figdiff iol/fig1": "ilo",
    "report --papers ilo dealy " + OUTPUT: "delay",
    "report --bench torqe " + OUTPUT: "torque",
    "stage parameters iol " + OUTPUT: "ilo",
    "bench tune config/bench/torqe.yaml levant " + OUTPUT: "torque.yaml",
    "bench tune config/bench/torque.yaml levnat " + OUTPUT: "levant",
    f"{SCORE} --tuned config/bench/tuned/torqe": "torque",
    f"{SCORE.replace('torque', 'torqe')} {TUNED}": "torque.yaml",
    "bench moved config/bench/torqe.yaml --cached a --again b " + OUTPUT: "torque.yaml",
    "bench moved config/bench/torque.yaml --cached config/bench/tuned/torqe --again "
    "config/bench/tuned/torque " + OUTPUT: "torque",
    f"bench plot config/bench/torqe.yaml {TUNED} --table a --outputs b.svg": "torque.yaml",
    "bench table results/bench/torqe " + OUTPUT: "torque",
    "latex config/bench/torqe.yaml " + OUTPUT: "torque.yaml",
}
# The first words of commands that take no name, one of a list that their usage shows, or a build.
OTHER = {"new", "schema", "accept"}


@pytest.mark.parametrize("line", WRONG)
def test_misspelt_name_is_refused_with_the_near_one(
    line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(ROOT)
    assert main(line.format(here=tmp_path).split()) == 1
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("reobserve-papers: ")
    assert captured.err.count("\n") == 1
    near = WRONG[line]
    assert captured.err.rstrip().endswith(near if " " in near else f"did you mean {near!r}?")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("group", "commands"),
    [([], COMMANDS.commands), (["stage"], STAGES.commands), (["bench"], BENCH.commands)],
)
def test_misspelt_command_is_refused_with_the_near_one(
    group: list[str], commands: dict[str, object], capsys: pytest.CaptureFixture[str]
) -> None:
    """The second letter is another, of every command."""
    for name in commands:
        wrong = f"{name[0]}q{name[2:]}"
        with pytest.raises(SystemExit):
            main([*group, wrong])
        said = capsys.readouterr().err.splitlines()[-1]
        assert f"there is no {wrong!r}, only {', '.join(commands)}; did you mean {name!r}?" in said


@pytest.mark.parametrize("style", known_styles(ROOT))
def test_misspelt_style_is_refused_with_the_near_one(
    style: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stored = tmp_path / "results/ilo/parameters.json"
    write_text(stored, Parameters.load(ROOT, "ilo").text())
    line = ["stage", "plot", str(stored), "fig1", "--formats", "png", "--style"]
    assert main([*line, f"{style}s"]) == 1
    said = f"--style: there is no '{style}s'; did you mean {style!r}?\n"
    assert capsys.readouterr().err == f"reobserve-papers: {said}"


def test_all_commands_are_tried() -> None:
    assert {line.split()[0] for line in WRONG} == set(COMMANDS.commands) - OTHER
