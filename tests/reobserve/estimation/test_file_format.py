"""Logs as loggers write them: each key of `file` gives known numbers, from files and streams."""

from __future__ import annotations

import gzip
import io
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reobserve.core.errors import InputError
from reobserve.core.validation import parse
from reobserve.estimation.estimate_command import estimate_file, estimate_stream
from reobserve.estimation.specification import Specification
from tests.reobserve.estimation.records import read_results

TIMES = [round(0.1 * k, 1) for k in range(30)]
VALUES = [round(1.0 + 0.01 * k, 2) for k in range(30)]
ROWS = [f"{t},{y}" for t, y in zip(TIMES, VALUES, strict=True)]
PLAIN = "".join(f"{row}\n" for row in ROWS)


def chosen(file: dict[str, Any] | None = None, **columns: Any) -> Specification:
    """A filter of a column y at the times t, whose estimates are what was measured."""
    return parse(Specification, {
        "observer": {
            "kind": "kalman", "time": "discrete", "states": {"x": "V"}, "measurements": {"x": "V"},
            "A": [[1.0]], "C": [[1.0]], "Q": 1.0, "R": 1.0e-20, "initial_state": [0.0],
            "initial_covariance": 100.0,
        },
        "columns": {"time": {"column": "t"}, "measurements": [{"column": "y"}], **columns},
        "sampling": {"period": 0.1, "missing": "skip"}, "file": file or {},
    })  # fmt: skip


def streamed(specification: Specification, content: bytes, report: Path | None = None) -> str:
    """The results of a record from standard input, on a terminal that cannot encode all titles."""
    out = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "stdin", type("Bytes", (), {"buffer": io.BytesIO(content)}))
        patch.setattr(sys, "stdout", out)
        estimate_stream(specification, None, report=report)
    out.flush()
    return out.buffer.getvalue().decode()  # type: ignore[attr-defined,no-any-return]


def read(
    specification: Specification, text: str | bytes, folder: Path, name: str = "r.csv"
) -> tuple[list[float], dict[str, Any]]:
    """What was read of y, with no time lost, and the report; a stream must give the same."""
    content = text.encode() if isinstance(text, str) else text
    (folder / name).write_bytes(content)
    reports = []
    for block in (70, 2**22):
        report = folder / "report.json"
        estimate_file(specification, folder / name, folder / "e.csv", report=report, block=block)
        found = (folder / "e.csv").read_text(encoding="utf-8")
        reports.append(json.loads(report.read_text()))
        if not name.lower().endswith(".gz"):
            assert streamed(specification, content, report) == found
            reports.append(json.loads(report.read_text()))
    for key in ("left_out", "missing", "rows"):
        assert all(one[key] == reports[0][key] for one in reports), key
    numbers, status = read_results(folder / "e.csv")
    assert numbers["time"] == pytest.approx(TIMES[: len(numbers["time"])], abs=1e-12)
    known = np.array([word == "measured" for word in status])
    return np.where(known, np.round(numbers["x"], 9), np.nan).tolist(), reports[0]


ABOVE = "".join(f"exported; by: a; logger {k}\n" for k in range(3))
READ: list[tuple[str, dict[str, Any], dict[str, Any], dict[str, int]]] = [
    ("t,y\n" + PLAIN, {}, {}, {}),
    (ABOVE + "t,y\n" + PLAIN, {"skip": 3}, {}, {"above the header": 3}),
    ("# a\n\n#b,c\nt,y\n" + PLAIN.replace("0.5", "# of 0.5\n0.5"), {"comment": "#"}, {},
     {"comments": 3}),
    ("%a\n% t ,y\n" + PLAIN, {"comment": "%", "header": "commented"}, {}, {"comments": 1}),
    ("//a\n#t,y\n" + PLAIN, {"skip": 1}, {}, {"above the header": 1}),
    (PLAIN, {"names": ["t", "y"]}, {}, {}),
    (ABOVE + PLAIN.replace(",", ",x,"), {"names": ["t", "", "y"], "skip": 3}, {},
     {"above the header": 3}),
    ("t,y\ns,V\n" + PLAIN, {"below_header": ["units"]}, {}, {}),
    ("t,y\nms,mV\nSmp,Avg\n" + "".join(f"{100 * t:.0f}0,{1000 * y:.0f}\n" for t, y in
     zip(TIMES, VALUES, strict=True)), {"below_header": ["units", "skip"]}, {},
     {"below the header": 1}),
    ("t,y\n(s),[V]\n" + PLAIN, {"below_header": ["skip"]}, {}, {"below the header": 1}),
    ("t,y\n" + PLAIN.replace("1.0,", "t,y\n1.0,"), {"repeated_header": "skip"}, {},
     {"repeated headers": 1}),
    ("t,y\n" + PLAIN + "3.0,1.3", {"tail": "drop"}, {}, {"last line": 1}),
    ("t,y\n" + PLAIN + "3.0", {"tail": "drop"}, {}, {"last line": 1}),
    ("t,y\n" + PLAIN + "3.0,-\0\n", {"tail": "drop"}, {}, {"last line": 1}),
    ("t,y\n" + PLAIN + "3.0\n", {"tail": "drop"}, {}, {"last line": 1}),
    ("t,y\n" + PLAIN + 5000 * "\0", {"tail": "drop"}, {}, {"last line": 1}),
    ("t,y\n" + PLAIN.rstrip("\n"), {}, {}, {}),
    ("t|y\n" + PLAIN.replace(",", " | "), {}, {"delimiter": "|"}, {}),
    ("  t \ty\n" + PLAIN.replace(",", " \t  ").replace("\n", "  \n  "), {},
     {"delimiter": "whitespace"}, {}),
    ('"a note" t y\n' + "".join(f'"a b"\t{row}\n'.replace(",", " ") for row in ROWS), {},
     {"delimiter": "whitespace"}, {}),
    ("t;y\n" + PLAIN.replace(",", ";").replace(".", ","), {}, {"delimiter": ";", "decimal": ","},
     {}),
    ("t,y\n" + "".join(f'"{t}","{y}"\n'.replace(".", ",") for t, y in
     zip(TIMES, VALUES, strict=True)), {}, {"decimal": ","}, {}),
    ("t,y,,\n" + PLAIN.replace("\n", ",,\n"), {}, {}, {}),
    ("t,y\n" + PLAIN.replace("\n", ",,,\n", 12), {}, {}, {}),
    ("t,y,,,\n" + PLAIN, {}, {}, {}),
    ("t,y\n" + PLAIN.replace("0.5,", ",,\n0.5,") + ",\n,\n", {}, {}, {}),
    ("t,y,T,T\n" + PLAIN.replace("\n", ",a,b\n"), {}, {}, {}),
]  # fmt: skip


@pytest.mark.parametrize(("text", "file", "columns", "left_out"), READ)
def test_stated_layout_is_read_and_counted(
    text: str, file: dict[str, Any], columns: dict[str, Any], left_out: dict[str, int],
    tmp_path: Path,
) -> None:  # fmt: skip
    found, report = read(chosen(file, **columns), text, tmp_path)
    assert found == VALUES
    assert report["left_out"] == left_out


@pytest.mark.parametrize("encoding", ["utf-8-sig", "cp1252", "latin-1", "utf-16", "utf-16-be"])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_encodings_are_read(encoding: str, end: str, tmp_path: Path) -> None:
    mark = "\ufeff" if encoding == "utf-16-be" else ""
    text = mark + "t,°,y é\n" + PLAIN.replace(",", ",µ,")
    stated: dict[str, Any] = {} if encoding.startswith("utf") else {"encoding": encoding}
    specification = chosen(measurements=[{"column": "y é"}], **stated)
    content = text.replace("\n", end).encode(encoding)
    assert read(specification, content, tmp_path)[0] == VALUES


def test_bytes_of_another_encoding_matter_in_cells_that_are_read(tmp_path: Path) -> None:
    text = "t,y,note\n" + PLAIN.replace("\n", ",\u00e9\n")
    assert read(chosen(), text.encode("cp1252"), tmp_path)[0] == VALUES
    said = "line 3 of column 'y' is .*; it is not UTF-8, see columns.encoding"
    with pytest.raises(InputError, match=said):
        read(chosen(), text.replace("1.01", "1.01\u00e9").encode("cp1252"), tmp_path)


def test_utf_16_without_a_mark_is_stated(tmp_path: Path) -> None:
    """Characters such as U+0A05 have a byte in them that is a line feed elsewhere."""
    text = "t,y,\u0a05\u050a\n" + PLAIN.replace("\n", ",\u0a05\u050a\n")
    found, _ = read(chosen(encoding="utf-16"), text.encode("utf-16-le"), tmp_path)
    assert found == VALUES
    with pytest.raises(
        InputError, match=r"byte 2 is not UTF-8\); columns.encoding may state utf-16"
    ):
        read(chosen(), text.encode("utf-16-le"), tmp_path)


@pytest.mark.parametrize(
    "name", ["r.txt", "R.DAT", "r.log", "LOG00001.CSV", "r", "r.txt.GZ", "r.gz"]
)
def test_any_ending_is_text(name: str, tmp_path: Path) -> None:
    text = ("t,y\n" + PLAIN).encode()
    content = gzip.compress(text) if name.lower().endswith("gz") else text
    assert read(chosen(), content, tmp_path, name)[0] == VALUES


def test_spreadsheets_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"r.XLSX: must be text, such as .csv, or .parquet"):
        read(chosen(), b"PK\x03\x04", tmp_path, "r.XLSX")


@pytest.mark.parametrize(
    ("text", "stated"),
    [("?", ["?"]), (" OL ", ["OL"]), ("-9999.0", ["-9999.0", "?"]), ("#N/A", []), ("NULL", []),
     ("1.#QNAN", []), ("sensor off", ["sensor off"])],
)  # fmt: skip
def test_texts_mean_missing_values(text: str, stated: list[str], tmp_path: Path) -> None:
    content = "t,y\n" + PLAIN.replace("1.05\n", f"{text}\n").replace("1.25\n", f"{text}\n")
    found, report = read(chosen({"missing_values": stated}), content, tmp_path)
    assert [k for k, value in enumerate(found) if np.isnan(value)] == [5, 25]
    assert report["missing"] == {"y": 2}


@pytest.mark.parametrize(
    ("mark", "decimal", "spelled"),
    [(",", ".", ["1,234.5", "-12,345,678", "999.25", "1,000", "1,000.5e3"]),
     (".", ",", ["1.234,5", "-12.345.678", "999,25", "1.000", "1.000,5e3"]),
     ("'", ".", ["1'234.5", "-12'345'678", "999.25", "1000", "1'000.5e3"]),
     (" ", ",", ["1 234,5", "-12 345 678", "999,25", "1 000", "1 000,5e3"]),
     (".", ".", ["1.234.500", "-12.345.678.0", "999.25", "1.000.000", "1000500."])],
)  # fmt: skip
def test_thousands_are_read(mark: str, decimal: str, spelled: list[str], tmp_path: Path) -> None:
    rows = [f"{t};{y}".replace(".", decimal) for t, y in zip(TIMES, VALUES, strict=True)]
    for k, number in enumerate(spelled):
        rows[3 + k] = f"{TIMES[3 + k]};{number}".replace(".", decimal, 1)
    specification = chosen(delimiter=";", decimal=decimal, thousands=mark)
    found, _ = read(specification, "t;y\n" + "".join(f"{row}\n" for row in rows), tmp_path)
    assert found[3:8] == pytest.approx([1234.5, -12_345_678, 999.25, 1000, 1_000_500])
    assert found[:3] + found[8:] == VALUES[:3] + VALUES[8:]


REFUSED: list[tuple[str, dict[str, Any], dict[str, Any], str]] = [
    ("t,y\ns,V\n" + PLAIN, {}, {}, "line 2 of column 't' is 's', must be a number; if the line stat"
     "es units, file.below_header: [units] reads it"),
    ("t,y\n" + PLAIN.replace("1.05\n", "?\n"), {}, {}, "line 7 of column 'y' is '?', must be a numb"
     "er; if it means a missing value, state it in file.missing_values"),
    ("# a\n\nt,y\n" + PLAIN.replace("1.05\n", "x\n"), {"comment": "#"}, {}, "line 9 of column 'y'"),
    ("a\nb\nt,y\n\n" + PLAIN.replace("1.05\n", "1e999\n"), {"skip": 2}, {}, "y: line 10 is inf"),
    ("t,y\n" + PLAIN.replace("\n0.6,", "\n#\n0.4,"), {"comment": "#"}, {}, "line 9: the timestamp"),
    ("t,y\n" + PLAIN + "3.0", {}, {}, "line 32 has 1 cell, the header has 2; it has no line end: wi"
     "th file.tail: drop it is left out"),
    ("t,y\n" + PLAIN + "3.0\n3.1,1\n", {"tail": "drop"}, {}, "line 32 has 1 cell, the header has"),
    ("t,y\n" + PLAIN + "3.0,1\0", {}, {}, "; the line has no end: with file.tail: drop it is left"),
    ("t,y\n" + PLAIN.replace("1.0,", "t,y\n1.0,"), {}, {}, "; the line repeats the header: with fil"
     "e.repeated_header: skip it is left out"),
    ("t,y\n" + PLAIN + "end of log\n", {}, {}, "line 32 has 1 cell, the header has 2; if it is no r"
     "ow, file.comment may state how such lines begin"),
    ("t,y,z\n" + PLAIN, {}, {}, "line 2 has 2 cells, the header has 3; if the header is wrong, file"
     ".skip: 1 leaves it out and file.names states the columns"),
    ("t,y\n" + PLAIN, {"names": ["t", "y"]}, {}, "if the line is a header, file.skip: 1 leaves it"),
    ("t,y\n" + PLAIN, {"names": ["t", "z", "y"], "skip": 1}, {}, "has 2 cells, file.names has 3"),
    (PLAIN, {}, {}, "there are: 0.0, 1.0; file.skip, comment, header or names state where titles"),
    ("by x\nt,y\n" + PLAIN, {}, {}, "; file.skip, comment, header or names state where titles are"),
    ("# a\nt,y\n" + PLAIN, {}, {}, "between them: `reobserve estimate --suggest` finds all of the"),
    (PLAIN, {"comment": "#", "header": "commented"}, {}, "file.header: commented must be left out"),
    ("t,y\n", {"skip": 3}, {}, "file.skip: 3 must be less: "),
    ("t y\n" + PLAIN.replace(",", " "), {}, {}, "and columns.delimiter what is between them"),
    ("t;y\n" + PLAIN.replace(",", ";").replace("1.05", "1.234,5"), {}, {"delimiter": ";"},
     'number; state columns.thousands: "." and columns.decimal: ","'),
    ("t;y\n" + PLAIN.replace(",", ";").replace("1.05", "1,234"), {}, {"delimiter": ";"},
     'number; state columns.decimal: "," or columns.thousands: ","'),
    ("t;y\n0;1,5\n", {}, {"delimiter": ";", "thousands": ","}, "line 2 of column 'y' is '1,5',"),
    ("t;y\n0;1,2e3\n", {}, {"delimiter": ";", "thousands": ","}, "column 'y' is '1,2e3', must"),
    ("t,y,y\n" + PLAIN.replace("\n", ",1\n"), {}, {}, "has the column 'y' twice"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "file", "columns", "said"), REFUSED)
def test_refusal_names_line_column_and_key(
    text: str, file: dict[str, Any], columns: dict[str, Any], said: str, tmp_path: Path
) -> None:
    (tmp_path / "r.csv").write_text(text, encoding="utf-8")
    specification = chosen(file, **columns)
    with pytest.raises(InputError) as error:
        estimate_file(specification, tmp_path / "r.csv", tmp_path / "e.csv")
    assert said in str(error.value)
    with pytest.raises(InputError) as same:
        streamed(specification, text.encode())
    place = str(tmp_path / "r.csv")
    assert str(same.value) == str(error.value).split("\n")[0].replace(place, "standard input")


@pytest.mark.parametrize(
    ("file", "said"),
    [
        ({"header": "commented"}, "file.comment: is missing; a header that is a comment begins"),
        ({"names": ["t"], "below_header": ["skip"]}, "file.below_header: must be left out where"),
        ({"names": ["", ""]}, "file.names: are all empty, must name the columns that are read"),
        ({"below_header": ["units", "units"]}, "file.below_header: states units twice"),
        ({"below_header": ["unit"]}, "file.below_header.0: 'unit' must be one of units, skip"),
        ({"skip": -1}, "file.skip: -1 must not be negative"),
        ({"comment": " #"}, "file.comment: ' #' must be text that can be printed"),
        ({"tail": True}, "file.tail: True must be one of refuse, drop"),
        ({"missing_values": ["a\nb"]}, "file.missing_values.0: 'a\\\\nb' must be text"),
    ],
)
def test_impossible_formats_are_refused(file: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=f"^{said.replace('[', chr(92) + '[')}"):
        chosen(file)


@pytest.mark.nightly
def test_nul_bytes_may_be_many(tmp_path: Path) -> None:
    found, report = read(chosen({"tail": "drop"}), f"t,y\n{PLAIN}" + 3_000_000 * "\0", tmp_path)
    assert found == VALUES
    assert report["left_out"] == {"last line": 1}
    with pytest.raises(
        InputError, match=r"line 32 has 1 cell, .*; it has no line end: with file.tai"
    ):
        read(chosen(), f"t,y\n{PLAIN}" + 3_000_000 * "\0", tmp_path)


def test_row_of_delimiters_is_a_lost_sample_where_rows_have_no_timestamps(tmp_path: Path) -> None:
    for text, lost in (
        ("y,z\n" + "".join(f"{y},1\n" for y in VALUES), ("1.05,1", ",")),
        ("y\n" + "".join(f"{y}\n" for y in VALUES), ("1.05", '""')),
    ):
        found, report = read(chosen(time={}), text.replace(*lost), tmp_path)
        assert report["rows"] == 30
        assert [k for k, value in enumerate(found) if np.isnan(value)] == [5]


def test_word_is_no_blank_line(tmp_path: Path) -> None:
    """The letters of `whitespace` are no delimiters."""
    text = "t y\n" + PLAIN.replace(",", " ") + "espace\n"
    with pytest.raises(InputError, match="line 32 has 1 cell, the header has 2; if it is no row"):
        read(chosen(delimiter="whitespace"), text, tmp_path)


def test_summary_counts_lines_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = "a\nb\nt,y\n#c\n" + PLAIN + "3.0"
    streamed(chosen({"skip": 2, "comment": "#", "tail": "drop"}), text.encode())
    assert (
        "  lines left out   2 above the header, 1 comments, 1 last line\n"
        in capsys.readouterr().err
    )


def test_followed_file_resumes_counting_lines(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """UTF-16 with comments; the second run stops at a line that only an editor's count finds."""
    head, rows = "#\nt,y\n", PLAIN.replace("1.05", "#\n\n0.5,1.05").splitlines(keepends=True)
    text = (head + PLAIN.replace("0.5,", "#\n\n0.5,")).splitlines(keepends=True)
    log, state = tmp_path / "log.txt", tmp_path / "state.json"
    specification = chosen({"comment": "#"})
    assert len(rows) == 32
    log.write_bytes("".join(text[:20]).encode("utf-16"))
    estimate_stream(specification, log, idle=0.05, state=state)
    log.write_bytes("".join([*text, "3.0,x\n"]).encode("utf-16"))
    with pytest.raises(
        InputError, match=r"log.txt: line 35 of column 'y' is 'x', must be a number"
    ):
        estimate_stream(specification, log, idle=0.05, state=state)
    out = capsys.readouterr().out
    (tmp_path / "r.csv").write_text("".join(text))
    estimate_file(specification, tmp_path / "r.csv", tmp_path / "e.csv")
    assert out == (tmp_path / "e.csv").read_text(encoding="utf-8")
