"""The files of golden numbers, one for each figure, each table and the theory of a paper."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from reobserve.core.documents import read_json
from reobserve.core.errors import InputError, shown
from reobserve.core.files import GAP, NAME, SCORE, read_table, write_table, write_text
from reobserve_papers.metrics.metrics import Metric
from reobserve_papers.parameters.parameters import Parameters

_KEY = ("source", "quantity", "time")
_KINDS = {"source": NAME, "quantity": NAME, "time": GAP, "tolerance": GAP}
_HEADER = (*_KEY, "value", "tolerance", "unit")

# Observer, metric and nothing; observer or ``plant``, channel and time [s]; or row, column and
# nothing for a table.
Key = tuple[str, str, str]


@dataclass(frozen=True)
class GoldenNumber:
    """A number, or a word of a table, as its file holds it.

    A number without a tolerance is not determined (`tolerances`): listed, but not compared.
    """

    value: str
    unit: str = ""
    tolerance: str = ""

    @property
    def is_word(self) -> bool:
        """True if the value is no number, and is compared letter by letter."""
        try:
            float(self.value)
        except ValueError:
            return True
        return False


Numbers = Mapping[Key, GoldenNumber]


def golden_file(project: Path, paper: str, part: str) -> Path:
    """The file of a figure, a table or the theory."""
    return project / "tests" / "golden" / paper / f"{part}.csv"


def golden_files(project: Path, paper: str) -> dict[str, Path]:
    """The files of a paper that there are, by part."""
    folder = golden_file(project, paper, "").parent
    return {path.stem: path for path in sorted(folder.glob("*.csv"))}


def read_numbers(path: Path) -> dict[Key, GoldenNumber]:
    """The numbers of a file, or `InputError` if it is missing or damaged."""
    rows = read_table(path, _HEADER, _KINDS, _KEY)
    for line, row in enumerate(rows, start=2):
        if row["tolerance"] and not float(row["tolerance"]) >= 0:
            problem = f"line {line}, tolerance: {row['tolerance']} must be zero or more"
            raise InputError(str(path), problem)
        # Words are in tables, whose columns have no unit.
        if (row["unit"] or row["tolerance"] or row["time"]) and not SCORE.allows(row["value"]):
            problem = f"line {line}, value: {shown(row['value'])} must be {SCORE.text}"
            raise InputError(str(path), problem)
    return {
        (row["source"], row["quantity"], row["time"]): GoldenNumber(
            row["value"], row["unit"], row["tolerance"]
        )
        for row in rows
    }


def write_numbers(path: Path, numbers: Numbers) -> None:
    """Write the file of these numbers."""
    rows = ({**dict(zip(_KEY, key, strict=True)), **vars(value)} for key, value in numbers.items())
    write_table(path, rows, _HEADER)


def parameters_file(project: Path, paper: str) -> Path:
    """The file of the parameters with which the numbers of a paper were accepted."""
    return golden_file(project, paper, "").parent / "parameters.json"


def values_by_key(parameters: Parameters) -> dict[str, Any]:
    """The value of each entry, or the key of the one that it is the same as."""
    return {key: entry.get("value", entry.get("same_as")) for key, entry in parameters.entries()}


def write_parameters(project: Path, parameters: Parameters) -> None:
    """Store the values of a paper's parameters beside its golden numbers, a line each."""
    pairs = values_by_key(parameters).items()
    lines = (f" {json.dumps(key)}: {json.dumps(value)}" for key, value in pairs)
    path = parameters_file(project, parameters.paper)
    write_text(path, "{\n" + ",\n".join(lines) + "\n}\n")


def read_parameters(project: Path, paper: str) -> dict[str, Any]:
    """The values with which the numbers of a paper were accepted, none if they were not stored."""
    path = parameters_file(project, paper)
    return read_json(path) if path.is_file() else {}


def read_metrics(project: Path, paper: str, part: str) -> list[Metric]:
    """The metrics of a figure or of the theory as they were accepted (raises as `read_numbers`)."""
    return [
        Metric(source, quantity, float(number.value), number.unit)
        for (source, quantity, time), number in read_numbers(
            golden_file(project, paper, part)
        ).items()
        if not time
    ]


def columns(*sides: Numbers) -> dict[tuple[str, str, bool], list[Key]]:
    """The keys of numbers by column: the samples of a channel, or a metric alone."""
    keys: dict[tuple[str, str, bool], list[Key]] = {}
    for key in dict.fromkeys(key for side in sides for key in side):
        source, quantity, time = key
        keys.setdefault((source, quantity, bool(time)), []).append(key)
    return keys
