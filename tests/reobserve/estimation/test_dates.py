"""Timestamps given as dates: bitwise identical to seconds, for any offset from UTC."""

from __future__ import annotations

import json
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as parquet
import pytest

from reobserve.core.errors import InputError
from reobserve.estimation.clock import Dates
from reobserve.estimation.data_report import DataReport
from reobserve.estimation.dates import spelled
from reobserve.estimation.estimate import Estimation
from reobserve.estimation.estimate_command import estimate_file
from reobserve.estimation.row_by_row import RowByRow
from reobserve.estimation.specification import Specification
from reobserve.estimation.state_file import load_state, save_state
from reobserve.estimation.writing import header
from tests.reobserve.estimation.records import specification

PERIOD = 0.01  # [s]
START = datetime(2026, 3, 29, 0, 59, 58, 580_000, tzinfo=UTC)
ROWS = 200
VALUES = np.sin(np.arange(ROWS) / 10)
CHANGE = (
    timezone(timedelta(hours=2)),
    timezone(timedelta(hours=1)),
)  # of clock changes, after 1.42 s


def chosen(unit: str) -> Specification:
    columns = {"time": {"column": "t", "unit": unit}, "measurements": [{"column": "v"}]}
    sampling = {"period": PERIOD, "missing": "interpolate", "gap": 0.1, "at_gap": "restart"}
    return specification("levant", columns=columns, sampling=sampling)


def moments() -> list[datetime]:
    return [START + timedelta(milliseconds=10 * k) for k in range(ROWS) if not 100 <= k < 120]


def rows(timestamps: list[str]) -> list[str]:
    places = [k for k in range(ROWS) if not 100 <= k < 120]
    return [f"{text},{float(VALUES[k])!r}\n" for text, k in zip(timestamps, places, strict=True)]


def local(moment: datetime) -> str:
    summer, winter = CHANGE
    return moment.astimezone(summer if moment.hour >= 1 else winter).isoformat()


SPELLINGS = {
    "UTC": [moment.isoformat().replace("+00:00", "Z") for moment in moments()],
    "naive": [f'"{moment.replace(tzinfo=None)}"' for moment in moments()],
    "summer time comes": [local(moment) for moment in moments()],
}


def in_seconds(results: str) -> str:
    """Results with seconds in the place of dates, for a comparison with those of seconds."""
    second = START.replace(microsecond=0)
    title, *lines = results.splitlines(keepends=True)
    assert title.startswith("time,")
    found = [title.replace("time", "time [s]", 1)]
    for line in lines:
        stamp, rest = line.split(",", 1)
        date = datetime.fromisoformat(stamp)
        date = date if date.tzinfo else date.replace(tzinfo=UTC)
        found.append(f"{(date - second).total_seconds()!r},{rest}")
    return "".join(found)


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> str:
    folder = tmp_path_factory.mktemp("seconds")
    second = START.replace(microsecond=0)
    timestamps = [repr((moment - second).total_seconds()) for moment in moments()]
    (folder / "r.csv").write_text("t,v\n" + "".join(rows(timestamps)))
    estimate_file(chosen("s"), folder / "r.csv", folder / "e.csv")
    title, *lines = (folder / "e.csv").read_text().splitlines(keepends=True)
    cells = [line.split(",", 1) for line in lines]  # which dates have to a microsecond
    return title + "".join(f"{round(float(time), 6)!r},{rest}" for time, rest in cells)


@pytest.mark.parametrize("spelling", SPELLINGS)
def test_dates_and_seconds_give_bitwise_identical_results(
    spelling: str, expected: str, tmp_path: Path
) -> None:
    (tmp_path / "r.csv").write_text("t,v\n" + "".join(rows(SPELLINGS[spelling])))
    made = estimate_file(
        chosen("iso8601"), tmp_path / "r.csv", tmp_path / "e.csv", report=tmp_path / "r.json",
        block=1000,
    )  # fmt: skip
    results = (tmp_path / "e.csv").read_text()
    assert in_seconds(results) == expected
    first = {
        "UTC": "2026-03-29T00:59:58.580000Z", "naive": "2026-03-29T00:59:58.580000",
        "summer time comes": "2026-03-29T01:59:58.580000+01:00",
    }  # fmt: skip
    assert results.splitlines()[1].startswith(first[spelling] + ",")
    assert made.report.first == 0.58
    assert made.report.jitter < 1e-12
    assert json.loads((tmp_path / "r.json").read_text())["first"] == first[spelling]


@pytest.mark.parametrize("kind", ["timestamps", "texts"])
def test_parquet_dates_are_read(kind: str, expected: str, tmp_path: Path) -> None:
    places = [k for k in range(ROWS) if not 100 <= k < 120]
    timestamps = pa.array(moments()) if kind == "timestamps" else pa.array(SPELLINGS["UTC"])
    table = pa.table({"t": timestamps, "v": VALUES[places]})
    parquet.write_table(table, tmp_path / "r.parquet")
    estimate_file(chosen("iso8601"), tmp_path / "r.parquet", tmp_path / "e.csv")
    assert in_seconds((tmp_path / "e.csv").read_text()) == expected


def test_stream_of_dates_can_be_resumed(expected: str, tmp_path: Path) -> None:
    estimation = Estimation(chosen("iso8601"), ["t", "v"], "r")
    reader, out = RowByRow(estimation, ["t", "v"]), header(estimation.titles)
    for k, line in enumerate(rows(SPELLINGS["summer time comes"])):
        if k == 60:
            reader.settle()
            save_state(tmp_path / "s.json", estimation, "it", None)
            estimation = Estimation(chosen("iso8601"), ["t", "v"], "r")
            load_state(tmp_path / "s.json", estimation, "it")
            reader = RowByRow(estimation, ["t", "v"])
        out += reader.read(line)
    assert in_seconds(out + reader.finish()) == expected


@pytest.mark.parametrize("unit", ["Z", "", "+01:00"])
def test_thresholds_are_learned_between_dates(unit: str, tmp_path: Path) -> None:
    """As between seconds after the first estimate."""
    (tmp_path / "r.csv").write_text("t,v\n" + "".join(rows(SPELLINGS["UTC"])))
    hour = START + timedelta(hours=unit == "+01:00")
    dates = [
        f"{(hour + timedelta(seconds=past)).replace(tzinfo=None).isoformat()}{unit}"
        for past in (0.2, 0.7)
    ]
    found = []
    for since, until in ((0.2, 0.7), dates):
        alarms = [{"name": "odd", "of": "residual v", "sigma": 1.0, "since": since, "until": until}]
        stated = specification(
            "levant", columns={"time": {"column": "t", "unit": "iso8601"},
                               "measurements": [{"column": "v"}]},
            sampling={"period": PERIOD, "missing": "interpolate", "gap": 0.1, "at_gap": "restart"},
            alarms=alarms,
        )  # fmt: skip
        made = estimate_file(stated, tmp_path / "r.csv", tmp_path / "e.csv")
        found.append(((tmp_path / "e.csv").read_bytes(), made.report.alarms["odd"].learned))
    assert found[0] == found[1]
    assert found[0][1] > 20


@pytest.mark.parametrize("zone", [None, "UTC", "Europe/Berlin"])
def test_parquet_results_have_dates(zone: str | None, tmp_path: Path) -> None:
    """Pandas joins them to the record by its own timestamps."""
    wanted = pd.DatetimeIndex(moments()).tz_convert(zone)
    frame = pd.DataFrame({"t": wanted, "v": VALUES[: len(wanted)]})
    frame.to_parquet(tmp_path / "r.parquet")
    estimate_file(chosen("iso8601"), tmp_path / "r.parquet", tmp_path / "e.parquet")
    results = pd.read_parquet(tmp_path / "e.parquet")
    joined = frame.merge(results, left_on="t", right_on="time")
    assert len(joined) == len(frame)
    assert str(results["time"].dt.tz) == str(zone)
    joined = pd.merge_asof(frame, results, left_on="t", right_on="time")
    assert (joined["t"] == joined["time"]).all()


def test_header_may_declare_dates(expected: str, tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text("t [iso8601],v\n" + "".join(rows(SPELLINGS["UTC"])))
    estimate_file(chosen(""), tmp_path / "r.csv", tmp_path / "e.csv")
    assert in_seconds((tmp_path / "e.csv").read_text()) == expected


@pytest.mark.parametrize(
    "cell", ["12.5", "yesterday", "2026-02-30T00:00:00Z", "99999-01-01", "20260329"]
)
def test_invalid_date_is_refused(cell: str, tmp_path: Path) -> None:
    timestamps = SPELLINGS["UTC"][:30]
    text = "t,v\n" + "".join(f"{timestamp},1.0\n" for timestamp in [*timestamps, cell])
    (tmp_path / "r.csv").write_text(text)
    problem = (
        f"line 32 of column 't' is '{cell}', must be a date with a time, as 2026-03-29T01:59:58Z"
    )
    with pytest.raises(InputError, match=problem):
        estimate_file(chosen("iso8601"), tmp_path / "r.csv", tmp_path / "e.csv")
    assert not (tmp_path / "e.csv").exists()
    reader = RowByRow(Estimation(chosen("iso8601"), ["t", "v"], "r"), ["t", "v"])
    *good, bad = text.splitlines()[1:]
    for line in good:
        reader.read(line)
    with pytest.raises(InputError, match=problem):
        reader.read(bad)


def test_dates_at_50_khz_are_evenly_spaced() -> None:
    report = DataReport()
    moments = [START + timedelta(microseconds=20 * k) for k in range(1000)]
    times = [report.clock(Dates().nanoseconds(one.isoformat(), report)) for one in moments]
    assert times == [(580_000 + 20 * k) / 1e6 for k in range(1000)]
    assert report.clock(None) != report.clock(None)  # nan


def test_epoch_nanoseconds_are_read() -> None:
    for text, expected in (
        ("1970-01-02T00:00:00.5+00:00", 86_400_500_000_000),
        ("20000101T010000+0100", 946_684_800 * 10**9),  # by `date -d ... +%s`
    ):
        assert Dates().nanoseconds(text, DataReport()) == expected
    assert spelled(946_684_800 * 10**9) == "2000-01-01T00:00:00Z"
    assert spelled(946_684_800 * 10**9, "+05:30", 6) == "2000-01-01T05:30:00.000000+05:30"
    assert spelled(946_684_800 * 10**9 + 1, "", 9) == "2000-01-01T00:00:00.000000001"


def test_missing_time_unit_is_reported(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text("t,v\n0.5,1.0\n" + "".join(rows(SPELLINGS["UTC"])))
    with pytest.raises(
        InputError, match=r"line 3 of column 't' is '2026-.*Z', must be a number; of dates the un"
    ):
        estimate_file(chosen("s"), tmp_path / "r.csv", tmp_path / "e.csv")
    reader = RowByRow(Estimation(chosen("s"), ["t", "v"], "r"), ["t", "v"])
    with pytest.raises(
        InputError, match=r"line 2 of column 't' is '2026-.*Z', must be a number; of dates the un"
    ):
        reader.read(rows(SPELLINGS["UTC"])[0])
    table = pa.table({"t": pa.array(moments()), "v": np.zeros(len(moments()))})
    parquet.write_table(table, tmp_path / "r.parquet")
    with pytest.raises(InputError, match=r"'t' holds dates; as timestamps their unit is iso8601"):
        estimate_file(chosen("ms"), tmp_path / "r.parquet", tmp_path / "e.csv")


def test_clock_running_backwards_is_reported(tmp_path: Path) -> None:
    timestamps = [moment.astimezone(CHANGE[moment.hour >= 1]) for moment in moments()]
    texts = [timestamp.replace(tzinfo=None).isoformat() for timestamp in timestamps]
    (tmp_path / "r.csv").write_text("t,v\n" + "".join(rows(texts)))
    with pytest.raises(
        InputError, match=r"line 124: the timestamp goes back, .* without an offset"
    ):
        estimate_file(chosen("iso8601"), tmp_path / "r.csv", tmp_path / "e.csv")
