"""Each command of the README and the hand-written pages, as printed and in order, in a clone.

Builds that take minutes are dry runs. A line that cannot be run here is an error.
"""

from __future__ import annotations

import re
import shlex
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from docs.outputs import by_hand
from tests import ROOT

from .conftest import Project

# Contents of the files that a page leaves to the reader.
FILES = {"torque.csv": "time,torque\n0,0\n4,0.1\n6,-0.2\n9,0.05\n"}
SAME = {"more.csv": "log.csv"}  # like another one written by a command

# Built completely, on the page where it appears first.
BUILT = {
    "README.md": "results/ilo/fig1.pdf",
    "docs/pages/how-to/state-a-fault.md": "results/ilo/fig9.pdf",
}

PROGRAMS = ("reobserve", "reobserve-papers")
COMMANDS = ("make", *PROGRAMS, "snakemake", "source", "python")


@dataclass(frozen=True)
class Command:
    """A command line, whether it stands ``alone`` or in a sentence, and its expected message."""

    text: str
    alone: bool = True
    refused: str = ""


@dataclass(frozen=True)
class File:
    """A printed file, with its name in the first line."""

    name: str
    content: str


def parts(text: str) -> Iterator[Command | File]:
    """All blocks in order, and the commands in sentences. Python blocks are tested elsewhere."""
    blocks = re.split(r"^(```.*?^```$|(?:^    [^\n]*\n?)+)", text, flags=re.MULTILINE | re.DOTALL)
    for block in blocks:
        if block.startswith("```"):
            kind, _, body = block.removeprefix("```").removesuffix("```").partition("\n")
            yield from _fenced(kind, body)
        elif block.startswith("    "):
            yield from (Command(line.strip()) for line in block.splitlines() if line.strip())
        else:
            for inline in re.findall(r"`([^`]+)`", block):
                words = inline.split()
                if words and words[0] in COMMANDS:
                    yield Command(" ".join(words), alone=False)


def _fenced(kind: str, body: str) -> Iterator[Command | File]:
    if kind == "yaml" and (named := re.match(r"# (\w+\.yaml)\n", body)):
        yield File(named[1], body)
    elif kind == "console":
        for typed in re.split(r"^\$ ", body, flags=re.MULTILINE)[1:]:
            line, _, said = typed.partition("\n")
            yield Command(
                line, refused=said.strip() if said.startswith("reobserve-papers: ") else ""
            )
    elif kind == "sh":
        yield from (Command(line) for line in body.splitlines() if not line.startswith("…"))


def as_run(command: Command, built: str = "") -> str:
    """The line to run in place of a printed one; empty if there is nothing to run.

    Builds are dry runs, except that of the file ``built``.
    """
    words = shlex.split(command.text, comments=True)
    first, *rest = words
    if "…" in rest:  # any command that a step prints
        return shlex.join([first, *rest[: rest.index("…")], "--help"])
    if words == ["make", "help"]:
        return command.text
    if first in ("make", "snakemake"):
        if "--profile" in rest:  # there is no cluster here
            words = [word for word in words if word not in ("--profile", "profiles/slurm")]
        earnest = built in rest or "--dry-run" in rest or command.refused
        return shlex.join(words if earnest else [*words, "--dry-run"])
    if first in PROGRAMS:
        # What `figdiff` compares is built by a line before, which is a dry run here.
        # Nothing is accepted in CI.
        compared = rest[:1] in (["figdiff"], ["accept"])
        whole = not compared and (command.alone or len(rest) > 1 + rest.count("stage"))
        return command.text if whole else shlex.join([*words, "--help"])
    elsewhere = (
        words[:2] in (["source", ".venv/bin/activate"], ["pip", "install"])
        or first == "git"  # a copy has no history
        or "cc" in words  # tests/reobserve/codegen compiles exported code
    )
    assert elsewhere, f"no way to run {command.text}"
    return ""


def printed_on(page: Path) -> list[Command | File]:
    """On pages only blocks that no code of theirs has run; sentences mention commands of other
    pages.
    """
    found = [*parts(by_hand(page.read_text(encoding="utf-8")))]
    return [part for part in found if page.name == "README.md" or getattr(part, "alone", True)]


# Their commands need the files that they add: see tests/docs/test_add_*.py.
ADD = {f"docs/pages/how-to/{name}.md" for name in ("add-an-observer", "add-to-the-bench")}

REPORTED = {
    page.relative_to(ROOT).as_posix(): reported
    for page in (ROOT / "README.md", *sorted((ROOT / "docs/pages").rglob("*.md")))
    if "reference" not in page.parts  # nothing to follow
    and page.relative_to(ROOT).as_posix() not in ADD
    and (reported := printed_on(page))
}


@pytest.mark.nightly
@pytest.mark.parametrize("page", REPORTED)
def test_every_printed_command_runs(fresh: Project, page: str) -> None:
    for name, content in FILES.items():
        (fresh.folder / name).write_text(content)
    ran, place = [], "."
    for part in REPORTED[page]:
        if isinstance(part, Command) and re.fullmatch(r"cd \w+", part.text):
            place = part.text.removeprefix("cd ")  # of what follows
            continue
        for name, other in SAME.items():
            if (fresh.folder / other).is_file():
                shutil.copy(fresh.folder / other, fresh.folder / name)
        if isinstance(part, File):
            (fresh.folder / part.name).write_text(part.content)
        elif (line := as_run(part, BUILT.get(page, "no file"))) and line not in ran:
            if line.startswith("snakemake ") and place == ".":
                done = fresh.snakemake(*shlex.split(line)[1:], check=False)
            else:
                done = fresh.run("bash", "-c", f"cd {place}; {line}", check=False)
            reported = done.stdout + done.stderr
            if part.refused:
                assert done.returncode == 1
                assert part.refused in reported
            else:
                went = done.returncode == 0 or wants_conda(line, reported)
                assert went, f"{part.text}, run as {line}:\n{reported[-3000:]}"
            ran.append(line)
    if page in BUILT:
        assert (fresh.folder / BUILT[page]).read_bytes().startswith(b"%PDF")


def test_printed_commands_cover_all_kinds() -> None:
    commands = [
        part for reported in REPORTED.values() for part in reported if isinstance(part, Command)
    ]
    lines = [as_run(one) for one in commands if not re.fullmatch(r"cd \w+", one.text)]
    assert {line.split()[0] for line in lines if line} == {"make", "snakemake", *PROGRAMS}
    assert any(command.refused for command in commands)
    assert {page for page in REPORTED if "how-to" in page} > {"docs/pages/how-to/recorded-data.md"}


@pytest.mark.nightly
def test_build_ends_with_the_documented_sentence(fresh: Project) -> None:
    text = (ROOT / "docs/pages/start/two-commands.md").read_text(encoding="utf-8")
    (line,) = re.findall(r"^\[\d+ of \d+\] (all .*)$", text, re.MULTILINE)
    assert f"Job 0: {line}" in fresh.snakemake("--dry-run").stdout


def wants_conda(line: str, reported: str) -> bool:
    """Whether a command failed only because this machine has no conda."""
    return " conda" in line and not shutil.which("conda") and "Is conda installed" in reported
