"""Each command of the README, as printed and in order, in a clone of the project.

What would build for minutes is a dry run. A line that this does not know how to run is an error.
"""

from __future__ import annotations

import re
import shlex
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.test_project import ROOMS

from .conftest import Project

README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")

# What the files that the README leaves to its reader hold.
FILES = {"torque.csv": "time,torque\n0,0\n4,0.1\n6,-0.2\n9,0.05\n"}

# Single figures are built in earnest; of a few it says that they take minutes.
QUICK = ("results/ilo/fig3.pdf", "results/ilo/fig9.pdf")


@dataclass(frozen=True)
class Command:
    """A line to type; ``alone`` if it stands in a block, and not in a sentence."""

    words: tuple[str, ...]
    alone: bool

    @property
    def text(self) -> str:
        """As it is typed."""
        return shlex.join(self.words)


@dataclass(frozen=True)
class File:
    """A file that the README prints, its name in its first line."""

    name: str
    content: str


@dataclass(frozen=True)
class Printed:
    """Lines that are no commands: what a run prints, or which folders there are."""

    lines: tuple[str, ...]


def parts() -> Iterator[Command | File | Printed]:
    """All blocks of the README in order, and the commands in its sentences.

    Python blocks are tested elsewhere.
    """
    blocks = re.split(r"^(```.*?^```$|(?:^    [^\n]*\n?)+)", README, flags=re.MULTILINE | re.DOTALL)
    for block in blocks:
        if block.startswith("```"):
            yield from _fenced(block)
        elif block.startswith("    "):
            yield from _indented([line.strip() for line in block.splitlines() if line.strip()])
        else:
            for inline in re.findall(r"`([^`]+)`", block):
                words = shlex.split(inline.replace("\n", " "))
                if words and words[0] in ("make", "reobserve", "snakemake", "source", "python"):
                    yield Command(tuple(words), alone=False)


def _fenced(block: str) -> Iterator[File]:
    kind, _, body = block.removeprefix("```").removesuffix("```").partition("\n")
    if kind == "yaml":
        name = body.partition("\n")[0].removeprefix("# ")
        assert re.fullmatch(r"\w+\.yaml", name), f"a block without the name of its file: {name}"
        yield File(name, body)
    elif kind == "text":
        plan = [line.partition("  ")[0] for line in body.strip().splitlines()]
        floors = [set(floor.split(", ")) for floor in reversed(plan)]
        places = [next(i for i, floor in enumerate(floors) if room in floor) for room in ROOMS[:-1]]
        assert places == sorted(places), "the floor plan has another order than the rooms"
        assert set().union(*floors) == set(ROOMS[:-1])
    else:
        assert kind == "python", f"a block of {kind!r}, which nothing tests"


def _indented(lines: list[str]) -> Iterator[Command | Printed]:
    if lines[0].startswith(("… of …", "Snakefile")):
        yield Printed(tuple(lines))
        return
    for line in lines:
        yield Command(tuple(shlex.split(line, comments=True)), alone=True)


def as_run(command: Command) -> tuple[str, ...] | None:
    """The words to run in place of a printed command; None if there is nothing to run."""
    first, *rest = command.words
    if "…" in rest:  # any command that a step prints
        return (first, *rest[: rest.index("…")], "--help")
    if first == "cp" or command.words == ("make", "help"):
        return command.words
    if first in ("make", "snakemake"):
        earnest = any(word in QUICK for word in rest) or "--dry-run" in rest
        return command.words if earnest else (*command.words, "--dry-run")
    if first == "reobserve":
        whole = command.alone or len(rest) > 1 + rest.count("stage")
        return command.words if whole else (*command.words, "--help")
    if command.words[:3] == ("python", "-m", "tests.fuzz"):  # a single case of them all
        return (*command.words, "--class", "yaml", "--case", "1")
    assert command.words == ("source", ".venv/bin/activate"), f"no way to run {command.text}"
    return None


def test_every_command_of_the_readme_runs(fresh: Project) -> None:
    for name, content in FILES.items():
        (fresh.folder / name).write_text(content)
    ran = set()
    for part in parts():
        if isinstance(part, File):
            (fresh.folder / part.name).write_text(part.content)
        elif isinstance(part, Printed):
            check_printed(fresh, part.lines)
        elif (words := as_run(part)) is not None:
            done = fresh.run(*words, check=False)
            told = done.stdout + done.stderr
            went = done.returncode == 0 or wants_conda(words, told)
            assert went, f"{part.text}, run as {shlex.join(words)}:\n{told[-3000:]}"
            ran.add(words[0])
    for figure in QUICK:
        assert (fresh.folder / figure).read_bytes().startswith(b"%PDF"), figure
    assert ran == {"cp", "make", "snakemake", "reobserve", "python"}


def wants_conda(words: tuple[str, ...], told: str) -> bool:
    """Whether all that stopped a command is that this machine has no conda."""
    return "conda" in words and not shutil.which("conda") and "Is conda installed" in told


def check_printed(project: Project, lines: tuple[str, ...]) -> None:
    """What the README says that a run prints, it prints; folders that it names are there."""
    if lines[0].startswith("Snakefile"):
        # Two columns of names, each with what they hold.
        names = re.findall(r"(?:^|\s{2,})([\w/.]+(?:, [\w/.]+)*)  ", "\n".join(lines))
        named = [name for group in names for name in group.split(", ") if "/" in name]
        assert named
        for name in named:
            assert (project.folder / name).exists(), name
        return
    told = project.snakemake("--dry-run", "--verbose").stdout
    (line,) = lines
    count, _, text = line.split("  ")
    assert count == "… of …"
    assert f"Job 0: {text}" in told
