"""Golden tables of the bench, compared with those of a build.

A table has a row for each method in a condition: four words that name it, then numbers. What
rounding decides in some record, in a chaotic run or by an alarm more or less, has a tolerance of
its own.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path

from reobserve.core.errors import InputError, ReobserveError, shown
from reobserve.core.files import NAME, NUMBER, SCORE, Kind, read_rows, read_table, write_table
from reobserve_papers.golden.comparison import Moved, compare, distance
from reobserve_papers.golden.number_files import GoldenNumber, Key
from reobserve_papers.golden.tolerances import MARGIN, two_digits_up

TOLERANCE = 1e-4  # relative, for rounding on other processors; 1 % of a constant moves more
# Shares of records, by task: one record of a row, with what goes with it, may count or not.
SHARES = {"leak": ("quantile", "missed")}

_REPEATS = 3  # of the scores, each with other rounding errors in the records
_ROW = ("condition", "method", "training", "given_noise")
_SCORE = Kind(lambda cell: not cell or SCORE.allows(cell), "a number, nan, inf or empty")
_SEEDS = Kind(lambda cell: NUMBER.allows(cell) and float(cell) > 0, "a number above zero")
_KINDS = {**dict.fromkeys((*_ROW, "within"), NAME), "seeds": _SEEDS}
_HEADER = ("task", "method", "quantity", "tolerance")

Tolerances = dict[tuple[str, str], float]  # by method and column with its place


def golden_table(project: Path, task: str) -> Path:
    """The accepted table of a task."""
    return project / "tests" / "golden" / "bench" / f"{task}.csv"


def tolerances_file(project: Path) -> Path:
    """The tolerances, of all tasks, of numbers that rounding moves by more than others."""
    return project / "tests" / "golden" / "bench" / "tolerances.csv"


def built_table(results: Path, task: str) -> Path:
    """The table of a task in a folder of results."""
    return results / "bench" / task / "table.csv"


def compare_task(project: Path, results: Path, task: str) -> list[Moved]:
    """The changes in the table of a task, or `InputError` if one is missing or damaged."""
    golden = _read(golden_table(project, task), task, read_tolerances(project, task))
    return list(compare(golden, _read(built_table(results, task), task), f"bench {task}"))


def renew(project: Path, results: Path, task: str) -> Iterator[str]:
    """Accept the table of a build if something moved, and yield what, one line each."""
    golden, built = golden_table(project, task), built_table(results, task)
    if golden.exists():
        moved = [str(move) for move in compare_task(project, results, task)]
    else:
        moved = [f"bench {task}: new"]
    if moved:
        print(f"measuring the tolerances of the bench, {task}, some minutes", flush=True)
        golden.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(built, golden)
        _write_tolerances(project, task, measure(project, task))
    yield from moved


def measure(project: Path, task: str) -> Tolerances:
    """The tolerances of what rounding errors in the records move by more than is allowed."""
    golden = _read(golden_table(project, task), task)
    with tempfile.TemporaryDirectory(prefix="reobserve-") as folder:
        tables = []
        for repeat in range(_REPEATS):
            tables.append(Path(folder) / f"{repeat}.csv")
            bench = project / "config" / "bench"
            arguments = (bench / f"{task}.yaml", bench / "tuned" / task, repeat, tables[-1])
            run_module(task, "reobserve_papers.bench.perturbed", *arguments)
        return wider(golden, [_read(table, task) for table in tables])


def run_module(task: str, *command: object) -> None:
    """Run a module in a process of its own, or `ReobserveError` if it fails."""
    full = [sys.executable, "-m", *map(str, command)]
    done = subprocess.run(full, capture_output=True, text=True, check=False)
    if done.returncode:
        said = done.stderr.strip().splitlines() or [f"exit code {done.returncode}"]
        raise ReobserveError(f"bench {task}: {said[-1]}")


def wider(golden: Mapping[Key, GoldenNumber], repeats: list[dict[Key, GoldenNumber]]) -> Tolerances:
    """Ten times the largest change in the repeats, where that is more than is allowed anyway."""
    widened = {}
    for key, number in golden.items():
        if number.value and not number.is_word:
            changes = [distance(float(number.value), float(trial[key].value)) for trial in repeats]
            allowed = two_digits_up(MARGIN * max(changes)) if any(changes) else 0.0
            if allowed > float(number.tolerance):
                widened[key[:2]] = allowed
    return widened


def read_tolerances(project: Path, task: str) -> Tolerances:
    """The stored tolerances of a task, none if there is no file."""
    path = tolerances_file(project)
    rows = read_table(path, _HEADER, {"tolerance": NUMBER}, _HEADER[:3]) if path.exists() else []
    return {
        (row["method"], row["quantity"]): float(row["tolerance"])
        for row in rows
        if row["task"] == task
    }


def _write_tolerances(project: Path, task: str, allowances: Tolerances) -> None:
    path = tolerances_file(project)
    stored = read_table(path, _HEADER, {"tolerance": NUMBER}, _HEADER[:3]) if path.exists() else []
    rows = [row for row in stored if row["task"] != task]
    rows += [
        {"task": task, "method": method, "quantity": quantity, "tolerance": f"{allowed:g}"}
        for (method, quantity), allowed in allowances.items()
    ]
    write_table(path, rows, _HEADER)


def _read(path: Path, task: str, stored: Tolerances | None = None) -> dict[Key, GoldenNumber]:
    """Rows by method, then condition, training set, whether the noise is given, and column."""
    header, _ = read_rows(path)
    if missing := {*_ROW, *["seeds"] * (task in SHARES)}.difference(header):
        raise InputError(str(path), f"has the columns {shown(header)}, lacks {sorted(missing)}")
    numbers: dict[Key, GoldenNumber] = {}
    for row in read_table(path, header, {name: _KINDS.get(name, _SCORE) for name in header}):
        condition, method, training, given = (row.pop(name) for name in _ROW)
        place = f"in {condition}, training {training}, given noise {given}"
        for column, cell in row.items():
            number, quantity = GoldenNumber(cell), f"{column} {place}"
            if cell and not number.is_word:
                allowed = TOLERANCE * abs(float(cell))
                if column in SHARES.get(task, ()):
                    allowed = 1.0 / float(row["seeds"])
                allowed = max(allowed, (stored or {}).get((method, quantity), 0.0))
                number = GoldenNumber(cell, "", f"{allowed:g}")
            numbers[method, quantity, ""] = number
    return numbers
