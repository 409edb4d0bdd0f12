"""What the project says of itself to who installs, cites and archives it: the same everywhere."""

from __future__ import annotations

import re
import subprocess
import sys
from importlib import metadata

from .metadata import CODEMETA, ROOT, citation, codemeta, project

CHANGELOG = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
RELEASES = re.findall(r"^## \[(.+?)\](?: - (\S+))?$", CHANGELOG, re.MULTILINE)


def test_a_version_is_the_same_everywhere() -> None:
    version, day = next((name, day) for name, day in RELEASES if name != "Unreleased")
    assert project()["version"] == version
    assert citation()["version"] == version
    assert str(citation()["date-released"]) == day
    assert metadata.version("reobserve") == version


def test_the_changelog_is_one() -> None:
    """In the form of Keep a Changelog: newest first, each release with its day."""
    names = [name for name, _ in RELEASES]
    assert "Unreleased" not in names[1:]
    released = [name for name in names if name != "Unreleased"]
    numbers = [tuple(map(int, name.split("."))) for name in released]
    assert numbers == sorted(numbers, reverse=True)
    for name, day in RELEASES:
        assert name == "Unreleased" or re.fullmatch(r"\d{4}-\d\d-\d\d", day), name
    kinds = set(re.findall(r"^### (.*)$", CHANGELOG, re.MULTILINE))
    assert kinds <= {"Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"}


def test_codemeta_says_what_the_others_say() -> None:
    assert CODEMETA.read_text(encoding="utf-8") == codemeta(), "python -m tests.package.metadata"
    assert citation()["license"] == project()["license"]
    assert citation()["keywords"] == project()["keywords"]
    assert [one["name"] for one in citation()["authors"]] == [
        one["name"] for one in project()["authors"]
    ]


def test_the_citation_is_of_its_schema() -> None:
    words = [sys.executable, "-m", "check_jsonschema", "--builtin-schema"]
    words += ["vendor.citation-file-format", str(ROOT / "CITATION.cff")]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
