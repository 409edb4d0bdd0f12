"""Columns of dates that are read and spelled at once, bitwise as one by one."""

from __future__ import annotations

import math
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as parquet
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reobserve.core.errors import InputError
from reobserve.estimation import date_columns
from reobserve.estimation.clock import Clock, Dates
from reobserve.estimation.data_report import DataReport
from reobserve.estimation.dates import moment
from reobserve.estimation.dialect import Dialect
from reobserve.estimation.file_format import FileFormat
from reobserve.estimation.quantities import SAME
from reobserve.estimation.record_file import File

START = datetime(2026, 3, 2, 14, 5, 0, 250_000)
ISO = "%Y-%m-%dT%H:%M:%S"
ZONES = ("", "UTC", "+05:30", "Europe/Berlin", "America/New_York", "Australia/Lord_Howe")


def one_by_one(texts: list[str], dates: Dates, report: DataReport) -> Any:
    """Times, or None if one of the texts is no date."""
    try:
        return np.array([dates.seconds(text, "", "r", report) for text in texts])
    except InputError:
        return None


def check(texts: list[str], form: str = "", zone: str = "", at_once: bool | None = True) -> None:
    """Both ways give bitwise identical times and the same report, or the fast one gives nothing.

    With ``at_once`` it must give something, or nothing if that is False.
    """
    ways = [(Dates(form, zone, 0.01), DataReport(period=0.01)) for _ in range(2)]
    slow = one_by_one(texts, *ways[0])
    column = pa.chunked_array([texts])
    fast = date_columns.read([column], ways[1][0], ways[1][1])
    assert at_once is None or (fast is not None) == at_once
    if fast is not None:
        assert slow is not None
        assert fast.tobytes() == slow.tobytes()
        assert ways[0] == ways[1]


FORMS = {
    "T": ISO, "blank": "%Y-%m-%d %H:%M:%S", "Z": ISO + "Z", "microseconds": ISO + ".%f",
    "offset": ISO + ".%f+02:00", "no colon": ISO + "-0330", "hours": ISO + "+05",
    "minutes": "%Y-%m-%d %H:%M", "hour": "%Y-%m-%dT%H", "nanoseconds": ISO + ".%f789Z",
}  # fmt: skip


@pytest.mark.parametrize("zone", ZONES)
@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_iso_forms_are_read_at_once(form: str, zone: str) -> None:
    check([(START + timedelta(milliseconds=10 * k)).strftime(form) for k in range(300)], "", zone)
    check([(START + timedelta(days=k)).strftime(form) for k in range(25)], "", zone)


@pytest.mark.parametrize(
    "texts",
    [
        ["2026-03-02T14:05:00Z", "2026-03-02T14:05:01"],
        ["20260302T140500Z"],
        ["2026-W10-1"],
        ["2026-03-02T14:05:00,5"],
        ["1500-01-01T00:00:00Z"],
        ["2026-02-29T14:05:00"],
        [" 2026-03-02T14:05:00Z"],
        ["2026-03-02T14:05:00Z", ""],
        ["2026-03-02T14:05:00Z", "nan"],
        ["14:05"],
        ["1700-01-01T00:00:00.000001Z", "2200-01-01T00:00:00.000001Z"],
    ],
)
def test_what_is_not_certain_is_left_to_the_slow_way(texts: list[str]) -> None:
    check(texts, at_once=False)


@pytest.mark.parametrize("quote", ["", '"'])
def test_stated_texts_that_mean_nothing_are_no_dates(quote: str, tmp_path: Path) -> None:
    texts, nothing = ["2026-03-02T14:05:00Z", "NA", "1970-01-01T00:00:00Z"], "1970-01-01T00:00:00Z"
    lines = [f"{quote}{one}{quote},{k}\n" for k, one in enumerate(texts)]
    (tmp_path / "r.csv").write_text("t,y\n" + "".join(lines), encoding="utf-8")
    clock = Clock(("t",), SAME, Dates())
    for stated, count in (((), 1), ((nothing,), 2)):
        file = File(tmp_path / "r.csv", Dialect(file=FileFormat(missing_values=stated)))
        (read,) = file.blocks(["t", "y"], clock)
        assert np.isnan(read[:, 0]).sum() == count


PIECES = st.tuples(
    st.sampled_from(["2026", "1999", "0001", "1969", "9999"]), st.sampled_from(["-", ""]),
    st.sampled_from(["03", "12", "13", "3"]), st.sampled_from(["-", ""]),
    st.sampled_from(["29", "31", "02", "2"]), st.sampled_from(["T", " ", "t", "  ", ""]),
    st.sampled_from(["00", "02", "23", "24", "7", ""]), st.sampled_from([":", ""]),
    st.sampled_from(["00", "30", "60", ""]), st.sampled_from([":", ""]),
    st.sampled_from(["00", "59", "60", "5", ""]),
    st.sampled_from(["", ".", ".5", ".25", ".123456", ".1234567", ".123456789", ".1234567891"]),
    st.sampled_from(["", "Z", "z", " Z", "+02", "+02:00", "-0330", "+24:00", "-00:00", "+01:60",
                     "+02:00:30", "UTC"]),
)  # fmt: skip


@settings(max_examples=1500, deadline=None)
@given(PIECES.map("".join), st.sampled_from(ZONES))
def test_any_text_is_read_as_the_same_date_or_left_to_the_slow_way(text: str, zone: str) -> None:
    check([text], "", zone, at_once=None)


@settings(deadline=None)
@given(
    st.lists(st.datetimes(datetime(1750, 1, 1), datetime(2200, 1, 1)), min_size=1, max_size=6),
    st.sampled_from(ZONES),
    st.sampled_from(["", "Z", "+02:00"]),
)
def test_any_dates_are_read_bitwise_the_same(dates: list[datetime], zone: str, offset: str) -> None:
    check([date.isoformat() + offset for date in dates], "", zone, at_once=None)


FORMATS = {
    "german": ("%d.%m.%Y %H:%M:%S", True), "fraction": ("%d.%m.%Y %H:%M:%S,%f", True),
    "american": ("%m/%d/%Y %H:%M", True), "alone": ("%Y%m%d%H%M%S", True),
    "day": ("%d-%m-%Y", True), "percent": ("%%%Y-%m-%d (%H:%M:%S)", True),
    "hour": ("%Y/%m/%d %H", True), "AM": ("%m/%d/%Y %I:%M %p", False),
    "month": ("%d %b %Y %H:%M:%S", False), "offset": ("%Y-%m-%d %H:%M:%S%z", False),
    "short year": ("%d.%m.%y %H:%M", False), "no minutes": ("%Y-%m-%d %H.%S", False),
}  # fmt: skip


@pytest.mark.parametrize(("form", "at_once"), FORMATS.values(), ids=FORMATS)
@pytest.mark.parametrize("zone", ZONES)
def test_formats_of_digits_are_read_at_once(form: str, at_once: bool, zone: str) -> None:
    times = [START.replace(tzinfo=UTC) + timedelta(seconds=0.7 * k) for k in range(300)]
    check([time.strftime(form) for time in times], form, zone, at_once=at_once)


# Numbers as they are, 110 for 01:10 and 5 for 5 ms, and digits beyond a microsecond.
UNPADDED = {
    "%Y %j %H%M": lambda t: f"{t:%Y} {t:%j} {int(f'{t:%H%M}')}",
    "%H%M%S.%f %d%m%y": lambda t: f"{int(f'{t:%H%M%S}')}.{t:%f} {int(f'{t:%d%m%y}')}",
    "%m/%d/%Y %H:%M:%S %f": lambda t: f"{t:%m/%d/%Y %H:%M:%S} {t.microsecond // 1000}",
    "%d.%m.%Y %H:%M:%S:%f": lambda t: f"{t:%d.%m.%Y %H:%M:%S}:{t.microsecond // 1000:03d}",
    "%I:%M:%S:%f %p, %Y-%m-%d": lambda t: f"{t:%I:%M:%S}:{t.microsecond // 1000} {t:%p, %Y-%m-%d}",
    "%Y/%m/%d %H:%M:%S.%f": lambda t: f"{t:%Y/%m/%d %H:%M:%S.%f}789",
}  # fmt: skip


@settings(deadline=None)
@given(
    st.datetimes(datetime(2000, 1, 1), datetime(2068, 1, 1)), st.sampled_from(list(UNPADDED)),
    st.integers(0, 2000),
)  # fmt: skip
def test_numbers_without_leading_zeros_are_read_as_meant(
    time: datetime, form: str, milliseconds: int
) -> None:
    times = [time.replace(microsecond=0) + timedelta(milliseconds=k) for k in (0, milliseconds)]
    whole = {"microsecond": 0} if "%f" not in form else {}
    whole |= {"second": 0} if "%S" not in form else {}
    texts = [UNPADDED[form](one) for one in times]
    assert [moment(text, form) for text in texts] == [one.replace(**whole) for one in times]
    check(texts, form, at_once=None)


@pytest.mark.parametrize(
    ("form", "text"),
    [("%d.%m.%Y %H:%M", "28.02.2024 24:00"), ("", "2024-02-28T24:00:00"),
     ("%Y %j %H%M", "2024 59 2400"), ("", "2024-02-28 24:00Z")],
)  # fmt: skip
def test_hour_24_is_midnight(form: str, text: str) -> None:
    assert moment(text, form).replace(tzinfo=None) == datetime(2024, 2, 29)
    check([text], form, at_once=False)
    with pytest.raises(ValueError, match=r"match|hour|remains"):
        moment(text.replace("24:00", "24:30").replace("2400", "2430"), form)


@pytest.mark.parametrize(
    "text", ["2.3.2026 14:05:00", "2026-03-02 14:05:00", "32.03.2026 01:00:00"]
)
def test_texts_in_another_form_are_left_to_the_slow_way(text: str) -> None:
    check(["02.03.2026 14:05:00", text], "%d.%m.%Y %H:%M:%S", at_once=False)


def test_two_columns_are_joined() -> None:
    columns = [pa.array(["2026-03-02", "2026-03-02"]), pa.array(["14:05:00.25", "14:05:00.75"])]
    report = DataReport()
    found = date_columns.read(columns, Dates(), report)
    assert found is not None
    assert found.tolist() == [0.25, 0.75]
    assert report.origin == 1_772_460_300
    assert report.latest == 1_772_460_300_750_000


def test_local_times_that_occur_twice_are_left_to_the_order_of_rows(tmp_path: Path) -> None:
    """In Berlin, clocks were put back at 01:00 of UTC on 25 October 2026."""
    begin = datetime(2026, 10, 24, 22, 30)
    moments = [
        (begin + timedelta(minutes=k + (120 if k < 150 else 60))).isoformat() for k in range(400)
    ]
    check(moments[100:200], "", "Europe/Berlin", at_once=False)
    check(moments[:90], "", "Europe/Berlin")
    record = tmp_path / "r.csv"
    record.write_text("t,y\n" + "".join(f"{moment},1.5\n" for moment in moments))
    clock = Clock(("t",), SAME, Dates("", "Europe/Berlin", 60.0))
    for block in (500, 4000, 10**6):
        report = DataReport(period=60.0)
        parts = File(record, block=block).blocks(["t", "y"], clock, report)
        times = np.concatenate([part[:, 0] for part in parts])
        assert np.array_equal(times, 60.0 * np.arange(400))
        assert report.latest == 1_792_881_000_000_000 + 399 * 60_000_000


def test_skipped_local_times_are_refused(tmp_path: Path) -> None:
    check(["2026-03-29T01:59:00", "2026-03-29T02:10:00"], "", "Europe/Berlin", at_once=False)
    table = pa.table({"t": pa.array([datetime(2026, 10, 25, 1, 30)] * 2), "y": [1.0, 2.0]})
    parquet.write_table(table, tmp_path / "r.parquet")
    clock = Clock(("t",), SAME, Dates("", "Europe/Berlin", 60.0))
    report = DataReport()
    (rows,) = File(tmp_path / "r.parquet").blocks(["t", "y"], clock, report)
    assert rows[:, 0].tolist() == [0.0, 0.0]
    assert report.origin == 1_792_884_600
    assert report.zone == "Europe/Berlin"


NIGHT = [datetime(2026, 3, 2, 23, 59, 58) + k * timedelta(seconds=0.25) for k in range(12)]
DAYS, CLOCKS = [t.date() for t in NIGHT], [t.time() for t in NIGHT]


@pytest.mark.parametrize("unit", ["ms", "us", "ns"])
@pytest.mark.parametrize("days", [pa.array(DAYS), pa.array([str(day) for day in DAYS])])
def test_dates_and_times_of_day_of_a_parquet_file_are_joined(
    days: Any, unit: str, tmp_path: Path
) -> None:
    clocks = pa.array(CLOCKS).cast(pa.time32(unit) if unit == "ms" else pa.time64(unit))
    table = pa.table({"d": days, "t": clocks, "y": np.zeros(len(NIGHT))})
    parquet.write_table(table, tmp_path / "r.parquet")
    clock, report = Clock(("d", "t"), SAME, Dates("", "UTC", 0.25)), DataReport()
    (rows,) = File(tmp_path / "r.parquet").blocks(["d", "y"], clock, report)
    assert rows[:, 0].tolist() == [0.25 * k for k in range(len(NIGHT))]
    assert report.origin == 1_772_495_998


def test_times_of_day_of_a_parquet_file_go_on_after_midnight(tmp_path: Path) -> None:
    table = pa.table({"t": pa.array(CLOCKS), "y": np.zeros(len(NIGHT))})
    parquet.write_table(table, tmp_path / "r.parquet")
    dates = Dates("%H:%M:%S.%f", "UTC", 0.25, "2026-03-02")
    (rows,) = File(tmp_path / "r.parquet").blocks(
        ["t", "y"], Clock(("t",), SAME, dates), DataReport()
    )
    assert rows[:, 0].tolist() == [0.25 * k for k in range(len(NIGHT))]


TIMES = st.lists(
    st.one_of(
        st.floats(0.0, 1e8), st.integers(0, 10**9).map(lambda k: k / 1e6),
        st.integers(0, 10**9).map(float), st.integers(0, 10**9).map(lambda k: k * 1e-7),
    ),
    min_size=1, max_size=8,
)  # fmt: skip


@settings(deadline=None, max_examples=300)
@given(
    TIMES,
    st.sampled_from([*ZONES, "-00:30", "Etc/UTC"]),
    st.sampled_from([1.0, 60.0, 0.01, 1e-6]),
    st.integers(-5 * 10**9, 7 * 10**9),
)
def test_dates_are_spelled_as_one_by_one(
    times: list[float], zone: str, period: float, origin: int
) -> None:
    report = DataReport(period=period, origin=origin, zone=zone)
    found = date_columns.spelled(np.array(times), report)
    several = zone not in ("", "UTC", "+05:30", "-00:30", "Etc/UTC")
    assert several or found is not None
    if found is not None:
        assert found.to_pylist() == [report.stamp(time) for time in times]
    part = 1000 if report.digits == 6 else 1
    ticks = date_columns.ticks_of(np.array(times), report)
    assert ticks is not None
    assert (ticks * part).tolist() == [report.nanoseconds(time) for time in times]


def test_dates_beyond_64_bits_are_left_to_the_slow_way() -> None:
    report = DataReport(origin=0)
    assert date_columns.spelled(np.array([0.0, 1e10]), report) is None
    assert date_columns.spelled(np.array([0.0, math.pi]), replace(report, zone="UTC")) is not None
