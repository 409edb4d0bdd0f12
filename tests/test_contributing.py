"""CONTRIBUTING.md: its commands and places exist."""

from __future__ import annotations

import re
import shlex
from importlib.util import find_spec

import pytest

from reobserve.cli import main as library
from reobserve.core.documents import read_yaml
from reobserve_papers.cli import main as papers
from tests import ROOT

TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
INLINE = [code.replace("\n", " ") for code in re.findall(r"`([^`]+)`", TEXT)]
BLOCKS = [line.strip() for line in re.findall(r"^    (\S.*)$", TEXT, re.MULTILINE)]
PROGRAMS = {"reobserve": library.main, "reobserve-papers": papers.main}
CALLED = ("make", "pytest", "python", *PROGRAMS)
COMMANDS = [
    shlex.split(line, comments=True)
    for line in (*INLINE, *BLOCKS)
    if line.partition(" ")[0] in CALLED
]


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_named_command_exists(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    first, *rest = words
    if first == "make":
        makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
        targets = [word for word in rest if "=" not in word]
        assert all(re.search(rf"^{one}:.*##", makefile, re.MULTILINE) for one in targets)
    elif first == "python":
        assert rest[0] == "-m"
        assert find_spec(rest[1]) is not None
    elif first == "pytest":
        path, *chosen = rest
        found = sorted((ROOT / path).rglob("test_*.py")) or [ROOT / path]
        texts = [one.read_text(encoding="utf-8") for one in found]
        assert chosen[:1] != ["-k"] or any(f"{chosen[1]}() ->" in text for text in texts)
    else:
        if rest:
            with pytest.raises(SystemExit):
                PROGRAMS[first]([*rest, "--help"])
        assert capsys.readouterr().err == ""


def test_named_places_exist() -> None:
    named = {word for code in (*INLINE, *BLOCKS) for word in re.findall(r"[\w.]+/[\w./]+", code)}
    named -= {".venv/bin/activate"}
    assert "src/reobserve_papers/cli/stage_commands.py" in named
    assert {name for name in named if not (ROOT / name).exists()} == set()


def test_named_subcommands_and_rules_exist() -> None:
    """Those in the Makefile, the CI workflows, and the rules of the Slurm profile."""
    files = (ROOT / "Makefile", *(ROOT / ".github/workflows").glob("*.yml"))
    text = "\n".join(path.read_text(encoding="utf-8") for path in files)
    typed = r"(?:^\t|^ +|bin/|run: )(reobserve(?:-papers)?) ([a-z]+)\b"
    named = set(re.findall(typed, text, re.MULTILINE))
    assert {("reobserve-papers", "samples"), ("reobserve-papers", "accept")} <= named
    for program, name in named:
        with pytest.raises(SystemExit, match=r"^0$"):
            PROGRAMS[program]([name, "--help"])
    texts = [one.read_text(encoding="utf-8") for one in ROOT.glob("workflow/rules/*.smk")]
    rules = set(re.findall(r"^rule (\w+):", "\n".join(texts), re.MULTILINE))
    profile = read_yaml(ROOT / "profiles/slurm/config.yaml")
    assert {*profile["set-resources"], *profile["groups"]} <= rules


def test_paths_that_start_workflows_exist() -> None:
    for path in (ROOT / ".github/workflows").glob("*.yml"):
        for named in re.findall(
            r"^ +- ((?:src|tests|profiles|workflow)/\S+)$", path.read_text(), re.MULTILINE
        ):
            assert any(ROOT.glob(named)), (path.name, named)
