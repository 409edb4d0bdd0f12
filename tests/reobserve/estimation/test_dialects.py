"""Files as written by spreadsheets and loggers, read if the specification states the dialect."""

from __future__ import annotations

import io
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reobserve.core.documents import parse_yaml
from reobserve.core.errors import InputError
from reobserve.core.validation import parse
from reobserve.estimation.dialect import Dialect
from reobserve.estimation.estimate_command import estimate_file, estimate_stream
from reobserve.estimation.specification import Specification
from tests.reobserve.estimation.records import read_results

SPECIFICATION = """\
observer: {kind: levant, gains: {order: 1, L: 1.0}}
columns:
  time: {column: Zeit, format: "%d.%m.%Y %H:%M:%S,%f"}
  measurements: [{column: Füllhöhe, unit: m}]
  delimiter: ";"
  decimal: ","
  encoding: cp1252
sampling: {period: 0.25}
"""
VALUES = 1.0 + 0.1 * np.sin(np.arange(60) / 5)


def record(**changes: str) -> bytes:
    """sep=;, dd.mm.yyyy, decimal commas and a header in cp1252."""
    lines = ["sep=;", "Zeit;Füllhöhe [m]"]
    for k, value in enumerate(VALUES):
        seconds = f"{58 + k // 4:02d}" if k < 8 else f"{k // 4 - 2:02d}"
        minute = 59 if k < 8 else 0
        hour = 1 if k < 8 else 2
        stamp = f"29.03.2026 {hour:02d}:{minute:02d}:{seconds},{25 * (k % 4):02d}"
        lines.append(f"{stamp};{value:.4f}".replace(".", ",").replace("29,03,", "29.03."))
    return ("\r\n".join(lines) + "\r\n").encode("cp1252")


def chosen(**columns: Any) -> Specification:
    tree = parse_yaml(SPECIFICATION, "s.yaml")
    for key, value in columns.items():
        tree["columns"][key] = value
    return parse(Specification, tree)


def test_specified_dialect_is_read_from_files_and_streams(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "r.csv").write_bytes(record())
    made = estimate_file(chosen(), tmp_path / "r.csv", tmp_path / "e.csv", block=500)
    found, _ = read_results(tmp_path / "e.csv")
    assert made.report.origin == 1774749598  # by `date -u -d 2026-03-29T01:59:58 +%s`
    assert found["time"] == pytest.approx(0.25 * np.arange(60), abs=1e-12)
    read = found["derivatives_1"] + found["residual Füllhöhe"]
    assert read == pytest.approx(np.round(VALUES, 4), abs=1e-12)
    monkeypatch.setattr(sys, "stdin", type("Bytes", (), {"buffer": io.BytesIO(record())}))
    capsys.readouterr()
    estimate_stream(chosen(), None)
    assert capsys.readouterr().out == (tmp_path / "e.csv").read_text(encoding="utf-8")


REFUSED: list[tuple[dict[str, Any], str]] = [
    ({"delimiter": ",", "decimal": "."}, "columns.delimiter: ',' must be ';', as the record's"),
    ({"decimal": "."}, "line 3 of column .* is '1,0000', must be a number; state columns.decimal"),
    ({"encoding": "utf-8"}, "its header cannot be read .*; columns.encoding may state cp1252 or"),
    ({"time": {"column": "Zeit", "unit": "s"}}, "number; of dates state columns.time.format"),
    ({"time": {"column": "Zeit", "unit": "iso8601"}}, "columns.time.format states another form"),
    ({"time": {"column": "Zeit", "format": "%d.%m.%Y %H:%M"}}, "by columns.time.format, %d.%m.%Y"),
]  # fmt: skip


@pytest.mark.parametrize(("columns", "said"), REFUSED)
def test_unspecified_dialect_is_refused_naming_the_key(
    columns: dict[str, Any], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "r.csv").write_bytes(record())
    with pytest.raises(InputError) as error:
        estimate_file(chosen(**columns), tmp_path / "r.csv", tmp_path / "e.csv")
    assert re.search(said, str(error.value)), str(error.value)
    monkeypatch.setattr(sys, "stdin", type("Bytes", (), {"buffer": io.BytesIO(record())}))
    with pytest.raises(InputError) as error:
        estimate_stream(chosen(**columns), None)
    reported = str(error.value)
    assert re.search(said, reported) or "is not UTF-8, see columns.encoding" in reported, reported


def test_unspecified_delimiter_is_named(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_bytes(record().partition(b"\r\n")[2])
    with pytest.raises(InputError, match=r"no column 'Füllhöhe'; file\.skip, .*columns\.delimiter"):
        estimate_file(chosen(delimiter=",", decimal="."), tmp_path / "r.csv", tmp_path / "e.csv")


@pytest.mark.parametrize(
    "form", ["%m.%Y", "%H:%M:%S", "now", "%Q", "%Y-%m-%d %I:%M", "%Y-%m-%d %M", "%c %Z"]
)
def test_date_format_must_have_the_day(form: str) -> None:
    with pytest.raises(InputError, match=r"columns.time.format: .* must have the day"):
        chosen(time={"column": "Zeit", "format": form})
    with pytest.raises(InputError, match=r"columns.time.unit: must be left out where there is a"):
        chosen(time={"column": "Zeit", "format": "%d.%m.%Y %H:%M:%S", "unit": "s"})


@pytest.mark.parametrize("decimal", [".", ","])
def test_truths_and_signs_before_blanks_are_numbers(decimal: str) -> None:
    """As of programmable controllers, and of Graphtec's loggers."""
    dialect = Dialect(decimal=decimal)
    for word in ("true", "false"):
        for cell in (word, word.title(), word.upper()):
            assert dialect.number(f' "{cell}" ') == (word == "true")
    assert dialect.number(f"+   21{decimal}5") == 21.5
    assert dialect.number(f"- 0{decimal}25") == -0.25
    for cell in ("+", "+ -1", "tRUE", "T", "1 true"):
        with pytest.raises(ValueError, match="could not convert"):
            dialect.number(cell)
