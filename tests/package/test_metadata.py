"""What the project says of itself to those who install, cite and archive it."""

from __future__ import annotations

import json
import re
import tomllib
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
CODEMETA = json.loads((ROOT / "codemeta.json").read_text(encoding="utf-8"))
CHANGELOG = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
RELEASES = re.findall(r"^## \[(\d.*?)\] - (\S+)$", CHANGELOG, re.MULTILINE)


def test_the_version_and_its_day_are_the_same_everywhere() -> None:
    version, day = RELEASES[0]
    found = {PROJECT["version"], CITATION["version"], CODEMETA["version"]}
    assert found == {version, metadata.version("reobserve")}
    assert {str(CITATION["date-released"]), CODEMETA["dateModified"]} == {day}


def test_the_newest_release_comes_first() -> None:
    versions = [tuple(map(int, version.split("."))) for version, _ in RELEASES]
    assert versions == sorted(versions, reverse=True)


def test_names_and_words_are_the_same_everywhere() -> None:
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


def test_the_papers_are_those_of_the_citation() -> None:
    def article(reference: dict[str, Any]) -> dict[str, str]:
        place = {"@id": f"https://doi.org/{reference['doi']}"} if "doi" in reference else {}
        return {"@type": "ScholarlyArticle", **place, "name": reference["title"]}

    assert CODEMETA["referencePublication"] == [*map(article, CITATION["references"])]


@pytest.mark.parametrize("workflow", sorted((ROOT / ".github/workflows").glob("*.yml")))
def test_a_workflow_runs_targets_of_the_makefile(workflow: Path) -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for target in re.findall(r"\bmake (\w+)", workflow.read_text(encoding="utf-8")):
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target
