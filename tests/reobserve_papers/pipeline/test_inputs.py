"""A job reads the files that its rule declares, and no other."""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path

import pytest

from reobserve_papers.parameters.step_kinds import KINDS

from .conftest import PAPERS, Project

SLOW = ("study", "search")  # these of a paper with a short one
QUICK = "lie"


def jobs(project: Project, paper: str) -> dict[str, tuple[list[str], list[str], str]]:
    """The inputs, outputs and command of the first job of each kind of a paper."""
    asked = ("--dry-run", "--forceall", "--printshellcmds", "--quiet", "host")
    said = project.snakemake(*asked, "--config", f"papers=[{paper}]", "bench=[]").stdout
    found = {}
    for text in re.split(r"^(?=Job \d+:|(?:local)?rule )", said, flags=re.MULTILINE):
        command = re.search(r"\(set -x; (reobserve-papers stage (\w+) .*?)\) ", text)
        files = {
            key: re.findall(r"[^\s,]+", listed[1])
            for key in ("input", "output")
            if (listed := re.search(rf"^ +{key}: (.*)$", text, re.MULTILINE))
        }
        if command and command[2] in KINDS and (paper == QUICK or command[2] not in SLOW):
            found.setdefault(
                command[2], (files.get("input", []), files["output"], command[1])
            )  # fmt: skip
    return found


@pytest.mark.nightly_after(1)
@pytest.mark.parametrize("paper", [QUICK, *(one for one in PAPERS if one != QUICK)])
def test_job_needs_the_inputs_of_its_rule_only(built: Project, paper: str, tmp_path: Path) -> None:
    found = jobs(built, paper)
    assert {"plant", "observe", "metrics", "plot"} <= {*found}
    for step, (read, written, command) in found.items():
        folder = Project(tmp_path / step)
        for name in (f"results/{paper}/parameters.json", *read):
            (folder.folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(built.folder / name, folder.folder / name)
        environment = built.environment | {"PYTHONPATH": str(built.folder / "src")}
        folder.run(*shlex.split(command), environment=environment)
        for name in written:
            assert (folder.folder / name).read_bytes() == (built.folder / name).read_bytes(), name
