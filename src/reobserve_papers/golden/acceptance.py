"""New golden numbers from a build, in which one that has not moved keeps digits and tolerance."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from reobserve_papers.golden.comparison import compare, distance
from reobserve_papers.golden.conditions import measure
from reobserve_papers.golden.number_files import (
    GoldenNumber,
    Key,
    Numbers,
    columns,
    golden_file,
    golden_files,
    read_numbers,
    write_numbers,
)
from reobserve_papers.golden.tolerances import tolerance
from reobserve_papers.golden.values import built_numbers, part_names


def renew(
    project: Path, folder: Path, tree: Mapping[str, Any], paper: str, cores: int, only: str = ""
) -> list[str]:
    """Write the golden numbers of a paper that moved, from its results in ``folder``.

    With ``only`` those of one figure, table or the theory.

    The paper is evaluated under other settings only if something moved. What moved is returned,
    one line for each column.
    """
    golden: dict[str, Numbers] = {}
    names = [part for part in part_names(tree) if only in ("", part)]
    built = {part: built_numbers(folder, tree, part) for part in names}
    moved: list[str] = []
    for part, numbers in built.items():
        path = golden_file(project, paper, part)
        golden[part] = read_numbers(path) if path.exists() else {}
        if path.exists():
            moved += map(str, compare(golden[part], numbers, f"{paper} {part}"))
        else:
            moved.append(f"{paper} {part}: new")
    if moved:
        print(f"measuring the tolerances of {paper}, some minutes", flush=True)
        *processors, halved = measure(project, paper, cores)
        for part, numbers in built.items():
            others = [processor[part] for processor in processors]
            new = renewed(golden[part], numbers, others, halved[part])
            write_numbers(golden_file(project, paper, part), new)
    for part, path in golden_files(project, paper).items():
        if part not in built and not only:
            path.unlink()
            moved.append(f"{paper} {part}: removed, nothing of this name is built")
    return moved


def renewed(
    golden: Numbers, built: Numbers, processors: Sequence[Numbers], halved: Numbers
) -> dict[Key, GoldenNumber]:
    """The numbers of a part: golden columns that have not moved, the others with new tolerances.

    A number that was only listed stays so: that rounding decides it does not show every time.
    """
    new: dict[Key, GoldenNumber] = {}
    for keys in columns(built).values():
        old = {key: golden[key] for key in keys if key in golden}
        column = {key: built[key] for key in keys}
        if list(compare(old, column, "")):
            new |= _measured(column, processors, halved)
        else:
            compared = {key: cell for key, cell in old.items() if cell.tolerance or cell.is_word}
            new |= {key: compared.get(key, _listed(number)) for key, number in column.items()}
    return new


def _listed(number: GoldenNumber) -> GoldenNumber:
    return number if number.is_word else GoldenNumber(f"{float(number.value):.3g}", number.unit)


def _measured(column: Numbers, processors: Sequence[Numbers], halved: Numbers) -> Numbers:
    if any(number.is_word for number in column.values()):
        return column
    values = {key: float(number.value) for key, number in column.items()}
    size = max((abs(value) for value in values.values() if math.isfinite(value)), default=0.0)
    moved = max(distance(values[key], _value(other, key)) for other in processors for key in values)
    new = {}
    for key, value in values.items():
        change = abs(value - _value(halved, key))
        # With half the step a run may end at another time: then there is nothing to compare.
        allowed = tolerance(size, moved, change if math.isfinite(change) else 0.0)
        number = column[key]
        new[key] = _listed(number) if allowed is None else replace(number, tolerance=f"{allowed:g}")
    return new


def _value(numbers: Numbers, key: Key) -> float:
    """A number, or nan where there is none."""
    return math.nan if key not in numbers or numbers[key].is_word else float(numbers[key].value)
