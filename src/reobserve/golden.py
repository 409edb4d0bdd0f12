"""Golden numbers: what stands behind each figure, kept with tolerances and compared.

For each figure ``tests/golden/<paper>`` holds the series, one row every `PERIOD` seconds, and the
metrics, each with the tolerance found by halving every numerical step when it was written. The
numbers of a paper's theory are kept like the metrics of a figure of that name.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.errors import InputError
from reobserve.evaluation import Evaluation, Evaluator
from reobserve.files import NAME, NUMBER, UNIT, read_table, write_table
from reobserve.metrics import KEY, KINDS, Metric
from reobserve.series import Channel, Series

Array = NDArray[np.float64]

THEORY = "theory"
PERIOD = 0.1  # [s] between the rows kept of each series

# What another processor may round differently: kernels of BLAS, sines of the C library. A rate is
# good to some units in its last place; gains of some thousands turn that into torque.
_ROUNDING = {
    **dict.fromkeys(("N m", "N m/s, N m/s^2", "rad", "rad, rad/s", "1", "s"), 1e-9),
    **dict.fromkeys(("1/s", "1/s, 1/s^2", "V", "y", "y s"), 1e-9),
    **dict.fromkeys(("1/s^2", "1/(kg m^2)", "s/rad", "N m s/rad", "N m/s"), 1e-9),
    **dict.fromkeys(("N m/s^1", "N m/s^2", "N m/s^3"), 1e-9),
    "y s, y, y/s, y/s^2": 1e-8,  # a jerk of thousands among them
    "rad/s, A": 1e-8,
    "rad/s": 1e-12,
}

# Papers whose gains come from a solver of matrix inequalities: its last steps hang on rounding.
# Without the instructions AVX2 and FMA estimates move by 3e-7.
_SOLVED = {"eso": 1e-6}

_METRIC_HEADER = ("observer", "metric", "value", "unit", "tolerance", "reason")
_TOLERANCE_HEADER = ("column", "unit", "tolerance", "reason")
_TOLERANCE_KINDS = {"column": NAME, "unit": UNIT, "tolerance": NUMBER}


@dataclass(frozen=True)
class Deviation:
    """A number that is not within its tolerance of the golden one, of the series ``column``."""

    figure: str
    what: str
    golden: float
    found: float
    tolerance: float
    column: str = ""

    def __str__(self) -> str:
        """One line: where, what it was, what it is, what is allowed."""
        return (
            f"{self.figure}, {self.what}: golden {self.golden:.9g}, found {self.found:.9g}, "
            f"off by {abs(self.found - self.golden):.2g}, allowed {self.tolerance:.2g}"
        )


def folder(project: Path, paper: str) -> Path:
    """Where the golden numbers of a paper are."""
    return project / "tests" / "golden" / paper


def compare(evaluation: Evaluation, paper: str, figure: str, golden: Path) -> Iterator[Deviation]:
    """The deviations of a figure from the golden numbers in the folder ``golden``.

    Raises
    ------
    InputError
        If a golden file is missing, damaged or holds other columns or metrics than the figure.
    """
    yield from compare_series(kept_rows(evaluation), paper, figure, golden)
    yield from compare_metrics(evaluation.metrics, paper, figure, golden)


def compare_series(
    found: Mapping[str, Channel], paper: str, figure: str, golden: Path
) -> Iterator[Deviation]:
    """The deviations of the series of a figure, as `kept_rows` gives them; raises as `compare`."""
    columns, tolerances = read_series(golden, figure)
    _same_names(golden / f"{figure}.series.csv", columns, found)
    for column, number in found.items():
        if len(number.values) != len(columns[column]):
            yield Deviation(
                f"{paper} {figure}", f"rows of {column}",
                len(columns[column]), len(number.values), 0, column,
            )  # fmt: skip
            continue
        off = np.abs(number.values - columns[column])
        worst = int(np.argmax(off))
        if not off[worst] <= tolerances[column]:
            yield Deviation(
                f"{paper} {figure}",
                f"{column} at {worst * PERIOD:g} s",
                float(columns[column][worst]),
                float(number.values[worst]),
                tolerances[column],
                column,
            )


def compare_metrics(
    found: Iterable[Metric], paper: str, figure: str, golden: Path
) -> Iterator[Deviation]:
    """The deviations of metrics, of a figure or of the theory; raises as `compare`."""
    kept = _read_metrics(golden, figure)
    metrics = _by_name(found)
    _same_names(golden / f"{figure}.metrics.csv", kept, metrics)
    for metric, number in metrics.items():
        value, tolerance = kept[metric]
        new = float(number.values)
        if np.isnan(value) and np.isnan(new):
            continue
        if not (new == value or abs(new - value) <= tolerance):
            yield Deviation(f"{paper} {figure}", metric, value, new, tolerance)


def write(evaluator: Evaluator, refined: Evaluator, figure: str, golden: Path) -> None:
    """Write the golden numbers of a figure, with tolerances from every step halved.

    Raises
    ------
    InputError
        If a unit is none of those of which it is known how well their numbers are.
    """
    least = _SOLVED.get(evaluator.ledger.paper, 0.0)
    evaluation, fine = evaluator.figure(figure), refined.figure(figure)
    series, fine_series = kept_rows(evaluation), kept_rows(fine)
    time = np.arange(len(next(iter(series.values())).values)) * PERIOD
    rows = (
        {"time": f"{t:.6g}"} | {name: f"{n.values[i]:.14g}" for name, n in series.items()}
        for i, t in enumerate(time)
    )
    write_table(golden / f"{figure}.series.csv", rows, ["time", *series])
    write_table(
        golden / f"{figure}.tolerances.csv",
        (
            {"column": name, "unit": number.unit}
            | _tolerance(name, number, fine_series[name], least)
            for name, number in series.items()
        ),
        _TOLERANCE_HEADER,
    )
    _write_metrics(evaluation.metrics, fine.metrics, least, golden / f"{figure}.metrics.csv")


def write_theory(evaluator: Evaluator, refined: Evaluator, golden: Path) -> None:
    """Write the golden numbers of a paper's theory, like the metrics of a figure; see `write`."""
    least = _SOLVED.get(evaluator.ledger.paper, 0.0)
    path = golden / f"{THEORY}.metrics.csv"
    _write_metrics(evaluator.theory(), refined.theory(), least, path)


def kept_rows(evaluation: Evaluation) -> dict[str, Channel]:
    """The rows of all series of a figure that golden numbers keep, by owner and column."""
    series = dict(_columns("plant", evaluation.plant))
    for observer, estimate in evaluation.estimates.items():
        series.update(_columns(observer, estimate))
    return series


def _write_metrics(
    metrics: Iterable[Metric], fine: Iterable[Metric], least: float, path: Path
) -> None:
    refined = _by_name(fine)
    write_table(
        path,
        (
            dict(zip(("observer", "metric"), name.split(":"), strict=True))
            | {"value": f"{float(number.values):.14g}", "unit": number.unit}
            | _tolerance(name, number, refined[name], least)
            for name, number in _by_name(metrics).items()
        ),
        _METRIC_HEADER,
    )


def _by_name(metrics: Iterable[Metric]) -> dict[str, Channel]:
    return {
        f"{metric.observer}:{metric.metric}": Channel(np.array(metric.value), metric.unit)
        for metric in metrics
    }


def _columns(owner: str, series: Series) -> Iterator[tuple[str, Channel]]:
    every = round(PERIOD / series.step)
    units = {name: channel.unit for name, channel in series.channels.items()}
    for column, values in series.flat().items():
        name = column if column in units else column.rpartition("_")[0]
        if not name.endswith("_before"):
            yield f"{owner}.{column}", Channel(values[::every], units[name])


def _tolerance(name: str, number: Channel, fine: Channel, least: float) -> dict[str, Any]:
    """Twice the change on halving the steps, and not below what processors round differently."""
    if number.unit not in _ROUNDING:
        known = ", ".join(_ROUNDING)
        raise InputError(
            name,
            f"has the unit {number.unit!r}, of which golden.py knows no rounding; only {known}",
        )
    rows = min(number.values.size, fine.values.size)
    change = np.abs(number.values.ravel()[:rows] - fine.values.ravel()[:rows])
    halving = 2 * float(np.max(np.nan_to_num(change)))
    size = float(np.max(np.abs(np.nan_to_num(number.values))))
    rounding = max(_ROUNDING[number.unit], least) * max(1.0, size)
    reason = "twice the change on halving every step"
    if rounding > halving:
        reason = "rounding on another processor; halving every step changes less"
    return {"tolerance": f"{max(halving, rounding):.3g}", "reason": reason}


def _same_names(path: Path, golden: Any, found: Any) -> None:
    missing, extra = sorted(set(golden) - set(found)), sorted(set(found) - set(golden))
    if missing or extra:
        raise InputError(
            str(path), f"does not fit the figure; only there: {missing}, only here: {extra}"
        )


def read_series(golden: Path, figure: str) -> tuple[dict[str, Array], dict[str, float]]:
    """The golden columns of a figure, and their tolerances; raises as `compare`."""
    path = golden / f"{figure}.tolerances.csv"
    rows = read_table(path, _TOLERANCE_HEADER, _TOLERANCE_KINDS, ["column"])
    tolerances = {row["column"]: float(row["tolerance"]) for row in rows}
    path, header = golden / f"{figure}.series.csv", ["time", *tolerances]
    table = read_table(path, header, dict.fromkeys(header, NUMBER), ["time"])
    if not table:
        raise InputError(str(path), "has no rows")
    columns = {
        name: np.array([float(row[name]) for row in table], dtype=np.float64) for name in tolerances
    }
    return columns, tolerances


def _read_metrics(golden: Path, figure: str) -> dict[str, tuple[float, float]]:
    path = golden / f"{figure}.metrics.csv"
    return {
        f"{row['observer']}:{row['metric']}": (
            float(row["value"]),
            float(row["tolerance"]),
        )
        for row in read_table(path, _METRIC_HEADER, {**KINDS, "tolerance": NUMBER}, KEY)
    }
