"""Rows that share a timestamp: the first or the last one is kept, or all are merged into one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as parquet
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.core.validation import parse
from reobserve.estimation.data_report import DataReport
from reobserve.estimation.estimate_command import estimate_file
from reobserve.estimation.specification import Specification
from tests.reobserve.estimation.records import read_results, streamed, write_record

Array = NDArray[np.float64]
Record = dict[str, Array]

ANY_PATH = settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
# Of an integrator, whose position is a straight line between two steps of its speed.
INTEGRATOR = {
    "kind": "kalman", "time": "continuous", "states": {"x": "m"}, "inputs": {"u": "m/s"},
    "measurements": {"x": "m"}, "A": [[0.0]], "B": [[1.0]], "C": [[1.0]], "Q": 1e-6, "R": 1e-2,
    "initial_state": [0.0], "initial_covariance": 1.0,
}  # fmt: skip
SENSORS = {
    "kind": "kalman", "time": "discrete", "states": dict.fromkeys("abc", "m"),
    "measurements": dict.fromkeys("abc", "m"), "A": np.eye(3).tolist(), "C": np.eye(3).tolist(),
    "Q": [0.01] * 3, "R": [0.01] * 3, "initial_state": [0.0] * 3, "initial_covariance": 1.0,
}  # fmt: skip


def stated(observer: dict[str, Any], inputs: list[Any] | None = None, **sampling: Any) -> Any:
    columns = {
        "time": {"column": "t"}, "measurements": [{"column": c} for c in observer["measurements"]],
        "inputs": inputs or [],
    }  # fmt: skip
    sampling = {"period": 0.1, **sampling}
    return parse(Specification, {"observer": observer, "columns": columns, "sampling": sampling})


def estimates(chosen: Specification, record: Record, path: Path) -> tuple[str, DataReport]:
    """The results and the report of a file, which those of a stream and of Parquet must equal."""
    text, out = write_record(path / "r.csv", record), path / "e.csv"
    report = estimate_file(chosen, text, out, block=200).report
    found = out.read_text()
    assert streamed(chosen, text) == found
    parquet.write_table(pa.table({k: pa.array(v, from_pandas=True) for k, v in record.items()}),
                        path / "r.parquet")  # fmt: skip
    estimate_file(chosen, path / "r.parquet", out, block=200)
    assert out.read_text() == found
    return found, report


def rows(record: Record, kept: Array) -> Record:
    return {name: values[kept] for name, values in record.items()}


def moving(seed: int, uneven: bool) -> tuple[Record, NDArray[np.bool_]]:
    """A position and its speed with a row before and one after each step, and the rows before."""
    random = np.random.default_rng(seed)
    events = np.sort(random.uniform(0.05, 2.4, random.integers(1, 9)))
    grid = 0.1 * np.arange(26)
    events[::3] = np.unique(random.choice(grid[1:-1], 9))[: len(events[::3])] + 2e-10  # rounding
    events = np.unique(events)
    if not uneven:
        events = np.unique(random.choice(grid[1:-1], 5))
    times = np.unique(np.concatenate([grid, events]))
    speed = np.zeros(len(times))
    for event in events:
        speed[times >= event] = random.uniform(-10.0, 10.0)
    position = np.concatenate([[0.0], np.cumsum(speed[:-1] * np.diff(times))])
    at = np.flatnonzero(np.isin(times, events))
    before = np.zeros(len(times) + len(at), dtype=bool)
    before[at + np.arange(len(at))] = True
    order = np.sort(np.concatenate([np.arange(len(times)), at]))
    u = speed[order]
    u[before] = speed[at - 1]
    return {"t": times[order], "x": position[order], "u": u}, before


@given(seed=st.integers(0, 2**16), uneven=st.sampled_from(["linear", "refuse"]))
@ANY_PATH
def test_last_of_two_rows_has_the_input_from_then_on(
    seed: int, uneven: str, tmp_path: Path
) -> None:
    """A filter whose model is exact then has no residual, wherever the input steps."""
    record, before = moving(seed, uneven != "refuse")
    chosen = stated(INTEGRATOR, [{"column": "u"}], uneven=uneven, repeated="last")
    _, report = estimates(chosen, record, tmp_path)
    assert report.repeated == before.sum()
    residual = read_results(tmp_path / "e.csv")[0]["residual x"]
    assert np.abs(residual).max() < 1e-8  # a step of an input that is late leaves 0.1


@pytest.mark.parametrize("uneven", ["linear", "refuse"])
def test_other_row_might_be_left_out_of_the_file(uneven: str, tmp_path: Path) -> None:
    record, before = moving(5, uneven != "refuse")
    after = np.concatenate([[False], before[:-1]])
    for repeated, left_out in (("last", before), ("first", after)):
        kept, _ = estimates(stated(INTEGRATOR, [{"column": "u"}], uneven=uneven),
                            rows(record, ~left_out), tmp_path)  # fmt: skip
        chosen = stated(INTEGRATOR, [{"column": "u"}], uneven=uneven, repeated=repeated)
        assert estimates(chosen, record, tmp_path)[0] == kept


def sensors(seed: int, whole: bool) -> tuple[Record, Record]:
    """Three sensors and an input, of which one or two have no row at some instants.

    The first record has a row for each of them, the second one a row for each instant.
    """
    random = np.random.default_rng(seed)
    times = 0.1 * np.arange(25.0) + (0.0 if whole else random.uniform(-0.04, 0.04, 25))
    values = random.normal(size=(25, 3))
    values[np.arange(25), random.integers(0, 3, 25)] = np.where(random.random(25) < 0.5, np.nan, 1)
    wide = np.column_stack([times, values])
    long = []
    for row in wide:
        there = [c for c in random.permutation(3) + 1 if np.isfinite(row[c])]
        long += [np.where(np.isin(np.arange(4), [0, c]), row, np.nan) for c in there]
    return tuple(dict(zip("tabc", np.array(one).T, strict=True)) for one in (long, wide))  # type: ignore[return-value]


@given(seed=st.integers(0, 2**16), uneven=st.sampled_from(["linear", "previous", "refuse"]))
@ANY_PATH
def test_rows_of_several_sensors_are_merged_into_the_wide_record(
    seed: int, uneven: str, tmp_path: Path
) -> None:
    long, wide = sensors(seed, uneven == "refuse")
    policies = {"uneven": uneven, "missing": "skip", "at_gap": "coast"}
    found, report = estimates(stated(SENSORS, repeated="merge", **policies), long, tmp_path)
    assert found == estimates(stated(SENSORS, **policies), wide, tmp_path)[0]
    assert report.repeated == len(long["t"]) - len(wide["t"])
    assert report.missing == {k: n for k in "abc" if (n := int(np.isnan(wide[k]).sum()))}


def test_input_that_is_held_is_merged_with_a_measurement(tmp_path: Path) -> None:
    """Its empty cells stand for the value before, which a number in another row replaces."""
    nan = np.nan
    inputs = [{"column": "u", "missing": "hold"}]
    record = {
        "t": np.repeat(0.1 * np.arange(4), 2), "x": np.array([0, nan, nan, 0, 1, nan, nan, 1.0]),
        "u": np.array([nan, 5, nan, nan, nan, 7, nan, 8]),
    }  # fmt: skip
    wide = {"t": record["t"][::2], "x": np.array([0, 0, 1, 1.0]), "u": np.array([5, nan, 7, 8])}
    found, _ = estimates(stated(INTEGRATOR, inputs, repeated="merge"), record, tmp_path)
    assert found == estimates(stated(INTEGRATOR, inputs), wide, tmp_path)[0]


@given(row=st.integers(1, 39), column=st.sampled_from("abc"), copies=st.integers(1, 3))
@example(row=1, column="a", copies=1)
@ANY_PATH
def test_two_numbers_for_one_cell_are_refused(
    row: int, column: str, copies: int, tmp_path: Path
) -> None:
    """But not the same number twice, and the line is the one with the second number."""
    names = "tabc"
    wide = np.column_stack([0.1 * np.arange(40), *np.ones((3, 40))])
    again = np.repeat(wide, [copies + 1 if k == row else 1 for k in range(40)], axis=0)
    chosen = stated(SENSORS, repeated="merge")
    estimates(chosen, dict(zip(names, again.T, strict=True)), tmp_path)
    again[row + copies, names.index(column)] = 2.5
    text = write_record(tmp_path / "r.csv", dict(zip(names, again.T, strict=True)))
    line = row + copies + 2
    said = (
        f"{column}: line {line} has 2.5 m and a row before it, with the same timestamp, 1 m; samp"
    )
    for run in (lambda: estimate_file(chosen, text, tmp_path / "e.csv"),
                lambda: streamed(chosen, text)):  # fmt: skip
        with pytest.raises(InputError) as error:
            run()
        assert str(error.value).startswith(said)


@pytest.mark.parametrize("repeated", ["first", "last", "merge"])
def test_later_refusals_name_their_own_lines(repeated: str, tmp_path: Path) -> None:
    times = np.repeat(0.1 * np.arange(40), 2)
    times[60:] += 0.04
    record = {"t": times, **{name: np.ones(80) for name in "abc"}}
    text = write_record(tmp_path / "r.csv", record)
    chosen = stated(SENSORS, repeated=repeated)
    for run in (lambda: estimate_file(chosen, text, tmp_path / "e.csv"),
                lambda: streamed(chosen, text)):  # fmt: skip
        with pytest.raises(InputError, match=f"in line {62 + (repeated != 'first')} of "):
            run()
