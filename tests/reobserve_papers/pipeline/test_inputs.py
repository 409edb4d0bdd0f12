"""A job reads the files that its rule declares, and no other."""

from __future__ import annotations

import csv
import re
import shlex
import shutil
from pathlib import Path

import pytest

from reobserve_papers.parameters.step_kinds import KINDS

from .conftest import PAPERS, Project

QUICK = "lie"  # whose studies take seconds


@pytest.fixture(scope="module")
def rows(built: Project) -> list[dict[str, str]]:
    """What Snakemake knows of each file of a build."""
    said = built.snakemake("--detailed-summary").stdout
    return list(csv.DictReader(said.splitlines(), delimiter="\t"))


@pytest.mark.nightly_after(1)
@pytest.mark.parametrize("paper", [QUICK, *(one for one in PAPERS if one != QUICK)])
def test_job_needs_the_inputs_of_its_rule_only(
    built: Project, rows: list[dict[str, str]], paper: str, tmp_path: Path
) -> None:
    """One job of each kind, in a folder with these files alone, writes the same bytes."""
    ran: set[str] = set()
    for row in rows:
        path, step = row["output_file"], row["rule"]
        command = re.match(r"\(set -x; (reobserve-papers stage .*?)\) ", row["shellcmd"])
        slow = step == "study" and paper != QUICK
        if not path.startswith(f"results/{paper}/") or step not in KINDS.keys() - ran or slow:
            continue
        ran.add(step)
        alone = Project(tmp_path / step)
        for name in (f"results/{paper}/parameters.json", *row["input-file(s)"].split(",")):
            (alone.folder / name).parent.mkdir(parents=True, exist_ok=True)
            if name:
                shutil.copy(built.folder / name, alone.folder / name)
        assert command
        alone.run(*shlex.split(command[1]), environment=built.environment)
        assert (alone.folder / path).read_bytes() == (built.folder / path).read_bytes(), path
    assert {"plant", "observe", "metrics", "plot"} <= ran
