"""Golden tables of the bench, compared with those of a build.

A table has a row for each method in a condition: four words that name it, then numbers.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

from reobserve.core.files import read_rows
from reobserve_papers.golden.comparison import Moved, compare
from reobserve_papers.golden.files import GoldenNumber, Key

TOLERANCE = 1e-4  # relative, for rounding on other processors; 1 % of a constant moves more


def golden_table(project: Path, task: str) -> Path:
    """The accepted table of a task."""
    return project / "tests" / "golden" / "bench" / f"{task}.csv"


def built_table(results: Path, task: str) -> Path:
    """The table of a task in a folder of results."""
    return results / "bench" / task / "table.csv"


def compare_task(project: Path, results: Path, task: str) -> list[Moved]:
    """What moved in the table of a task; `InputError` if one is missing or damaged."""
    golden, found = _read(golden_table(project, task)), _read(built_table(results, task))
    return list(compare(golden, found, f"bench {task}"))


def renew(project: Path, results: Path, task: str) -> Iterator[str]:
    """Accept the table of a build if something moved; yield what, one line each."""
    golden, built = golden_table(project, task), built_table(results, task)
    if golden.exists():
        moved = [str(one) for one in compare_task(project, results, task)]
    else:
        moved = [f"bench {task}: new"]
    if moved:
        golden.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(built, golden)
    yield from moved


def _read(path: Path) -> dict[Key, GoldenNumber]:
    """By method, then condition, training set, whether the noise is given, and column."""
    header, rows = read_rows(path)
    numbers: dict[Key, GoldenNumber] = {}
    for condition, method, training, given, *cells in rows:
        place = f"in {condition}, training {training}, given noise {given}"
        for column, cell in zip(header[4:], cells, strict=True):
            number = GoldenNumber(cell)
            if cell and not number.is_word:
                number = GoldenNumber(cell, "", f"{TOLERANCE * abs(float(cell)):g}")
            numbers[method, f"{column} {place}", ""] = number
    return numbers
