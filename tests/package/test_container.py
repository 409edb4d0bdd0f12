"""The container and the workflows, which are not run here: what they name is there."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from .environments import ROOT

# Lines that go on are one.
STEPS = [
    line.partition(" ")[::2]
    for line in re.sub(r"\\\n\s*", "", (ROOT / "Containerfile").read_text("utf-8")).splitlines()
    if line and not line.startswith("#")
]
WORKFLOWS = sorted((ROOT / ".github/workflows").glob("*.yml"))


def of(step: str) -> list[str]:
    return [rest for name, rest in STEPS if name == step]


def installed(script: str) -> set[str]:
    """The packages of Debian that a script installs."""
    found: set[str] = set()
    for words in re.findall(r"apt-get install ([^&;]*)", script):
        found |= {word for word in shlex.split(words) if not word.startswith("-")}
    return found


def test_the_container_has_what_the_gate_installs_and_runs_make() -> None:
    gate = (ROOT / ".ci/run").read_text(encoding="utf-8")
    wanted = re.findall(r"\|\| install (.*)", gate)
    assert len(wanted) == 2
    packages = installed("\n".join(of("RUN")))
    assert packages == {"git", "make", *" ".join(wanted).split()}
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    runs = re.findall(r"&& make (\w+)", " ".join(of("RUN")))
    assert runs == ["env"]
    assert re.search(r"^env:", makefile, re.MULTILINE)
    assert of("CMD") == ['["make"]']
    (image,) = of("FROM")
    assert re.match(r"python:3\.1[1-4]-slim", image)


def test_the_devcontainer_is_that_container() -> None:
    told = json.loads((ROOT / ".devcontainer/devcontainer.json").read_text(encoding="utf-8"))
    folder = ROOT / ".devcontainer"
    assert (folder / told["build"]["dockerfile"]).resolve() == ROOT / "Containerfile"
    assert (folder / told["build"]["context"]).resolve() == ROOT
    assert told["postCreateCommand"] == "make env"


def test_what_git_ignores_is_not_copied() -> None:
    ignored = (ROOT / ".gitignore").read_text(encoding="utf-8").split()
    left_out = (ROOT / ".dockerignore").read_text(encoding="utf-8").split()
    names = {line.removeprefix("**/").rstrip("/") for line in left_out}
    assert {line.rstrip("/") for line in ignored} - {"*.egg-info"} <= names


def test_workflows_are_of_their_schema_and_run_targets() -> None:
    words = [sys.executable, "-m", "check_jsonschema", "--builtin-schema"]
    words += ["vendor.github-workflows", *map(str, WORKFLOWS)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("workflow", WORKFLOWS, ids=lambda path: path.stem)
def test_a_workflow_runs_targets_that_there_are(workflow: Path) -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for target in re.findall(r"\bmake (\w+)", workflow.read_text(encoding="utf-8")):
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target
