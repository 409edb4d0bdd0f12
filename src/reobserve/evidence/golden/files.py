"""The files of golden numbers: columns of series, metrics, and the list of what is not kept."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from reobserve.errors import InputError
from reobserve.evidence.golden.kept import Array
from reobserve.evidence.golden.tolerances import Tolerance
from reobserve.plain_data.documents import read_json
from reobserve.plain_data.files import NAME, NUMBER, UNIT, Kind, read_table, write_table, write_text
from reobserve.plain_data.validation import parse
from reobserve.scoring.metrics import KEY, KINDS

# Numbers that move with rounding by more than `tolerances` calls determined: by part and name, how
# far they moved, as a part of themselves.
UNDETERMINED = "undetermined.json"
Undetermined = dict[str, dict[str, float]]

TOLERANCE_HEADER = ("column", "unit", "rounding", "step")
_METRIC_HEADER = ("observer", "metric", "value", "unit", "rounding", "step")
_UNIT_OR_NONE = Kind(lambda cell: not cell or UNIT.allows(cell), "a unit or empty")
_ALLOWED = dict.fromkeys(("rounding", "step"), NUMBER)


@dataclass(frozen=True)
class Golden:
    """A column of a record or a table, or a metric (of one row), as its file holds it."""

    text: tuple[str, ...]
    unit: str
    tolerance: Tolerance

    @property
    def values(self) -> Array:
        """The numbers; nan where a cell holds none."""
        return np.array([as_number(text) for text in self.text], dtype=np.float64)


def folder(project: Path, paper: str) -> Path:
    """Where the golden numbers of a paper are."""
    return project / "tests" / "golden" / paper


def text_of(values: Array) -> tuple[str, ...]:
    """Numbers as they are kept."""
    return tuple(f"{value:.14g}" for value in values)


def as_number(text: str) -> float:
    """What a cell holds; nan if that is no number."""
    try:
        return float(text)
    except ValueError:
        return float("nan")


def read_series(golden: Path, part: str) -> dict[str, Golden]:
    """The columns of a record.

    Raises
    ------
    InputError
        If a file is missing or damaged.
    """
    path = golden / f"{part}.series.csv"
    tolerances = read_tolerances(golden, part)
    header = ["time", *tolerances]
    table = read_table(path, header, dict.fromkeys(header, NUMBER), ["time"])
    if not table:
        raise InputError(str(path), "has no rows")
    return {
        name: Golden(tuple(row[name] for row in table), unit, tolerance)
        for name, (unit, tolerance) in tolerances.items()
    }


def write_series(golden: Path, part: str, columns: Mapping[str, Golden], period: float) -> None:
    """Write the columns of a record, a row each ``period`` [s], with their tolerances in a file
    beside; no files for none.
    """
    if not columns:
        for kind in ("series", "tolerances"):
            (golden / f"{part}.{kind}.csv").unlink(missing_ok=True)
        return
    length = max(len(column.text) for column in columns.values())
    rows = (
        {"time": f"{i * period:.6g}"} | {name: column.text[i] for name, column in columns.items()}
        for i in range(length)
    )
    write_table(golden / f"{part}.series.csv", rows, ["time", *columns])
    write_tolerances(golden, part, columns)


def read_metrics(golden: Path, part: str) -> dict[str, Golden]:
    """The metrics of a figure or a theory, by ``observer:metric``; raises as `read_series`."""
    path = golden / f"{part}.metrics.csv"
    return {
        f"{row['observer']}:{row['metric']}": Golden(
            (row["value"],), row["unit"], _tolerance(path, row)
        )
        for row in read_table(path, _METRIC_HEADER, {**KINDS, **_ALLOWED}, KEY)
    }


def write_metrics(golden: Path, part: str, metrics: Mapping[str, Golden]) -> None:
    """Write the metrics of a figure or a theory, with their tolerances."""
    rows = (
        dict(zip(("observer", "metric"), name.split(":"), strict=True))
        | {"value": metric.text[0], "unit": metric.unit}
        | _cells(metric.tolerance)
        for name, metric in metrics.items()
    )
    write_table(golden / f"{part}.metrics.csv", rows, _METRIC_HEADER)


def read_tolerances(golden: Path, part: str) -> dict[str, tuple[str, Tolerance]]:
    """Unit and tolerance of each column of a record or a table; raises as `read_series`."""
    path = golden / f"{part}.tolerances.csv"
    # A column of a table has no unit of its own.
    kinds = {"column": NAME, "unit": _UNIT_OR_NONE, **_ALLOWED}
    rows = read_table(path, TOLERANCE_HEADER, kinds, ["column"])
    return {row["column"]: (row["unit"], _tolerance(path, row)) for row in rows}


def write_tolerances(golden: Path, part: str, columns: Mapping[str, Golden]) -> None:
    """Write unit and tolerance of each column of a record or a table."""
    rows = (
        {"column": name, "unit": column.unit, **_cells(column.tolerance)}
        for name, column in columns.items()
    )
    write_table(golden / f"{part}.tolerances.csv", rows, TOLERANCE_HEADER)


def read_undetermined(golden: Path) -> Undetermined:
    """What is not kept of a paper, by part and name; nothing if there is no such file.

    Raises
    ------
    InputError
        If the file is damaged.
    """
    path = golden / UNDETERMINED
    if not path.exists():
        return {}
    stored: Undetermined = parse(Undetermined, read_json(path), str(path))
    return stored


def write_undetermined(golden: Path, names: Undetermined) -> None:
    """Write what is not kept of a paper, or take the file away if that is nothing."""
    path = golden / UNDETERMINED
    found = {part: moved for part, moved in names.items() if moved}
    if found:
        write_text(path, json.dumps(found, indent=1, ensure_ascii=False) + "\n")
    else:
        path.unlink(missing_ok=True)


def check_names(path: Path, golden: Sequence[str], found: Sequence[str]) -> None:
    """Raise `InputError` unless the names in a golden file are those that are found."""
    missing, extra = sorted(set(golden) - set(found)), sorted(set(found) - set(golden))
    if missing or extra:
        raise InputError(
            str(path), f"does not fit what is found; only there: {missing}, only here: {extra}"
        )


def _cells(tolerance: Tolerance) -> dict[str, str]:
    return {"rounding": f"{tolerance.rounding:.3g}", "step": f"{tolerance.step:.3g}"}


def _tolerance(path: Path, row: Mapping[str, str]) -> Tolerance:
    rounding, step = float(row["rounding"]), float(row["step"])
    if rounding < 0 or step < 0:
        raise InputError(
            str(path), f"holds the tolerance {rounding:g}, {step:g}; both must be >= 0"
        )
    return Tolerance(rounding, step)
