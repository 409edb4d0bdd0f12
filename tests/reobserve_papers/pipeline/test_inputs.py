"""A job reads the files that its rule declares, and no other."""

from __future__ import annotations

import csv
import re
import shlex
import shutil
from collections.abc import Set as AbstractSet
from pathlib import Path

import pytest

from reobserve_papers.parameters.step_kinds import KINDS
from reobserve_papers.steps.chain import EVIDENCE

from .conftest import PAPERS, Project, copy_toy

QUICK = "lie"  # whose studies take seconds


def summary(project: Project) -> list[dict[str, str]]:
    """What Snakemake knows of each file of a build."""
    said = project.snakemake("--detailed-summary").stdout
    return list(csv.DictReader(said.splitlines(), delimiter="\t"))


@pytest.fixture(scope="module")
def rows(built: Project) -> list[dict[str, str]]:
    return summary(built)


def check_one_job_of_each(
    built: Project, rows: list[dict[str, str]], rules: AbstractSet[str], paper: str, folder: Path
) -> set[str]:
    """One job of each rule, in a folder with its inputs and parameters alone: the same bytes."""
    ran: set[str] = set()
    for row in rows:
        path, rule = row["output_file"], row["rule"]
        command = re.match(r"\(set -x; (reobserve-papers .*?)\) ", row["shellcmd"])
        if rule not in rules - ran or not re.match(rf"results/({paper}/|[a-z]+\.)", path):
            continue
        ran.add(rule)
        alone = Project(folder / rule)
        for name in (f"results/{paper}/parameters.json", *row["input-file(s)"].split(",")):
            (alone.folder / name).parent.mkdir(parents=True, exist_ok=True)
            if name:
                shutil.copy(built.folder / name, alone.folder / name)
        assert command
        alone.run(*shlex.split(command[1]), environment=built.environment)
        assert (alone.folder / path).read_bytes() == (built.folder / path).read_bytes(), path
    return ran


@pytest.mark.nightly_after(1)
@pytest.mark.parametrize("paper", [QUICK, *(one for one in PAPERS if one != QUICK)])
def test_step_needs_the_inputs_of_its_rule_only(
    built: Project, rows: list[dict[str, str]], paper: str, tmp_path: Path
) -> None:
    kinds = KINDS.keys() - ({"study"} if paper != QUICK else ())
    ran = check_one_job_of_each(built, rows, kinds, paper, tmp_path)
    assert {"plant", "observe", "metrics", "plot"} <= ran


@pytest.mark.nightly
def test_job_on_claims_needs_the_inputs_of_its_rule_only(tmp_path: Path) -> None:
    toy = copy_toy(tmp_path / "toy")
    toy.snakemake()
    ran = check_one_job_of_each(toy, summary(toy), {*EVIDENCE, "report"}, "toy", tmp_path / "alone")
    assert ran == {*EVIDENCE, "report"}
