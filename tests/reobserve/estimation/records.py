"""Records as files, and results read back."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.documents import parse_yaml
from reobserve.core.validation import parse
from reobserve.estimation.estimate import Estimation
from reobserve.estimation.example_records import Simulated
from reobserve.estimation.families.examples import specification_text
from reobserve.estimation.row_by_row import RowByRow
from reobserve.estimation.specification import Specification
from reobserve.estimation.writing import header

Array = NDArray[np.float64]


def specification(name: str, **changes: Mapping[str, Any]) -> Specification:
    """The specification of an example, with changed keys."""
    tree = parse_yaml(specification_text(name), name)
    for branch, keys in changes.items():
        if isinstance(tree.get(branch), dict) and isinstance(keys, dict):
            tree[branch] = {**tree[branch], **keys}
        else:
            tree[branch] = keys
    return parse(Specification, tree)


HELD = ("Tx", "Ty", "Tz", "torque", "volts", "fault", "offset", "worn", "healthy")
TRUE = {
    "fault_1": "fault", "fault_2": "none", "fault_3": "none", "angle": "angle", "rate": "rate",
    "delay": "delay", "level": "level", "derivatives_1": "v0", "derivatives_2": "v1",
    "derivatives_3": "v2", "speed": "speed", "current": "current", "voltage_lost": "fault",
    "speed_offset": "offset", "probability_worn": "worn", "probability_healthy": "healthy",
}  # fmt: skip


def signal_at(plant: Simulated, name: str, times: Array) -> Array:
    """A signal of a plant at any times. A held one has the value of the period around them."""
    if name in HELD:
        step = np.searchsorted(plant.time, times + 1e-9 * plant.time[10], side="right") - 1
        return np.asarray(plant.signals[name][step])
    return np.asarray(np.interp(times, plant.time, plant.signals[name]))


def truth(plant: Simulated, times: Array) -> dict[str, Array]:
    """The true values of the estimates of a plant, by their columns."""
    return {to: signal_at(plant, name, times) for to, name in TRUE.items() if name in plant.signals}


def record_at(plant: Simulated, times: Array) -> dict[str, Array]:
    """The record of a plant with other timestamps [s]."""
    signals = {name: np.repeat(signal_at(plant, name, times), 10) for name in plant.signals}
    return Simulated(np.repeat(times, 10), signals, plant.logged).record()


def write_record(path: Path, columns: Mapping[str, Array]) -> Path:
    """A CSV file with all digits; nan becomes an empty cell."""
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    lines = [",".join(columns)]
    lines += [",".join("" if value != value else repr(value) for value in row) for row in rows]  # noqa: PLR0124
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def read_results(path: Path) -> tuple[dict[str, Array], list[str]]:
    """The columns of a CSV by name without unit, nan for empty cells; and the status.

    Dates are in seconds after the second in which the first one lies.
    """
    with path.open(encoding="utf-8", newline="") as stream:
        titles, *rows = csv.reader(stream)
    if titles[0] == "time":
        dates = [datetime.fromisoformat(row[0]) for row in rows]
        for row, date in zip(rows, dates, strict=True):
            row[0] = repr((date - dates[0].replace(microsecond=0)).total_seconds())
    names = [title.partition(" [")[0] for title in titles]
    numbers = {
        name: np.array([float(row[c]) if row[c] else np.nan for row in rows])
        for c, name in enumerate(names[:-1])
    }
    return numbers, [row[-1] for row in rows]


def streamed(chosen: Specification, text: Path) -> str:
    """The results of a record that arrives line by line."""
    titles, *lines = text.read_text(encoding="utf-8").splitlines(keepends=True)
    estimation = Estimation(chosen, titles.strip().split(","), str(text))
    rows = RowByRow(estimation, titles.strip().split(","))
    return header(estimation.titles) + "".join(map(rows.read, lines)) + rows.finish()
