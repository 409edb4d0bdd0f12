"""`reobserve.estimate`: the numbers and the sentences of the command, of files and of frames."""

from __future__ import annotations

import io
import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import reobserve
from reobserve.core.documents import parse_yaml, read_yaml
from reobserve.core.errors import InputError
from reobserve.estimation.estimate_command import estimate_file
from reobserve.estimation.families.examples import examples, simulated, specification_text
from reobserve.estimation.report_table import as_table
from reobserve.estimation.specification import read_specification
from tests import ROOT
from tests.reobserve.estimation.records import specification, write_record

ROWS = 300


def same(made: Any, chosen: Any, record: Path, folder: Path) -> None:
    """Compare with what the command writes: cells, report and alarms."""
    out, report = folder / "e.parquet", folder / "e.json"
    estimation = estimate_file(chosen, record, out, report=report)
    expected = pd.read_parquet(out)
    pd.testing.assert_frame_equal(made.frame, expected, check_exact=True)
    written = json.loads(report.read_text(encoding="utf-8"))
    assert {**json.loads(json.dumps(made.report)), "record": ""} == {**written, "record": ""}
    assert repr(made) == as_table(estimation.report, chosen.sampling.period)
    intervals = [
        {"alarm": name, **one}
        for name, alarm in written["alarms"].items() for one in alarm["intervals"]
    ]  # fmt: skip
    assert len(made.alarms) == len(intervals)
    for row, interval in zip(made.alarms.to_dict("records"), intervals, strict=True):
        for key in ("alarm", "mean", "peak"):
            assert row[key] == interval[key]
        for key in ("start", "end"):
            assert pd.Timestamp(row[key]) == pd.Timestamp(interval[key])
            assert (expected.iloc[:, 0] == row[key]).sum() == 1


@pytest.mark.nightly_after(6)
@pytest.mark.parametrize("name", examples())
def test_frames_give_the_numbers_of_the_command_for_each_example(name: str, tmp_path: Path) -> None:
    columns = {title: values[:ROWS] for title, values in simulated(name).record().items()}
    record = write_record(tmp_path / "r.csv", columns)
    tree = parse_yaml(specification_text(name), name)
    same(reobserve.estimate(tree, pd.DataFrame(columns)), specification(name), record, tmp_path)


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("logs")
    script = ROOT / "examples/logs/make_logs.py"
    subprocess.run([sys.executable, script, folder], check=True)
    return folder


def by_index(record: Path, chosen: Any) -> pd.DataFrame:
    """A frame as users have them: dates as an index, which has no name."""
    columns, time = chosen.columns, chosen.columns.time
    frame = pd.read_csv(
        record, sep=columns.delimiter, decimal=columns.decimal, encoding=columns.encoding,
        skiprows=int(columns.delimiter == ";"),
    )  # fmt: skip
    if time.dated == "iso8601":
        dates = pd.to_datetime(frame.pop(time.column), format=time.format or "ISO8601")
        frame.index = pd.DatetimeIndex(dates.to_numpy(), tz=dates.dt.tz)
    return frame


SOURCES: dict[str, Callable[[Path, Any], Any]] = {
    "path": lambda record, _: str(record),
    "bytes": lambda record, _: io.BytesIO(record.read_bytes()),
    "text": lambda record, chosen: io.StringIO(
        record.read_text(encoding=chosen.columns.encoding)
    ),
    "frame": by_index,
}  # fmt: skip


@pytest.mark.parametrize(
    ("name", "kind"),
    [("bias", "frame"), ("thruster", "frame"), *(("leak", kind) for kind in SOURCES)],
)
def test_logs_may_be_paths_open_files_and_frames(
    name: str, kind: str, logs: Path, tmp_path: Path
) -> None:
    path, record = ROOT / f"examples/logs/{name}.yaml", logs / f"{name}.csv"
    chosen = read_specification(path)
    made = reobserve.estimate(path, SOURCES[kind](record, chosen))
    same(made, chosen, record, tmp_path)
    assert len(made.alarms) == 1
    shown = {"path": "leak.csv", "frame": "the frame"}.get(kind, "the open file")
    kinds = {"thruster": "SampledILO"}
    assert made.plot().get_suptitle() == f"{shown}, {kinds.get(name, 'AugmentedKalmanFilter')}"


def test_open_parquet_files_and_packed_ones_are_read_by_their_names(tmp_path: Path) -> None:
    columns = {title: values[:50] for title, values in simulated("kalman").record().items()}
    frame = pd.DataFrame(columns)
    expected = reobserve.estimate(specification("kalman"), frame).frame
    frame.to_parquet(tmp_path / "r.parquet")
    frame.to_csv(tmp_path / "r.csv.gz", index=False)
    frame.set_index("t").to_parquet(tmp_path / "indexed.parquet")
    for data in (frame.set_index("t"), pd.read_parquet(tmp_path / "r.parquet")):
        found = reobserve.estimate(specification("kalman"), data).frame
        pd.testing.assert_frame_equal(found, expected, check_exact=True)
    for name in ("r.parquet", "r.csv.gz", "indexed.parquet"):
        with (tmp_path / name).open("rb") as stream:
            found = reobserve.estimate(specification("kalman"), stream).frame
        pd.testing.assert_frame_equal(found, expected, check_exact=True)


def test_truths_are_one_and_zero_in_files_and_frames(tmp_path: Path) -> None:
    frame = pd.DataFrame({title: one[:50] for title, one in simulated("kalman").record().items()})
    truths = frame.assign(speed=frame["speed"] > frame["speed"].median())
    expected = reobserve.estimate(specification("kalman"), truths.astype({"speed": float})).frame
    truths.to_csv(tmp_path / "r.csv", index=False)
    truths.to_parquet(tmp_path / "r.parquet")
    for data in (truths, tmp_path / "r.csv", tmp_path / "r.parquet"):
        found = reobserve.estimate(specification("kalman"), data).frame
        pd.testing.assert_frame_equal(found, expected, check_exact=True)


def refused(data: Any, chosen: Any = None) -> str:
    with pytest.raises(InputError) as caught:
        reobserve.estimate(chosen or specification("kalman"), data)
    return str(caught.value)


def test_frames_are_refused_in_the_words_of_the_command(tmp_path: Path) -> None:
    columns = {title: values[:50] for title, values in simulated("kalman").record().items()}
    frame = pd.DataFrame(columns)
    without = refused(frame.drop(columns="speed"))
    frame.drop(columns="speed").to_csv(tmp_path / "r.csv", index=False)
    assert refused(tmp_path / "r.csv").replace(str(tmp_path / "r.csv"), "the frame") == without
    assert without.startswith("columns.measurements.0.column: the frame has no column 'speed'")
    texts = frame.astype({"speed": object})
    texts.loc[3, "speed"] = "fast"
    assert refused(texts) == "the frame: row 4 of column 'speed' is 'fast', must be a number"
    numbers = frame.astype({"speed": str})
    assert "column 'speed' is of the type large_string, must be numbers" in refused(numbers)
    assert "must be numbers" in refused(frame.astype({"speed": "category"}))
    assert "row 1 of column 'speed' is (-" in refused(frame.astype({"speed": complex}))
    infinite = frame.copy()
    infinite.loc[7, "current"] = np.inf
    assert refused(infinite) == "current: row 8 is inf, must be a number, or empty if it is missing"
    twice = pd.concat([frame, frame[["speed"]]], axis=1)
    assert "has the column 'speed' twice" in refused(twice)
    late = frame.copy()
    late["t"] += np.where(late.index == 9, 4.0, 0.0)
    assert "row 10" in refused(late)
    assert "there is no such file" in refused("x" * 5000)
    with (tmp_path / "w").open("w") as stream:
        assert "must be a path, an open file or a DataFrame" in refused(stream)
    assert refused(frame.iloc[:0]).startswith("the frame: has no row from which the observer")


def test_dates_of_frames_are_refused_where_the_specification_has_none(tmp_path: Path) -> None:
    columns = {title: values[:50] for title, values in simulated("kalman").record().items()}
    frame = pd.DataFrame(columns)
    frame["t"] = pd.Timestamp("2026-03-02") + pd.to_timedelta(frame["t"], unit="ms")
    said = "the frame: column 't' holds dates; as timestamps their unit is iso8601"
    assert refused(frame) == said
    assert refused(frame.set_index("t")) == said
    tree: Any = parse_yaml(specification_text("kalman"), "kalman")
    tree["columns"]["time"] = {"column": "t", "unit": "iso8601"}
    plain = reobserve.estimate(tree, frame).frame
    assert plain["time"].dtype == "datetime64[us]"
    berlin = reobserve.estimate(tree, frame.assign(t=frame["t"].dt.tz_localize("Europe/Berlin")))
    assert str(berlin.frame["time"].dtype) == "datetime64[us, Europe/Berlin]"
    assert np.array_equal(berlin.frame.iloc[:, 1], plain.iloc[:, 1])
    tree["columns"]["time"] = {"column": "t", "unit": "ms"}
    assert refused(frame, tree) == said
    # Without a zone, clocks that are put forward are refused as in a file.
    spring = frame.assign(t=frame["t"] - frame["t"].iloc[0] + pd.Timestamp("2026-03-29T01:59:59.9"))
    spring.loc[10:, "t"] += pd.Timedelta(hours=1)
    tree["columns"]["time"] = {"column": "t", "unit": "iso8601"}
    tree["sampling"] |= {"at_gap": "refuse"}
    spring.to_csv(tmp_path / "r.csv", index=False, date_format="%Y-%m-%dT%H:%M:%S.%f")
    by_file = refused(tmp_path / "r.csv", tree).replace(str(tmp_path / "r.csv"), "the frame")
    assert refused(spring, tree) == by_file.replace("line 12", "row 11")
    assert "zone" in by_file


@pytest.mark.parametrize("given", [None, 3, [1], b"log.yaml"])
def test_what_is_no_specification_or_record_is_refused(given: Any) -> None:
    with pytest.raises(InputError, match=r"^specification: is .*, must be the path"):
        reobserve.estimate(given, pd.DataFrame())
    with pytest.raises(InputError, match=r"^data: is .*, must be a path, an open file or a Data"):
        reobserve.estimate(specification("kalman"), given)


def test_mapping_may_hold_arrays_and_stays_as_it_is() -> None:
    tree: Any = parse_yaml(specification_text("kalman"), "kalman")
    tree["observer"]["A"] = np.array(tree["observer"]["A"])
    tree["columns"]["measurements"] = tuple(tree["columns"]["measurements"])
    before = repr(tree)
    columns = {title: values[:50] for title, values in simulated("kalman").record().items()}
    found = reobserve.estimate(tree, pd.DataFrame(columns)).frame
    expected = reobserve.estimate(specification("kalman"), pd.DataFrame(columns)).frame
    pd.testing.assert_frame_equal(found, expected, check_exact=True)
    assert repr(tree) == before
    with pytest.raises(InputError, match=r"^specification\.sampling\.period: nan must be"):
        reobserve.estimate({**tree, "sampling": {"period": np.nan}}, pd.DataFrame(columns))
    with pytest.raises(InputError, match=r"^sampling\.perod: unknown key; did you mean 'period'"):
        reobserve.estimate({**tree, "sampling": {"perod": 1.0}}, pd.DataFrame(columns))
    with pytest.raises(InputError, match=r"none\.yaml: "):
        reobserve.estimate(Path("none.yaml"), pd.DataFrame(columns))
    assert read_yaml(ROOT / "examples/logs/bias.yaml")["observer"]["kind"] == "augmented-kalman"
