"""Metadata for installation, citation and archiving."""

from __future__ import annotations

import importlib
import inspect
import json
import re
import subprocess
import tomllib
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest
import yaml

import reobserve
from tests import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
CODEMETA = json.loads((ROOT / "codemeta.json").read_text(encoding="utf-8"))
CHANGELOG = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
RELEASES = re.findall(r"^## \[(\d.*?)\] - (\S+)$", CHANGELOG, re.MULTILINE)


def test_version_and_date_agree_everywhere() -> None:
    version, day = RELEASES[0]
    found = {PROJECT["version"], CITATION["version"], CODEMETA["version"]}
    assert found == {version, metadata.version("reobserve"), reobserve.__version__}
    assert {str(CITATION["date-released"]), CODEMETA["dateModified"]} == {day}


def test_newest_release_comes_first() -> None:
    versions = [tuple(map(int, version.split("."))) for version, _ in RELEASES]
    assert versions == sorted(versions, reverse=True)


def test_names_and_keywords_agree_everywhere() -> None:
    authors = [one["name"] for one in PROJECT["authors"]]
    assert [one["name"] for one in CITATION["authors"]] == authors
    assert [one["name"] for one in CODEMETA["author"]] == authors
    assert CITATION["license"] == PROJECT["license"]
    assert CODEMETA["license"] == f"https://spdx.org/licenses/{PROJECT['license']}"
    assert CITATION["keywords"] == CODEMETA["keywords"] == PROJECT["keywords"]
    for key in ("name", "description"):
        assert CODEMETA[key] == PROJECT[key]
    assert CODEMETA["softwareRequirements"] == PROJECT["dependencies"]
    assert CODEMETA["runtimePlatform"] == f"Python {PROJECT['requires-python']}"


def test_papers_agree_with_the_citation_file() -> None:
    def article(reference: dict[str, Any]) -> dict[str, str]:
        place = {"@id": f"https://doi.org/{reference['doi']}"} if "doi" in reference else {}
        return {"@type": "ScholarlyArticle", **place, "name": reference["title"]}

    assert CODEMETA["referencePublication"] == [*map(article, CITATION["references"])]


def public_names() -> set[str]:
    """The names that a user may import, and what the classes among them have."""
    found = set()
    for package in (reobserve, importlib.import_module("reobserve.detection")):
        for name in package.__all__:
            one = getattr(package, name)
            full = f"{package.__name__}.{name}"
            parts = {part for part in dir(one) if part[0] != "_"} if inspect.isclass(one) else ()
            found |= {full, *(f"{full}.{part}" for part in parts)}
    return found


def test_changelog_has_each_public_name_that_is_gone() -> None:
    """`public_names.txt` has those of the last release, and new ones as they come."""
    listed = {*(ROOT / "tests/package/public_names.txt").read_text("utf-8").split()}
    found = public_names()
    assert sorted(found - listed) == []  # to be listed
    text, _, _ = CHANGELOG.partition(f"## [{RELEASES[0][0]}]")
    said = " ".join(re.findall(r"`([^`]+)`", text))
    gone = {name for name in listed - found if name.rpartition(".")[0] not in listed - found}
    assert [name for name in sorted(gone) if name.rpartition(".")[2] not in said] == []


def test_a_tag_that_is_not_the_version_stops_a_release() -> None:
    def make(tag: str) -> subprocess.CompletedProcess[str]:
        command = ["make", "tag", f"TAG={tag}"]
        return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)

    assert make(f"v{PROJECT['version']}").returncode == 0
    wrong = make("v9.9.9")
    assert wrong.returncode == 2
    assert f"the tag v9.9.9 must be v{PROJECT['version']}" in wrong.stderr


WORKFLOWS = sorted((ROOT / ".github/workflows").glob("*.yml"))
ALL_WORKFLOWS = [*WORKFLOWS, *sorted(ROOT.glob("examples/*/.github/workflows/*.yml"))]


@pytest.mark.parametrize("workflow", ALL_WORKFLOWS, ids=lambda path: path.name)
def test_workflow_pins_its_actions_and_keeps_no_rights(workflow: Path) -> None:
    text = workflow.read_text(encoding="utf-8")
    for action in re.findall(r"uses: (.*)", text):
        assert re.fullmatch(r"[\w./-]+@[0-9a-f]{40} # v\d+\.\d+\.\d+", action), action
    stated = yaml.safe_load(text)
    assert stated["permissions"] == {"contents": "read"}
    for job in stated["jobs"].values():
        publishes = workflow.name == "release.yml"
        wanted = "write" if publishes else "read"
        assert job.get("permissions", {}).get("contents", "read") == wanted
        for step in job["steps"]:
            if step.get("uses", "").startswith("actions/checkout@"):
                assert step["with"]["persist-credentials"] is False


@pytest.mark.parametrize("workflow", WORKFLOWS, ids=lambda path: path.name)
def test_ci_workflow_runs_makefile_targets(workflow: Path) -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for target in re.findall(r"\bmake (\w+)", workflow.read_text(encoding="utf-8")):
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target
