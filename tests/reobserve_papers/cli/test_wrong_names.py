"""Misspelt names on the command line: exit code 1, one sentence, with the near name."""

from __future__ import annotations

from pathlib import Path

import pytest

from reobserve_papers.cli.main import COMMANDS, main
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


def test_all_commands_are_tried() -> None:
    assert {line.split()[0] for line in WRONG} == set(COMMANDS.commands) - OTHER
