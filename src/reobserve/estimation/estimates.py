"""Estimates of a record in a program or a notebook, as `reobserve estimate` writes them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from reobserve.core.errors import InputError, shown
from reobserve.core.extras import package

if TYPE_CHECKING:
    import pandas as pd

    from reobserve.estimation.specification import Specification

_LISTED = ("start", "end", "mean", "standard_deviation", "sigma", "peak")


@dataclass(frozen=True, eq=False, repr=False)
class EstimatedRecord:
    """Results of `estimate`. Printed, they are the summary of the command.

    Attributes
    ----------
    frame
        A row per period, with the columns of the command's output: dates are dates, and what is
        missing is nan.
    alarms
        A row for each interval over which an alarm was raised: its name as ``alarm``, ``start`` and
        ``end`` as times of the frame, and ``mean``, ``standard_deviation``, ``sigma`` (by the
        observer) and ``peak`` in ``unit``.
    report
        What the command writes with ``--report``: counts, gaps, alarms, statistics of the
        innovations, and warnings.
    """

    frame: pd.DataFrame
    alarms: pd.DataFrame
    report: dict[str, Any]
    _summary: str = field(default="")
    _curves: Any = None

    def __repr__(self) -> str:
        return self._summary

    def plot(self) -> Any:
        """The matplotlib figure that the command draws with ``--plot``."""
        return self._curves.figure()


def estimate(
    specification: str | Path | Mapping[str, Any] | Specification,
    data: str | Path | IO[Any] | pd.DataFrame,
) -> EstimatedRecord:
    """Estimate a record by a specification, bitwise as the command `reobserve estimate` does.

    Parameters
    ----------
    specification
        The path of a YAML file, its content as a mapping, or what `read_specification` returns.
    data
        The path of a record, an open file, or a DataFrame. An index of dates, or one that has a
        name, is a column: without a name it is that of the timestamps. Keys on the text of files,
        such as ``delimiter``, have no meaning for a frame.

    Raises
    ------
    InputError
        As the command says: a key or column is missing, unknown or wrong, a cell is no number, or
        a policy refuses what is there.
    DivergenceError
        If the observer diverges, with the time of the record.

    Examples
    --------
    >>> import pandas as pd
    >>> from reobserve import estimate
    >>> specification = {
    ...     "observer": {
    ...         "kind": "kalman", "time": "discrete", "states": {"level": "m"},
    ...         "measurements": {"level": "m"}, "A": [[1.0]], "C": [[1.0]], "Q": 0.0, "R": 1.0,
    ...         "initial_covariance": 1.0,
    ...     },
    ...     "columns": {"time": {"column": "t"}, "measurements": [{"column": "gauge"}]},
    ...     "sampling": {"period": 1.0},
    ... }
    >>> data = pd.DataFrame({"t": [0.0, 1.0, 2.0], "gauge [cm]": [100.0, 100.0, 100.0]})
    >>> print(estimate(specification, data).frame["level [m]"].round(3).tolist())
    [0.5, 0.667, 0.75]
    """
    pd = package("pandas", "estimate a record", extra="data")
    package("pydantic", "estimate a record", extra="data")
    package("pyarrow", "estimate a record", extra="data")
    from reobserve.estimation.data_report import as_json
    from reobserve.estimation.estimate import Estimation, concatenated
    from reobserve.estimation.estimate_command import estimated
    from reobserve.estimation.estimates_plot import Plot
    from reobserve.estimation.refusals import Refusals
    from reobserve.estimation.report_table import as_table
    from reobserve.estimation.sources import source
    from reobserve.estimation.writing import as_columns, as_times

    chosen = _specification(specification)
    record = source(data, chosen)
    place = str(record.path)
    estimation = Estimation(chosen, record.header(), place, Refusals(noting=True))
    curves = estimation.curves = Plot(estimation)
    results, report = concatenated(list(estimated(estimation, record))), estimation.report
    rows = [
        (name, alarm.unit, *one.values())
        for name, alarm in report.alarms.items() for one in alarm.summary()["intervals"]
    ]  # fmt: skip
    alarms = pd.DataFrame(rows, columns=["alarm", "unit", *_LISTED])
    for end in ("start", "end"):
        alarms[end] = as_times(alarms[end].to_numpy(float), report).to_pandas()
    return EstimatedRecord(
        as_columns(results, estimation.titles, report).to_pandas(),
        alarms,
        as_json(report, {"record": record.path.name}),
        as_table(report, chosen.sampling.period),
        curves,
    )


def _specification(given: Any) -> Specification:
    """The specification in a file or a mapping."""
    from reobserve.core.documents import check_plain
    from reobserve.estimation.observer_design import plain
    from reobserve.estimation.specification import (
        Specification,
        as_specification,
        read_specification,
    )

    if isinstance(given, Specification):
        return given
    if isinstance(given, str | Path):
        return read_specification(given)
    if not isinstance(given, Mapping):
        problem = f"is {shown(given)}, must be the path of a YAML file or a mapping of its keys"
        raise InputError("specification", problem)
    tree = plain(given)
    check_plain(tree, "specification")
    return as_specification(tree)
