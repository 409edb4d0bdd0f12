"""Lines of arguments: unknown, missing, doubled and odd ones, paths that are devices or folders."""

from __future__ import annotations

import os
from collections.abc import Iterator
from functools import cache
from random import Random

from .. import material, mutations
from ..case import Case, command

_PATHS = [
    *("", ".", "..", "/", "/dev/null", "/dev/full", "/dev/stdout", "/dev/zero", "/dev/tty"),
    "/proc",
    *("/proc/self/mem", "folder", "folder/", "missing", "missing/x", "file", "file/x", "~", "-"),
    "x" * 300,
    *("a b", "a\nb", "$HOME", "ünï", "\udcff", "fifo-that-is-none", "out.json", "folder/out", "*"),
    "a\x00b",
]  # fmt: skip
_OPTIONS = [
    *(
        "--output",
        "--project",
        "--help",
        "--draws",
        "--seed",
        "--why",
        "--nope",
        "-x",
        "--",
        "--out",
    ),
    *(
        "--design-file",
        "--overrides",
        "--formats",
        "--papers",
        "--study-file",
        "--built",
        "--reason",
    ),
]
# What builds for minutes or changes the project is read by the parser and not done.
_SLOW = (
    *("figdiff", "accept", "golden", "draws", "check", "readme", "report"),
    *("robustness", "sensitivity", "draw", "search", "theory", "study", "archive"),
)


def make(random: Random) -> Case:
    """A line as it should be with a few arguments changed."""
    line = list(random.choice(_lines()))
    for _ in range(random.choice([1, 1, 2, 3])):
        at = random.randrange(len(line) + 1)
        act = random.randrange(5)
        if act == 0 and line:
            del line[min(at, len(line) - 1)]
        elif act == 1:
            line.insert(at, random.choice(_OPTIONS))
        elif act == 2:
            line.insert(at, random.choice([mutations.word(random), *map(str, mutations.NUMBERS)]))
        elif at < len(line):
            line[at] = random.choice([*_PATHS, mutations.word(random), "-5", "0", "1e9", "9" * 30])
    return case(line)


def examples() -> Iterator[Case]:
    """The lines as they should be."""
    for line in _lines():
        yield case(line)


def case(line: list[str]) -> Case:
    """Run it, or no more than its parser."""
    inside = {"file": b"x\n", "folder/inner": b"", "table.csv": b"name,value\nlag,0.123456\n"}
    slow = not {*line}.isdisjoint(_SLOW)
    text = " ".join(part if len(part) < 60 else f"{part[:50]}..." for part in line)
    return Case(f"reobserve {text!r}", lambda: command(*line, parse_only=slow), inside)


@cache
def _lines() -> list[list[str]]:
    root = ["--project", os.fspath(material.ROOT)]
    ledger, record = (os.fspath(f("imm")) for f in (material.ledger_file, material.record))
    lie, linear = (
        os.fspath(p) for p in (material.ledger_file("lie"), material.design("lie", "linear"))
    )
    return [
        ["list", *root],
        ["list", "ilo", "eso", *root],
        ["params", "ilo", "sampled", "--why", *root],
        ["equations", "ilo", "9", *root],
        ["stage", "parameters", "imm", "--seed", "3", "--output", "out.json", *root],
        ["stage", "parameters", "eso", "--overrides", '{"plant": {"inertia": 0.02}}',
         "--output", "o.json", *root],
        ["stage", "plant", ledger, "plain", "--output", "out.parquet"],
        ["stage", "observe", ledger, record, "kalman", "--output", "out.parquet"],
        ["stage", "design", lie, "linear", "--output", "out.json"],
        ["stage", "table", lie, "table_coefficients", "--design-file", linear,
         "--output", "out.csv"],
        ["stage", "verdicts", os.fspath(material.claims_table()), "--output", "out.md"],
        ["stage", "claims", "eso", "--results", "folder", "--output", "out.csv", *root],
        ["latex", "table.csv", "--digits", "3", "--output", "out.tex"],
        ["check", "eso", "--overrides", '{"eso": {"plant": {"inertia": 0.02}}}', *root],
        ["draws", "eso", "--most", "20", "--check", *root],
        ["readme", *root],
        ["report", "--papers", "eso", "--formats", "pdf", "png", "--output", "out.html", *root],
        ["golden", "elsewhere", "--papers", "eso", "--part", "gate", "--cores", "1", *root],
        ["golden", "update", "eso", "--reason", "a reason of four", "--anew", *root],
        ["figdiff", "--reference", "folder", "--results", "folder", "--build", *root],
        ["accept", "eso", "--reason", "a reason of four", "--cores", "2", *root],
        ["stage", "study", ledger, record, "closeness", "--output", "out.csv"],
        ["stage", "search", ledger, record, "calibrated", "--output", "out.json"],
        ["stage", "theory", lie, "--design-files", linear, "--output", "out.csv"],
        ["stage", "robustness", lie, "--draws", "8", "--no-flips", "--output", "out.json", *root],
        ["stage", "draw", lie, "0-49", "--kept", "file", "--output", "out.json", *root],
        ["stage", "sensitivity", lie, "file", "--outputs", "out.pdf", "out.png", *root],
        ["stage", "archive", "results/lie/fig1.pdf", "--output", "out.zip", *root],
    ]  # fmt: skip
