"""Timestamps that are durations, in hours that may pass 24, perhaps with days."""

from __future__ import annotations

from datetime import timedelta
from fractions import Fraction
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as parquet
import pytest
from hypothesis import example, given
from hypothesis import strategies as some

from reobserve.core.errors import InputError
from reobserve.estimation.dates import seconds_of
from reobserve.estimation.estimate_command import estimate_file
from tests.reobserve.estimation.records import read_results
from tests.reobserve.estimation.test_file_format import VALUES, chosen, streamed

BEGIN = 86_398_300  # [ms], so that the clock passes 24:00:00
ELAPSED: dict[str, Any] = {"time": {"column": "t", "unit": "duration"}}


def spelled(form: str, milliseconds: int) -> str:
    """A time in one of the forms that loggers have."""
    seconds, rest = divmod(milliseconds, 1000)
    minutes, second = divmod(seconds, 60)
    hours, minute = divmod(minutes, 60)
    if form != "{h:02}":
        day, hours = divmod(hours, 24)
        form = form.format(d=day, h=hours)
    return f"{form.format(h=hours)}:{minute:02}:{second:02}.{rest:03}"


@given(
    some.sampled_from(["", "+", "-"]), some.integers(0, 10**6),
    some.sampled_from(["d ", " d ", "d", " days ", " day, ", "."]), some.integers(0, 10**5),
    some.integers(0, 59), some.integers(0, 59), some.text("0123456789", max_size=12),
)  # fmt: skip
@example("", 0, "d ", 24, 0, 0, "")
def test_all_digits_of_a_duration_count(
    sign: str, days: int, mark: str, hours: int, minutes: int, seconds: int, digits: str
) -> None:
    exact = 3600 * hours + 60 * minutes + seconds + Fraction(int(digits or 0), 10 ** len(digits))
    for first, more in ((f"{days}{mark}", 86400 * days), ("", 0)):
        text = f"{sign}{first}{hours:02}:{minutes:02}:{seconds:02}.{digits}"
        assert Fraction(seconds_of(text)) == (exact + more) * (-1 if sign == "-" else 1)


@pytest.mark.parametrize("text", ["24:00", "1:60:00", "1:00:60", "d 1:00:00", "5", "", "1:-1:00"])
def test_other_texts_are_no_durations(text: str) -> None:
    with pytest.raises(ValueError, match=r"^$"):
        seconds_of(text)


@pytest.mark.parametrize("form", ["{h:02}", "{d}d {h:02}", "{d} days {h:02}"])
@pytest.mark.parametrize("begin", [0, BEGIN, 4 * 10**12 + BEGIN])
def test_records_of_durations_are_read_alike(form: str, begin: int, tmp_path: Path) -> None:
    times = [begin + 100 * k for k in range(30)]
    texts = [spelled(form, time) for time in times]
    specification = chosen(**ELAPSED)
    text = "t,y\n" + "".join(f"{t},{y}\n" for t, y in zip(texts, VALUES, strict=True))
    (tmp_path / "r.csv").write_text(text)
    results = {streamed(specification, text.encode())}
    durations = pa.array([timedelta(milliseconds=time) for time in times])
    parquet.write_table(pa.table({"t": durations, "y": VALUES}), tmp_path / "r.parquet")
    for name in ("r.csv", "r.parquet"):
        for block in (100, 2**22):
            estimate_file(specification, tmp_path / name, tmp_path / "e.csv", block=block)
            results.add((tmp_path / "e.csv").read_text())
    assert len(results) == 1
    assert read_results(tmp_path / "e.csv")[0]["time"].tolist() == [time / 1000 for time in times]


def test_refusals_name_the_unit(tmp_path: Path) -> None:
    rows = "23:59:59,1\n24:00:01,1\n"
    for columns, text, said in (
        (ELAPSED, "t,y\n0,1\n", "line 2 of column 't' is '0', must be a duration, as 26:30:00 or"),
        ({"time": {"column": "t", "unit": "duration", "zone": "UTC"}}, "t,y\n0,1\n",
         "columns.time.zone: UTC is for dates"),
        ({}, f"t,y\n{rows}", "is .23:59:59., .* durations columns.time.unit is duration"),
        ({"time": {"column": "t", "format": "%H:%M:%S", "day": "2026-01-01"}}, f"t,y\n{rows}",
         "line 3 of column 't' is '24:00:01', .*; of a duration columns.time.unit is duration"),
    ):  # fmt: skip
        (tmp_path / "r.csv").write_text(text)
        with pytest.raises(InputError, match=said):
            estimate_file(chosen(**columns), tmp_path / "r.csv", tmp_path / "e.csv")
    rows = "".join(f"0:00:{k / 10:04.1f},1\n" for k in range(30)) + "3.0,1\n"
    with pytest.raises(InputError, match=r"line 32 of column 't' is '3\.0', must be a duration"):
        streamed(chosen(**ELAPSED), f"t,y\n{rows}".encode())
    durations = pa.array([timedelta(0), timedelta(seconds=1)])
    for columns, times in (
        (ELAPSED, [0.0, 0.1]),
        (ELAPSED, ["0:00:00", "0:00:01"]),
        ({}, durations),
    ):
        parquet.write_table(pa.table({"t": times, "y": [1.0, 2.0]}), tmp_path / "r.parquet")
        with pytest.raises(InputError, match=r"'t' is of the type .*; durations have the unit dur"):
            estimate_file(chosen(**columns), tmp_path / "r.parquet", tmp_path / "e.csv")
