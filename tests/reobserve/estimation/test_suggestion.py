"""Layouts that are guessed from a text, for generated records of known layouts."""

from __future__ import annotations

import gzip
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from reobserve.cli.main import main
from reobserve.core.documents import dumped, parse_yaml
from reobserve.core.errors import InputError
from reobserve.estimation.families.examples import specification_text
from reobserve.estimation.suggestion import Suggestion, suggest

ROWS = 60


def rows(*forms: str, delimiter: str = ",", start: int = 0, count: int = ROWS) -> str:
    """Lines with cells by formats of the number of the row, and of a value."""
    return "".join(
        delimiter.join(forms).format(k=k, v=1.0 + 0.1 * (k % 7), m=k // 60, s=k % 60) + "\n"
        for k in range(start, start + count)
    )


def suggested(folder: Path, text: str, name: str = "r.csv", encoding: str = "utf-8") -> Suggestion:
    """The suggestion for a text."""
    data = text.encode(encoding)
    (folder / name).write_bytes(gzip.compress(data) if name.endswith(".gz") else data)
    return suggest(folder / name)


ISO = "2024-03-01T10:{m:02d}:{s:02d}"
DAY_FIRST = "29.02.2024 10:{m:02d}:{s:02d}"
AMBIGUOUS = "03/04/2024 10:{m:02d}:{s:02d}"
LVM = "X_Dim\tTime\tTime\t\nX0\t0.0\t0.0\t\n***End***\t\t\t\nX_Value\tVoltage\tCurrent\tComment\n"
ISO_KEYS = {"time": {"column": "t", "unit": "iso8601"}}
ASKED = {"time": {"column": "t", "unit": "?"}}
SECONDS = {"time": {"column": "t", "unit": "s"}}

LAYOUTS: dict[str, tuple[str, dict[str, Any], dict[str, Any]]] = {
    "plain": ("t,y\n" + rows("{k}", "{v:.2f}"), ASKED, {}),
    "plain seconds": ("t,y\n" + rows("{k}.5", "{v:.2f}"), SECONDS, {}),
    "dates": ("t,y\n" + rows(ISO, "{v:.2f}"), ISO_KEYS, {}),
    "preamble": (
        "Logger 7\nSite: hall\n\nt,y\n" + rows(ISO, "{v:.2f}"), ISO_KEYS, {"skip": 3},
    ),
    "rows of fewer cells than the header": (
        LVM + rows("0.{k:02d}", "{v:.2f}", "0.5", delimiter="\t"),
        {"time": {"column": "X_Value", "unit": "s"}, "delimiter": "\t"},
        {"skip": 4, "names": ["X_Value", "Voltage", "Current"]},
    ),
    "a preamble with numbers": (
        "number of rows,19,,,\nserial,7,,,\nt,a,b,c,d\n" + rows(ISO, *["{v:.2f}"] * 4),
        ISO_KEYS, {"skip": 2},
    ),
    "comments": ("# a\n# b\nt,y\n" + rows(ISO, "{v:.2f}"), ISO_KEYS, {"comment": "#"}),
    "a commented header": (
        "# a\n# t y\n" + rows("{k}", "{v:.2f}", delimiter=" "),
        {**ASKED, "delimiter": "whitespace"}, {"comment": "#", "names": ["t", "y"]},
    ),
    "units": ("t,y\ns,degC\n" + rows("{k}", "{v:.2f}"), SECONDS,
              {"below_header": ["units"]}),
    "units in blanks": (
        "  Time  F1  F2\n  (s) (N) (N)\n" + rows(" {k}", "{v:.2f}", "{v:.2f}", delimiter="  "),
        {"time": {"column": "Time", "unit": "s"}, "delimiter": "whitespace"},
        {"below_header": ["units"]},
    ),
    "a spreadsheet": (
        "sep=;\nt;y\n" + rows(DAY_FIRST, "{v:.2f}", delimiter=";").replace("1.", "1,"),
        {"time": {"column": "t", "format": "%d.%m.%Y %H:%M:%S"}, "delimiter": ";", "decimal": ","},
        {},
    ),
    "two columns of time": (
        "Date;Time;y\n" + rows("2024/03/01", "10:{m:02d}:{s:02d}", "{v:.2f}", delimiter=";"),
        {"time": {"format": "%Y/%m/%d %H:%M:%S", "column": ["Date", "Time"]}, "delimiter": ";"}, {},
    ),
    "AM and PM": (
        "t,y\n" + rows("03/25/2024 10:{m:02d}:{s:02d} PM", "{v:.2f}"),
        {"time": {"column": "t", "format": "%m/%d/%Y %I:%M:%S %p"}}, {},
    ),
    "AM and PM after a blank": (
        "day hour half y\n"
        + rows("03/25/2024", "10:{m:02d}:{s:02d}", "PM", "{v:.2f}", delimiter=" "),
        {
            "time": {"format": "%m/%d/%Y %I:%M:%S %p", "column": ["day", "hour", "half"]},
            "delimiter": "whitespace",
        },
        {},
    ),
    "names of months": (
        "t,y\n" + rows("23-Feb-2022 06:{m:02d}:{s:02d}.250", "{v:.2f}"),
        {"time": {"column": "t", "format": "%d-%b-%Y %H:%M:%S.%f"}}, {},
    ),
    "digits alone": (
        "id,t,y\n" + rows("7", "2024121109{s:02d}", "{v:.2f}"),
        {"time": {"column": "t", "format": "%Y%m%d%H%M"}}, {},
    ),
    "parts": (
        "YY MM DD hh mm y\n" + rows("2024", "03", "01", "10", "{s:02d}", "{v:.2f}", delimiter=" "),
        {"time": {"column": ["YY", "MM", "DD", "hh", "mm"], "format": "%Y %m %d %H %M"},
         "delimiter": "whitespace"}, {},
    ),
    "milliseconds": (
        "n,Timestamp,y\n" + rows("{k}", "17040672{k:02d}000", "{v:.2f}"),
        {"time": {"column": "Timestamp", "unit": "ms"}}, {},
    ),
    "a unit of time that is none": (
        "y,STAMP(ts)\n" + rows("{v:.2f}", "17040672{k:02d}"),
        {"time": {"column": "STAMP(ts)", "unit": "s"}}, {},
    ),
    "no header": (
        rows("{k}", "{v:.2f}", "{v:.1f}", delimiter="\t"),
        {"time": {"column": "1", "unit": "?"}, "delimiter": "\t"},
        {"names": ["1", "2", "3"]},
    ),
    "a time without a title": (
        ",y\n" + rows(ISO, "{v:.2f}"), {"time": {"column": "column 1", "unit": "iso8601"}},
        {"skip": 1, "names": ["column 1", "y"]},
    ),
    "a header of numbers": (
        "YY,t,.03,.04,.05,.06\n" + rows("a{k}", "{k}", *["{v:.2f}"] * 4), ASKED, {},
    ),
    "codes": (
        "t,y,z\n" + rows(ISO, "{v:.2f}", "{v:.2f}").replace("1.30,1.30", "OL,1.30"), ISO_KEYS,
        {"missing_values": ["OL"]},
    ),
    "a column of texts": (
        "t,y,note\n" + rows(ISO, "{v:.2f}", "").replace("1.30,", "1.30,rain"), ISO_KEYS, {},
    ),
    "dates in a few rows": (
        "seen,t,y\n" + rows("", ISO, "{v:.2f}", count=9)
        + rows(ISO.replace("03-01", "02-29"), ISO, "{v:.2f}", start=9, count=3)
        + rows("", ISO, "{v:.2f}", start=12), ISO_KEYS, {},
    ),
    "repeated headers": (
        "t,y\n" + rows(ISO, "{v:.2f}", count=20) + "t,y\n" + rows(ISO, "{v:.2f}", start=20),
        ISO_KEYS, {"repeated_header": "skip"},
    ),
    "half a line": ("t,y\n" + rows(ISO, "{v:.2f}") + "2024-03-0", ISO_KEYS, {"tail": "drop"}),
}  # fmt: skip


@pytest.mark.parametrize("name", LAYOUTS)
def test_layout_is_suggested(name: str, tmp_path: Path) -> None:
    text, columns, file = LAYOUTS[name]
    found = suggested(tmp_path, text)
    assert (found.columns, found.file) == (columns, file), found.text("r")


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-8-sig", "cp1252"])
def test_encoding_is_suggested(encoding: str, tmp_path: Path) -> None:
    found = suggested(tmp_path, "t,T [°C]\n" + rows(ISO, "{v:.2f}"), encoding=encoding)
    stated = {"utf-16-le": {"encoding": "utf-16"}, "cp1252": {"encoding": "cp1252"}}
    assert found.columns == {**ISO_KEYS, **stated.get(encoding, {})}
    assert found.titles == ["t", "T [°C]"]


def test_gzip_is_unpacked(tmp_path: Path) -> None:
    found = suggested(tmp_path, "t,y\n" + rows(ISO, "{v:.2f}"), "r.log.gz")
    assert found.columns == ISO_KEYS
    assert "#   y: 1.00" in found.text("r")


def test_doubts_are_noted(tmp_path: Path) -> None:
    found = suggested(tmp_path, "t,y\n" + rows(AMBIGUOUS, "{v:.2f}"))
    assert found.columns["time"]["format"] == "?"
    assert "03/04/2024 10:00:00 may be of %d/%m/%Y %H:%M:%S or %m/%d/%Y %H:%M:%S" in found.text("r")
    mixed = rows("07/26/2024 10:{m:02d}:{s:02d}", "{v:.2f}") + "07/26/24 10:01 PM,1.0\n"
    found = suggested(tmp_path, "t,y\n" + mixed)
    assert found.columns["time"]["format"] == "%m/%d/%Y %H:%M:%S"
    assert "'07/26/24 10:01 PM' are of another format, and no key reads both" in found.text("r")
    found = suggested(tmp_path, "x,y\n" + rows("{v}", "{v:.2f}"))
    assert "no column looks like timestamps" in found.text("r")
    found = suggested(
        tmp_path, "n,y\n" + rows("{k}", "{v:.2f}", count=40) + "1,2,3\n" * 3 + "9,1\n"
    )
    assert "3 lines have another number of cells than rows, 2; the first one is line 42" in (
        found.text("r")
    )


def test_times_of_day_are_times_and_quantities_are_not(tmp_path: Path) -> None:
    text = rows("23:59:{s:02d}", "{k}", delimiter=";")
    found = suggested(tmp_path, "time;Druck [bar]\n" + text)
    assert found.columns["time"] == {"column": "time", "format": "%H:%M:%S", "day": "?"}
    assert "unsure: columns.time.day: 'time' has no day, that of the first row" in found.text("r")
    found = suggested(tmp_path, "a,Druck [bar]\n" + rows("{v:.2f}", "{k}"))
    assert "time" not in found.columns


def test_times_of_a_parquet_file_are_found(tmp_path: Path) -> None:
    dates = pd.date_range("2024-03-01", periods=5, freq="s", tz="UTC")
    pd.DataFrame({"y": [1.0] * 5, "when": dates}).to_parquet(tmp_path / "r.parquet")
    found = suggest(tmp_path / "r.parquet")
    assert found.columns == {"time": {"column": "when", "unit": "iso8601"}}
    assert (found.titles, found.first) == (["y", "when"], ["1.0", "2024-03-01 00:00:00+00:00"])


def test_ambiguous_dates_are_read_as_the_record_goes_on(tmp_path: Path) -> None:
    text = "t,y\n" + "".join(f"0{1 + k // 24}/04/2024 {k % 24:02d}:00,1.5\n" for k in range(72))
    assert suggested(tmp_path, text).columns["time"]["format"] == "%d/%m/%Y %H:%M"
    text = "t,y\n" + "".join(f"04/0{1 + k // 24}/2024 {k % 24:02d}:00,1.5\n" for k in range(72))
    assert suggested(tmp_path, text).columns["time"]["format"] == "%m/%d/%Y %H:%M"


@pytest.mark.parametrize("text", ["", "a text\nof words\n", "\0" * 100])
def test_text_without_rows_is_refused(text: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no lines that look like rows of numbers"):
        suggested(tmp_path, text)


CELLS = st.sampled_from(
    ["", "1.5", "2,5", "-", "OFF", "12:30:01", "01.03.2024", "2024-03-01T10:00:00", "PM", "t", "y",
     "y [V]", "[V]", "#", '"', "\0", "2359", "***End***"]
)  # fmt: skip
RAGGED = st.lists(st.lists(CELLS, max_size=5), max_size=4)
TIMES = ("{k}", "10:00:{k:02d}", "2024-03-01T10:00:{k:02d}", "01.03.2024{d}10:00:{k:02d}")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    above=RAGGED, below=RAGGED, titles=st.integers(0, 6), cells=st.integers(0, 4),
    count=st.sampled_from([0, 1, 12]), time=st.sampled_from(TIMES),
    delimiter=st.sampled_from(",;\t |"), end=st.sampled_from(["", "\n", "\r\n"]),
)  # fmt: skip
@example(
    above=[["X_Dim", "Time", ""], ["***End***"]], below=[["1", "2"]], titles=4, cells=2, count=12,
    time="{k}", delimiter="\t", end="\n",
)  # fmt: skip
@example(
    above=[["\0"]], below=[], titles=1, cells=0, count=12, time=TIMES[2], delimiter=",", end=""
)
def test_ragged_rows_are_read_or_refused_in_a_sentence(
    above: list[list[str]], below: list[list[str]], titles: int, cells: int, count: int, time: str,
    delimiter: str, end: str, tmp_path: Path,
) -> None:  # fmt: skip
    """By all commands, whatever number of cells a header and rows have."""
    plain = [[time.format(k=k, d=delimiter), *["1.5"] * cells] for k in range(count)]
    lines = [*above, ["t", "y", "z", "u", "v", "Comment"][:titles], *plain, *below, *plain[:1]]
    data = tmp_path / "r.csv"
    data.write_text("\n".join(map(delimiter.join, lines)) + end, encoding="utf-8")
    tree = parse_yaml(specification_text("levant"), "levant")
    tree["columns"] = {
        "time": {"column": "t"}, "measurements": [{"column": "y", "unit": "V"}],
        "delimiter": "whitespace" if delimiter == " " else delimiter,
    }  # fmt: skip
    stated = tmp_path / "s.yaml"
    stated.write_text(dumped(tree), encoding="utf-8")
    for arguments in (["--suggest", data], ["--check", stated, data]):
        with redirect_stdout(StringIO()), redirect_stderr(StringIO()) as said:
            status = main(["estimate", *map(str, arguments)])
        lines = said.getvalue().splitlines()
        assert bool(lines) == status, said.getvalue()
        assert all(line.startswith(("reobserve: ", "  ")) for line in lines), said.getvalue()
