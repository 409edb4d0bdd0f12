"""Local times, dates in two columns, epochs and repeated timestamps, in files and streams alike."""

from __future__ import annotations

from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo

import numpy as np
import pyarrow as pa
import pyarrow.parquet as parquet
import pytest

from reobserve.core.errors import InputError
from reobserve.core.validation import parse
from reobserve.estimation.data_report import DataReport
from reobserve.estimation.dates import check_format, time_zone
from reobserve.estimation.estimate import Estimation
from reobserve.estimation.estimate_command import estimate_file
from reobserve.estimation.row_by_row import RowByRow
from reobserve.estimation.specification import Specification
from reobserve.estimation.state_file import load_state, save_state
from reobserve.estimation.writing import header

OBSERVER = {
    "kind": "kalman", "time": "discrete", "states": {"x": "V"}, "measurements": {"x": "V"},
    "A": [[1.0]], "C": [[1.0]], "Q": 0.1, "R": 0.1, "initial_state": [0.0],
    "initial_covariance": 100.0,
}  # fmt: skip


def chosen(time: dict[str, Any], **sampling: Any) -> Specification:
    columns = {"time": time, "measurements": [{"column": "y"}]}
    return parse(Specification, {"observer": OBSERVER, "columns": columns, "sampling": sampling})


def estimated(
    stated: Specification, times: list[str], tmp_path: Path, titles: str = "t"
) -> DataReport:
    """The report on a file, whose results a stream must have too, however often it is resumed."""
    record = tmp_path / "r.csv"
    lines = [f"{stamp},{np.sin(0.1 * k):.6f}\n" for k, stamp in enumerate(times)]
    record.write_text(f"{titles},y\n" + "".join(lines))
    made = estimate_file(stated, record, tmp_path / "e.csv", block=500)
    expected = (tmp_path / "e.csv").read_text()
    columns = [*titles.split(","), "y"]
    estimation = Estimation(stated, columns, "r.csv")
    rows, out = RowByRow(estimation, columns), header(estimation.titles)
    for k, line in enumerate(lines):
        if k % 7 == 3:
            rows.settle()
            save_state(tmp_path / "s.json", estimation, "it", None)
            estimation = Estimation(stated, columns, "r.csv")
            load_state(tmp_path / "s.json", estimation, "it")
            rows = RowByRow(estimation, columns)
        out += rows.read(line)
    assert out + rows.finish() == expected
    return made.report


def local(zone: str, start: datetime, step: float, rows: int) -> list[str]:
    """Times on a clock, without an offset."""
    moments = [start.replace(tzinfo=UTC) + timedelta(seconds=step * k) for k in range(rows)]
    return [str(one.astimezone(ZoneInfo(zone)).replace(tzinfo=None)) for one in moments]


CHANGES = {
    "spring": ("Europe/Berlin", datetime(2024, 3, 31, 0, 30)),
    "autumn": ("Europe/Berlin", datetime(2024, 10, 26, 23, 30)),
    "spring in New York": ("America/New_York", datetime(2024, 3, 10, 5, 30)),
    "autumn in New York": ("America/New_York", datetime(2024, 11, 3, 4, 30)),
    "half an hour in autumn": ("Australia/Lord_Howe", datetime(2024, 4, 6, 14, 15)),
}


@pytest.mark.nightly_cases("spring-30.0", "spring in New York-30.0", "autumn in New York-30.0")
@pytest.mark.parametrize("step", [1800.0, 600.0, 60.0, 30.0])
@pytest.mark.parametrize("change", CHANGES)
def test_clock_changes_lose_no_row(change: str, step: float, tmp_path: Path) -> None:
    zone, start = CHANGES[change]
    rows = int(4 * 3600 / step)
    times = local(zone, start, step, rows)
    stated = chosen({"column": "t", "unit": "iso8601", "zone": zone}, period=step)
    report = estimated(stated, times, tmp_path)
    assert (report.statuses, report.lost) == ({"measured": rows}, 0)
    assert not any("occur twice" in warning for warning in report.warnings)
    assert report.origin == start.replace(tzinfo=UTC).timestamp()
    assert report.last == step * (rows - 1)


def test_hourly_times_stand_still_in_autumn(tmp_path: Path) -> None:
    times = local("Europe/Berlin", datetime(2024, 10, 26, 20), 3600.0, 12)
    assert times[4] == times[5] == "2024-10-27 02:00:00"
    stated = chosen({"column": "t", "unit": "iso8601", "zone": "Europe/Berlin"}, period=3600)
    assert estimated(stated, times, tmp_path).statuses == {"measured": 12}


def test_record_that_begins_in_the_hour_that_occurs_twice_is_warned_of(tmp_path: Path) -> None:
    stated = chosen({"column": "t", "unit": "iso8601", "zone": "Europe/Berlin"}, period=600)
    times = local("Europe/Berlin", datetime(2024, 10, 27, 0, 10), 600.0, 20)
    report = estimated(stated, times, tmp_path)
    assert report.statuses == {"measured": 20}
    assert report.warnings[:1] == [
        "in Europe/Berlin, times about 2024-10-27 02:00 occur twice, and the record does not say "
        "which is meant: the first is assumed"
    ]


def test_time_that_clocks_skip_is_refused(tmp_path: Path) -> None:
    stated = chosen({"column": "t", "unit": "iso8601", "zone": "Europe/Berlin"}, period=600)
    times = [f"2024-03-31 01:{10 * k}:00" for k in range(1, 6)] + ["2024-03-31 02:00:00"]
    said = r"line 7 of column 't' is '2024-03-31 02:00:00', which clocks in Europe/Berlin skip$"
    with pytest.raises(InputError, match=said):
        estimated(stated, times, tmp_path)


@pytest.mark.parametrize("zone", ["Europe/Berlin", "Europe/London", "America/New_York"])
@pytest.mark.parametrize("step", [3600.0, 300.0, 60.0])
def test_missing_hour_asks_for_the_zone(zone: str, step: float, tmp_path: Path) -> None:
    start = next(when for name, when in CHANGES.values() if name == zone) if (
        zone != "Europe/London"
    ) else CHANGES["spring"][1]  # fmt: skip
    rows = max(int(3 * 3600 / step), 6)
    start = start.replace(minute=0) - timedelta(hours=1 if step == 3600.0 else 0)
    times = local(zone, start, step, rows)
    policies = {"period": step, "missing": "skip", "at_gap": "coast", "gap": 2 * 3600}
    said = rf"columns.time.zone: is missing: line \d+ .* an hour late, .* forward in {zone}; state"
    with pytest.raises(InputError, match=said):
        estimated(chosen({"column": "t", "unit": "iso8601"}, **policies), times, tmp_path)
    stated = chosen({"column": "t", "unit": "iso8601", "zone": "UTC"}, **policies)
    assert estimated(stated, times, tmp_path).statuses["predicted"] == round(3600 / step)
    stated = chosen({"column": "t", "unit": "iso8601", "zone": zone}, **policies)
    assert estimated(stated, times, tmp_path).statuses == {"measured": rows}


def test_other_missing_hours_are_gaps(tmp_path: Path) -> None:
    times = local("UTC", datetime(2024, 3, 31, 0), 300.0, 24)
    times += local("UTC", datetime(2024, 3, 31, 6), 300.0, 24)[:-1]
    again = [
        *times[:24],
        *local("UTC", datetime(2024, 3, 31, 2, 55) + timedelta(hours=1), 300.0, 9),
    ]
    policies = {"period": 300, "missing": "skip", "gap": 86400}
    report = estimated(chosen({"column": "t", "unit": "iso8601"}, **policies), times, tmp_path)
    assert report.statuses["predicted"] == 48
    report = estimated(chosen({"column": "t", "unit": "iso8601"}, **policies), again, tmp_path)
    assert report.statuses["predicted"] == 23


def test_zone_may_be_an_offset_and_gives_way_to_one_in_the_cell(tmp_path: Path) -> None:
    times = [f"2024-03-31 02:0{k}:00" for k in range(8)]
    stated = chosen({"column": "t", "unit": "iso8601", "zone": "+01:00"}, period=60)
    assert (
        estimated(stated, times, tmp_path).origin
        == datetime(2024, 3, 31, 1, tzinfo=UTC).timestamp()
    )
    stated = chosen({"column": "t", "unit": "iso8601", "zone": "Europe/Berlin"}, period=60)
    report = estimated(stated, [f"{stamp}-05:00" for stamp in times], tmp_path)
    assert report.origin == datetime(2024, 3, 31, 7, tzinfo=UTC).timestamp()


@pytest.mark.parametrize("zone", ["Europe/Nowhere", "Europe", "UTC+1", "../etc", "25:00", "+99:00"])
def test_unknown_zone_is_refused(zone: str) -> None:
    with pytest.raises(
        InputError, match=r"columns\.time\.zone: .* must be a time zone, as Europe/"
    ):
        chosen({"column": "t", "unit": "iso8601", "zone": zone}, period=1)


def test_zone_is_for_dates(tmp_path: Path) -> None:
    stated = chosen({"column": "t", "unit": "s", "zone": "UTC"}, period=1)
    with pytest.raises(InputError, match=r"columns\.time\.zone: UTC is for dates"):
        estimated(stated, ["0", "1"], tmp_path)


def test_format_may_have_an_offset(tmp_path: Path) -> None:
    time = {"column": "t", "format": "%d.%m.%Y %H:%M:%S %z", "zone": "America/New_York"}
    times = [f"14.03.2024 10:00:{k:02d} {'+0100' if k % 2 else '+01:00'}" for k in range(30)]
    report = estimated(chosen(time, period=1), times, tmp_path)
    assert report.origin == datetime(2024, 3, 14, 9, tzinfo=UTC).timestamp()
    check_format("format", "%Y-%m-%dT%H:%M:%S.%f%z")
    assert time_zone("+05:30").utcoffset(None) == timedelta(hours=5.5)


@pytest.mark.parametrize("form", ["", "%d.%m.%Y", "%Y%m%d"])
def test_dates_of_days_are_read(form: str, tmp_path: Path) -> None:
    days = [date(2024, 2, 1) + timedelta(days=k) for k in range(60)]
    times = [day.strftime(form or "%Y-%m-%d") for day in days]
    time = {"column": "t", "format": form} if form else {"column": "t", "unit": "iso8601"}
    report = estimated(chosen(time, period=86400), times, tmp_path)
    assert report.statuses == {"measured": 60}
    parquet.write_table(pa.table({"t": days, "y": np.zeros(60)}), tmp_path / "r.parquet")
    made = estimate_file(
        chosen({"column": "t", "unit": "iso8601"}, period=86400), tmp_path / "r.parquet",
        tmp_path / "e.csv",
    )  # fmt: skip
    assert (made.report.origin, made.report.last) == (report.origin, report.last)


@pytest.mark.parametrize("change", ["spring", "autumn"])
def test_parquet_dates_without_an_offset_have_the_zone(change: str, tmp_path: Path) -> None:
    zone, start = CHANGES[change]
    times = [datetime.fromisoformat(stamp) for stamp in local(zone, start, 600.0, 24)]
    parquet.write_table(
        pa.table({"t": pa.array(times, pa.timestamp("ns")), "y": np.zeros(24)}),
        tmp_path / "r.parquet",
    )
    stated = chosen({"column": "t", "unit": "iso8601", "zone": zone}, period=600)
    made = estimate_file(stated, tmp_path / "r.parquet", tmp_path / "e.csv")
    assert made.report.statuses == {"measured": 24}


@pytest.mark.parametrize("form", ["", "%d.%m.%Y %H:%M:%S"])
def test_date_and_time_may_be_in_two_columns(form: str, tmp_path: Path) -> None:
    start = datetime(2023, 12, 10, 23, 55)
    moments = [start + timedelta(minutes=k) for k in range(20) if k not in (7, 8)]
    times = [m.strftime("%d.%m.%Y,%H:%M:%S" if form else "%Y-%m-%d,%H:%M:%S") for m in moments]
    time = {"column": ["Date", "Time"], "format": form, "unit": "" if form else "iso8601"}
    stated = chosen(time, period=60, missing="skip")
    report = estimated(stated, times, tmp_path, "Date,Time")
    assert report.statuses == {"measured": 18, "predicted": 2}
    stated = chosen(time, period=60, missing="skip", uneven="previous")
    report = estimated(
        stated, [*times[:-1], f"{times[-1].partition(',')[0]},"], tmp_path, "Date,Time"
    )
    assert report.unstamped == 1


def test_two_columns_are_for_dates(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"columns\.time\.column: several columns are for dates"):
        estimated(chosen({"column": ["a", "b"]}, period=1), ["0,1"], tmp_path, "a,b")
    with pytest.raises(InputError, match=r"columns\.time\.column: takes the column 'a' a second"):
        chosen({"column": ["a", "a"], "unit": "iso8601"}, period=1)
    for column in (["a"], list("abcdefgh"), 3):
        with pytest.raises(InputError, match=r"^columns\.time\.column"):
            chosen({"column": column, "unit": "iso8601"}, period=1)


@pytest.mark.parametrize(
    ("unit", "ticks", "rate"),
    [
        ("us", 10**6, 10_000), ("us", 10**6, 1_000_000), ("ns", 10**9, 10_000_000),
        ("ns", 10**9, 44_100), ("ms", 10**3, 1000), ("s", 1, 10_000), ("day", 1 / 86400, 10),
    ],
)  # fmt: skip
def test_epochs_of_any_rate_are_those_from_zero(
    unit: str, ticks: float, rate: int, tmp_path: Path
) -> None:
    def times(second: int) -> list[str]:
        if unit == "s":
            return [f"{second}.{100 * k:06d}" for k in range(50)]
        if unit == "day":
            return [repr(second // 86400 + k / (86400 * rate)) for k in range(50)]
        return [str(second * int(ticks) + round(k * ticks / rate)) for k in range(50)]

    stated = chosen({"column": "t", "unit": unit}, period=1.0 / rate)
    estimated(stated, times(0), tmp_path)
    expected = [line.split(",") for line in (tmp_path / "e.csv").read_text().splitlines()[1:]]
    report = estimated(stated, times(1774745996 if unit != "day" else 86400 * 45000), tmp_path)
    found = [line.split(",") for line in (tmp_path / "e.csv").read_text().splitlines()[1:]]
    assert report.statuses == {"measured": 50}
    if unit == "day":  # which has digits for a hundredth of a period
        return
    assert [row[1:] for row in found] == [row[1:] for row in expected]
    for row, other in zip(found, expected, strict=True):
        second, _, digits = row[0].partition(".")
        assert second == "1774745996"
        assert float(f"0.{digits}") == pytest.approx(float(other[0]), abs=1e-10)
    assert len({row[0] for row in found}) == 50


def test_epochs_in_parquet_keep_their_digits(tmp_path: Path) -> None:
    times = 1774745996 * 10**9 + 100 * np.arange(50)
    parquet.write_table(pa.table({"t": times, "y": np.zeros(50)}), tmp_path / "r.parquet")
    stated = chosen({"column": "t", "unit": "ns"}, period=1e-7)
    made = estimate_file(
        stated, tmp_path / "r.parquet", tmp_path / "e.csv", report=tmp_path / "j.json"
    )
    assert made.report.statuses == {"measured": 50}
    assert (tmp_path / "e.csv").read_text().splitlines()[2].startswith("1774745996.0000001,")
    assert '"first": 1774745996.0' in (tmp_path / "j.json").read_text()


WHOLE = [f"2024-03-14T10:00:{k // 10:02d}" for k in range(3, 296)]  # at 10 Hz, from 0.3 s on


@pytest.mark.parametrize("uneven", ["refuse", "linear"])
def test_timestamps_of_whole_seconds_are_spread(uneven: str, tmp_path: Path) -> None:
    time = {"column": "t", "unit": "iso8601"}
    stated = chosen(time, period=0.1, repeated="spread", uneven=uneven)
    report = estimated(stated, WHOLE, tmp_path)
    assert report.statuses == {"measured": 293}
    assert report.warnings[0] == (
        "time: 263 of 293 rows have the timestamp of the row before, and were spread evenly"
    )
    assert [report.first, report.last] == pytest.approx([0.3, 29.5])


def test_repeated_timestamps_are_refused_or_left_out_by_policy(tmp_path: Path) -> None:
    time = {"column": "t", "unit": "iso8601"}
    for uneven in ("refuse", "linear"):
        with pytest.raises(
            InputError, match=r"stands still, .* sampling\.repeated may be first, last,"
        ):
            estimated(chosen(time, period=0.1, uneven=uneven), WHOLE, tmp_path)
    for repeated, other in (("first", "before"), ("last", "after")):
        report = estimated(chosen(time, period=1, repeated=repeated), WHOLE, tmp_path)
        assert (report.estimates, report.repeated) == (30, 263)
        assert report.warnings[0].endswith(
            f"rows have the timestamp of the row {other}, and were left out"
        )


def test_pause_is_not_filled_by_spreading(tmp_path: Path) -> None:
    """Nor are rows put closer together than they were taken."""
    times = [*["0"] * 10, *["1"] * 10, *["60"] * 10, *["61"] * 5]
    stated = chosen(
        {"column": "t"}, period=0.1, repeated="spread", missing="skip", at_gap="restart"
    )
    report = estimated(stated, times, tmp_path)
    assert report.gaps == [[pytest.approx(1.9), 60.0]]
    assert report.last == pytest.approx(61.4)


@pytest.mark.nightly_after(4)
@pytest.mark.parametrize("method", ["linear", "pchip", "previous"])
@pytest.mark.parametrize(
    ("rate", "period"),
    [(100, 0.03), (100, 1 / 33), (100, 0.01), (1000, 0.01), (30, 0.1), (48000, 1 / 44100)],
)
def test_resampled_rows_are_measured_at_any_ratio_of_rates(
    method: str, rate: int, period: float, tmp_path: Path
) -> None:
    times = [repr(k / rate) for k in range(600)]
    stated = chosen({"column": "t"}, period=period, uneven=method)
    report = estimated(stated, times, tmp_path)
    if period >= 1 / rate:
        assert report.statuses == {"measured": int(599 / rate / period + 1e-6) + 1}
    lower = period > 1.5 / rate
    said = "are resampled to one every"
    assert any(said in warning for warning in report.warnings) == lower


@pytest.mark.parametrize("method", ["linear", "pchip"])
def test_resampled_rows_in_a_gap_are_filled(method: str, tmp_path: Path) -> None:
    """Of 100 rows at 100 Hz, those from 0.405 s to 0.605 s are lost."""
    jitter = np.random.default_rng(2).uniform(-0.002, 0.002, 100)
    times = [f"{0.01 * k + jitter[k]:.6f}" for k in range(100) if not 41 <= k <= 60]
    stated = chosen({"column": "t"}, period=0.01, uneven=method, missing="interpolate", gap=0.5)
    report = estimated(stated, times, tmp_path)
    assert report.statuses["filled"] == 20
    assert report.filled == {"y": 20}


def test_rows_of_a_slower_sensor_are_filled_between_its_samples(tmp_path: Path) -> None:
    stated = chosen({"column": "t"}, period=0.1, uneven="linear", missing="interpolate")
    report = estimated(stated, [repr(0.5 * k) for k in range(20)], tmp_path)
    assert report.statuses == {"measured": 20, "filled": 76}


@pytest.mark.parametrize(("period", "rows"), [(0.1, 15), (0.1, 300)])
def test_disagreeing_period_names_resampling(period: float, rows: int, tmp_path: Path) -> None:
    """The timestamps of two sensors in one file."""
    seconds = sorted(
        [0.0057 + 0.1 * k for k in range(rows)] + [0.0223 + 0.3 * k for k in range(rows // 3)]
    )
    times = [f"{time:.4f}" for time in seconds]
    said = r"sampling\.uneven: linear, previous or pchip resamples them"
    with pytest.raises(InputError, match=said):
        estimated(chosen({"column": "t"}, period=period), times, tmp_path)
    stated = chosen({"column": "t"}, period=period, uneven="linear")
    assert estimated(stated, times, tmp_path).statuses == {"measured": rows}


@pytest.mark.parametrize("zone", ["", "Europe/Berlin"])
@pytest.mark.parametrize("form", ["%H:%M:%S", "%I:%M:%S %p"])
def test_times_of_day_go_on_after_midnight(form: str, zone: str, tmp_path: Path) -> None:
    """As the dates of the same record, also over the night in which clocks are put forward."""
    start = datetime(2024, 3, 30, 22, 0)
    ticks = [start + timedelta(minutes=20 * k) for k in range(200)]
    if zone:
        utc = start.replace(tzinfo=ZoneInfo(zone)).astimezone(UTC)
        ticks = [(utc + timedelta(minutes=20 * k)).astimezone(ZoneInfo(zone)) for k in range(200)]
    stated = {"column": "t", "format": form, "day": "2024-03-30", "zone": zone}
    found = estimated(chosen(stated, period=1200), [t.strftime(form) for t in ticks], tmp_path)
    dates = {"column": "t", "format": "%Y-%m-%d %H:%M:%S", "zone": zone}
    texts = [t.strftime("%Y-%m-%d %H:%M:%S") for t in ticks]
    wanted = estimated(chosen(dates, period=1200), texts, tmp_path)
    assert (found.origin, found.last, found.statuses) == (
        wanted.origin, wanted.last, {"measured": 200},
    )  # fmt: skip


@pytest.mark.nightly_cases("4294967296-us-100000")
@pytest.mark.parametrize(("wrap", "unit", "tick"), [(65536, "ms", 100), (2**32, "us", 100_000)])
def test_counter_that_begins_again_goes_on(wrap: int, unit: str, tick: int, tmp_path: Path) -> None:
    stated = {"column": "t", "unit": unit, "wrap": wrap}
    times = [str((wrap - 1500 * tick // 100 + tick * k) % wrap) for k in range(3000)]
    report = estimated(chosen(stated, period=0.1), times, tmp_path)
    assert report.statuses == {"measured": 3000}
    assert report.first is not None
    assert report.last == pytest.approx(report.first + 299.9, abs=1e-9)
    with pytest.raises(InputError, match=r"goes back.*columns\.time\.wrap states its period"):
        estimated(chosen({"column": "t", "unit": unit}, period=0.1), times, tmp_path)


def test_days_and_wraps_are_refused_where_they_mean_nothing() -> None:
    for key, stated in {
        "day: '2024-13-01' must be a day": {"format": "%H:%M", "day": "2024-13-01"},
        "day: is for a format of times": {"format": "%d.%m.%Y %H:%M", "day": "2024-03-01"},
        "day: is for a format": {"unit": "iso8601", "day": "2024-03-01"},
        "format: .* columns.time.day states the first day": {"format": "%H:%M:%S"},
        "wrap: is for counters": {"unit": "iso8601", "wrap": 100},
    }.items():
        with pytest.raises(InputError, match=rf"columns\.time\.{key}"):
            chosen({"column": "t", **stated}, period=1)


def test_time_shortly_before_midnight_is_not_a_day_later(tmp_path: Path) -> None:
    times = ["23:59:58", "23:59:59", "00:00:00", "00:00:01", "23:59:59", "00:00:03"]
    stated = {"column": "t", "format": "%H:%M:%S", "day": "2024-03-30"}
    policies = {"period": 1, "missing": "skip", "at_gap": "coast"}
    with pytest.raises(InputError, match=r"line 6.*goes back, at 2024-03-30T23:59:59"):
        estimated(chosen(stated, **policies), times, tmp_path)


def test_counter_beyond_its_period_is_refused(tmp_path: Path) -> None:
    stated = chosen({"column": "t", "unit": "ms", "wrap": 300}, period=0.1)
    with pytest.raises(InputError, match=r"wrap: 300 must be above 300, as line 5 has"):
        estimated(stated, ["0", "100", "200", "300", "400", "500"], tmp_path)
