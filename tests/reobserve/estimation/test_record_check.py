"""Checks of records: what they list, and that what they print accepts the record."""

from __future__ import annotations

import gzip
import re
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as parquet
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from reobserve.cli.main import main
from reobserve.core.documents import dumped, parse_yaml, read_yaml
from reobserve.estimation.estimate_command import estimate_file
from reobserve.estimation.findings import Findings
from reobserve.estimation.record_check import check
from reobserve.estimation.specification import read_specification
from tests.reobserve.estimation.test_suggestion import LAYOUTS, suggested

KALMAN: dict[str, Any] = {
    "kind": "kalman", "time": "discrete", "A": [[1.0]], "C": [[1.0]], "Q": [0.01], "R": [1.0],
    "initial_state": [0.0], "initial_covariance": 10.0,
}  # fmt: skip
LEVANT: dict[str, Any] = {"kind": "levant", "gains": {"order": 1, "L": 1.0}}


def specified(folder: Path, observer: dict[str, Any] | None = None, **sections: Any) -> Path:
    """A specification of an observer of the column y, one row a second by the column t."""
    columns = {"time": {"column": "t"}, "measurements": [{"column": "y"}]}
    tree: dict[str, Any] = {
        "observer": observer or KALMAN,
        "columns": {**columns, **sections.pop("columns", {})},
        "sampling": {"period": 1.0, **sections.pop("sampling", {})},
        **sections,
    }
    path = folder / "s.yaml"
    path.write_text(dumped(tree), encoding="utf-8")
    return path


def accepted(folder: Path, chosen: Path, data: Path) -> Findings:
    """What a check finds, after what it prints was merged, and accepts the record or says not."""
    found = check(chosen, data)
    text = found.text(str(data))
    tree = read_yaml(chosen)
    for line in text.splitlines():
        if re.match(r"(columns|file|sampling): ", line):
            tree.update(parse_yaml(line, "printed"))
    assert ("is accepted" in text) == (not found.refusals)
    if "no key accepts all of this" in text or "what else is refused shows then" in text:
        return found
    assert found.choices or tree.get("sampling") == found.tree.get("sampling")
    if found.choices:
        assert "repeated" not in tree["sampling"]
        tree["sampling"]["repeated"] = found.tree["sampling"]["repeated"]
    merged = folder / "merged.yaml"
    merged.write_text(dumped(tree), encoding="utf-8")
    assert main(["estimate", str(merged), str(data), "--out", str(folder / "e.csv")]) == 0, text
    assert check(merged, data).refusals == {}, text
    return found


def written(folder: Path, *lines: str, name: str = "r.csv") -> Path:
    path = folder / name
    data = "".join(line + "\n" for line in lines).encode()
    path.write_bytes(gzip.compress(data) if name.endswith(".gz") else data)
    return path


def plain(count: int = 60) -> list[str]:
    return ["t,y", *(f"{k},{1.0 + 0.1 * (k % 5):.1f}" for k in range(count))]


@pytest.mark.parametrize("name", ["r.csv", "r.log.gz", "LOG.TXT"])
def test_record_that_is_accepted_as_it_is(name: str, tmp_path: Path) -> None:
    found = check(specified(tmp_path), written(tmp_path, *plain(), name=name))
    assert found.refusals == {}
    assert re.search(r"r is accepted\n(.|\n)*estimates +60: 60 measured", found.text("r"))


def test_parquet(tmp_path: Path) -> None:
    time = np.delete(np.arange(60.0), [7, 8])
    table = pa.table({"t": time, "y": np.where(time == 20.0, np.nan, 1.0)})
    parquet.write_table(table, tmp_path / "r.parquet")
    found = accepted(tmp_path, specified(tmp_path), tmp_path / "r.parquet")
    assert found.tree["sampling"] == {"period": 1.0, "missing": "skip"}


def test_all_refusals_are_listed_at_once(tmp_path: Path) -> None:
    lines = plain(100)
    lines[6] = "5,OFF"
    lines[7] = "6,OFF"
    lines[11] = "10.1,1.0"
    lines[21] = "19,1.2"
    lines[31] = "30,1.0,7"
    del lines[50:81]
    found = accepted(tmp_path, specified(tmp_path), written(tmp_path, *lines))
    text = found.text("r")
    assert "line 7 of column 'y' is 'OFF'" in text
    assert re.search(r"'OFF', .*file\.missing_values \(2 times\)", text)
    assert "line 32 has 3 cells" in text
    assert "jitter: 0.01 is exceeded in line 12" in text
    assert re.search(r"line 22: the timestamp stands still.*sampling\.repeated", text)
    assert "for longer than sampling.gap, 10 s; sampling.at_gap is refuse" in text
    assert "no key accepts all of this" in text  # of three cells in line 32
    lines[31] = "30,1.0"
    found = accepted(tmp_path, specified(tmp_path), written(tmp_path, *lines))
    assert not found.final
    assert found.tree["file"] == {"missing_values": ["OFF"]}
    assert found.tree["sampling"] == {
        "period": 1.0, "repeated": "first", "jitter": 0.05, "missing": "skip", "at_gap": "coast",
    }  # fmt: skip


@given(
    rows=st.lists(
        st.tuples(st.integers(0, 12), *[st.none() | st.integers(0, 2)] * 2), min_size=1, max_size=20
    )
)
@example(rows=[(k // 2, *([1, None] if k % 2 else [None, 2])) for k in range(20)])
def test_choice_of_rows_that_share_a_timestamp_is_the_users(
    rows: list[tuple[int, int | None, int | None]], tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Each policy is named with what it leaves out, and none is proposed."""
    folder = tmp_path_factory.mktemp("choice")
    rows = [(-1, 0, 0), *sorted(rows, key=lambda row: row[0]), (13, 0, 0)]
    cells = [",".join("" if cell is None else str(cell) for cell in row) for row in rows]
    two = {"measurements": [{"column": "y"}, {"column": "z"}]}
    kalman = {**KALMAN, "C": [[1.0], [1.0]], "R": [1.0, 1.0]}
    chosen = specified(folder, kalman, columns=two)
    text = (found := check(chosen, written(folder, "t,y,z", *cells))).text("r")
    assert "repeated:" not in text
    groups = [[row[1:] for row in rows if row[0] == time] for time in {row[0] for row in rows}]
    if (left_out := len(rows) - len(groups)) == 0:
        assert not found.choices
        return
    lost = {"first": 0, "last": 0, "merge": 0}
    for group in groups:
        for cells_of_one in zip(*group, strict=True):
            known = [cell for cell in cells_of_one if cell is not None]
            for name, kept in (("first", cells_of_one[0]), ("last", cells_of_one[-1]),
                               ("merge", known[0] if known else None)):  # fmt: skip
                lost[name] += sum(cell != kept for cell in known)
    for name in ("first", "last"):
        assert f"  {name}: leaves out {left_out} rows, and {lost[name]} numbers" in text
    refused = f"is refused, as {lost['merge']} numbers differ"
    assert f"  merge: {refused if lost['merge'] else f'puts {left_out} rows into others'}" in text
    assert f"  spread: keeps {left_out} rows" in text


def test_observers_that_cannot_predict_fill_and_restart(tmp_path: Path) -> None:
    lines = plain(100)
    del lines[50:81]
    found = accepted(tmp_path, specified(tmp_path, LEVANT), written(tmp_path, *lines))
    assert found.tree["sampling"]["missing"] == "interpolate"
    assert found.tree["sampling"]["at_gap"] == "restart"


def test_rows_that_go_back_are_counted_and_accepted_by_no_guess(tmp_path: Path) -> None:
    lines = [*plain(), *plain()[1:]]
    found = check(specified(tmp_path), written(tmp_path, *lines))
    assert re.search(r"line 62: the timestamp goes back, at 0 s; .* \(59 times\)", found.text("r"))
    assert found.final
    assert "state columns.time.wrap, if this is a counter that begins again" in found.text("r")
    wrap = {"time": {"column": "t", "wrap": 60.0}}
    assert not check(specified(tmp_path, columns=wrap), tmp_path / "r.csv").refusals
    dates = ["t,y", *(f"2024-03-0{1 + k % 2},1.0" for k in range(60))]
    iso = {"time": {"column": "t", "unit": "iso8601"}}
    found = check(specified(tmp_path, columns=iso), written(tmp_path, *dates))
    assert "no key accepts all of this" in found.text("r")


def test_day_of_times_of_day_is_asked_for(tmp_path: Path) -> None:
    lines = ["t,y", *(f"23:59:{k:02d},1.0" for k in range(60))]
    found = check(specified(tmp_path), written(tmp_path, *lines))
    assert re.search(r"line 2 .*'23:59:00', .*state columns.time.format, .*columns.time.day", (
        found.text("r")
    ))  # fmt: skip
    assert "state columns.time.format and columns.time.day" in found.text("r")
    time = {"time": {"column": "t", "format": "%H:%M:%S", "day": "2024-03-01"}}
    assert not check(specified(tmp_path, columns=time), tmp_path / "r.csv").refusals


def test_row_without_a_time_is_left_out_and_not_resampled(tmp_path: Path) -> None:
    lines = plain()
    lines[7] = "x,1.0"
    found = check(specified(tmp_path), written(tmp_path, *lines))
    (sentence,) = (one for one, _ in found.refusals.values() if "must be a number" in one)
    assert "line 8 of column 't' is 'x'" in sentence
    assert found.final
    assert "uneven" not in found.tree["sampling"]


def test_many_texts_are_no_missing_values(tmp_path: Path) -> None:
    lines = ["t,y", *(f"{k},{chr(65 + k % 26)}{k}" for k in range(60))]
    found = check(specified(tmp_path), written(tmp_path, *lines))
    assert found.final
    assert "file" not in found.tree
    assert re.search(r"and 4\d more", found.text("r"))


def test_period_far_from_the_first_intervals(tmp_path: Path) -> None:
    times = np.concatenate([np.arange(30) * 10.3, 300 + 300.0 * np.arange(1, 80)])
    lines = ["t,y", *(f"{t:.1f},1.0" for t in times)]
    found = accepted(tmp_path, specified(tmp_path), written(tmp_path, *lines))
    assert not found.final


def test_gap_too_long_to_coast_over_restarts(tmp_path: Path) -> None:
    lines = [*plain(), *(f"{5_000_000 + k},1.0" for k in range(60))]
    found = accepted(tmp_path, specified(tmp_path), written(tmp_path, *lines))
    assert found.tree["sampling"]["at_gap"] == "restart"
    assert not found.final


def test_dialect_and_dates_that_nobody_stated(tmp_path: Path) -> None:
    lines = [f"29.02.2024 10:00:{k:02d};{k % 5},5" for k in range(60)]
    found = accepted(tmp_path, specified(tmp_path), written(tmp_path, "Logger", "t;y", *lines))
    assert not found.final
    assert found.tree["file"] == {"skip": 1}
    assert found.tree["columns"]["time"] == {"column": "t", "format": "%d.%m.%Y %H:%M:%S"}


def test_units_are_the_users_to_state(tmp_path: Path) -> None:
    lines = ["t,y (furlings)", *plain()[1:]]
    found = check(specified(tmp_path), written(tmp_path, *lines))
    assert "columns.measurements.0.unit: is missing" in found.text("r")
    assert "state these units" in found.text("r")


def test_constants_and_inputs_that_hold(tmp_path: Path) -> None:
    observer = {**KALMAN, "B": [[0.0, 0.0]]}
    inputs = [{"column": "u", "missing": "hold"}, {"value": 2.0}]
    chosen = specified(tmp_path, observer, columns={"inputs": inputs})
    lines = ["t,y,u", *(f"{k},1.0,{k if k % 9 == 0 else ''}" for k in range(60))]
    lines[10] = "9,1.0,OFF"
    found = accepted(tmp_path, chosen, written(tmp_path, *lines))
    assert found.changed == ["file"]
    assert len(found.refusals) == 1


def test_last_line_that_is_dropped(tmp_path: Path) -> None:
    path = written(tmp_path, *plain())
    with path.open("a") as file:
        file.write("60")
    found = accepted(tmp_path, specified(tmp_path), path)
    assert found.tree["file"] == {"tail": "drop"}
    found = check(specified(tmp_path, file={"tail": "drop"}), written(tmp_path, *plain(), "60,x"))
    assert found.refusals == {}
    lines = [*plain()[:30], "29", *plain()[31:]]
    found = check(specified(tmp_path, file={"tail": "drop"}), written(tmp_path, *lines))
    assert "line 31 has 1 cell," in found.text("r")
    assert len(found.refusals) < 3


def test_truncated_gzip_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path, *plain(40_000), name="r.csv.gz")
    path.write_bytes(path.read_bytes()[:-2000])
    assert main(["estimate", "--check", str(specified(tmp_path)), str(path)]) == 1
    assert "cannot be read" in capsys.readouterr().err


def test_specification_stays_as_it_is(tmp_path: Path) -> None:
    chosen = specified(tmp_path)
    before = chosen.read_bytes()
    check(chosen, written(tmp_path, *plain(), "60,OFF", "61,1.0"))
    assert chosen.read_bytes() == before
    estimate_file(read_specification(chosen), written(tmp_path, *plain()), tmp_path / "e.csv")


@pytest.mark.parametrize("name", LAYOUTS)
def test_suggestion_then_check_runs(name: str, tmp_path: Path) -> None:
    found = suggested(tmp_path, LAYOUTS[name][0])
    time = found.columns.get("time", {}).get("column", "")
    used = {time} if isinstance(time, str) else set(time)
    (column, *_) = [
        title for title, cell in zip(found.titles, found.first, strict=False)
        if title not in used and re.fullmatch(r"[\d.,]+", cell)
    ]  # fmt: skip
    measured = {**found.columns, "measurements": [{"column": column, "unit": "1"}]}
    if "units" in found.file.get("below_header", []):
        measured["measurements"] = [{"column": column}]
    chosen = specified(tmp_path, columns=measured, **({"file": found.file} if found.file else {}))
    assert not accepted(tmp_path, chosen, tmp_path / "r.csv").final


ODD = st.sampled_from(
    ["", "OFF", "1,5", "1.5;2", "inf", "-", "# note", "t,y", "1e999", "0x1F", "12:30", '"a"', "1_0"]
)


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(
    values=st.lists(st.tuples(st.integers(2, 59), ODD), max_size=4),
    times=st.lists(st.tuples(st.integers(2, 59), st.floats(-3.0, 400.0)), max_size=3),
    lost=st.lists(st.integers(2, 58), max_size=20),
    period=st.sampled_from([0.01, 1.0, 60.0]),
    delimiter=st.sampled_from([",", ";", "\t"]),
    style=st.sampled_from(["number", "iso", "day first", "error"]),
    above=st.sampled_from([[], ["Logger 7"], ["# a", "# b"], ["s,1"]]),
    end=st.sampled_from(["\n", "", "\n60", "\n\n", "\n# end\n"]),
    kind=st.sampled_from([KALMAN, LEVANT]),
)
def test_what_a_check_prints_accepts_the_record(
    values: list[tuple[int, str]],
    times: list[tuple[int, float]],
    lost: list[int],
    period: float,
    delimiter: str,
    style: str,
    above: list[str],
    end: str,
    kind: dict[str, Any],
    tmp_path: Path,
) -> None:
    seconds = {k: float(k) for k in range(60)}
    for k, later in times:
        seconds |= {j: seconds[j] + later for j in range(k, 60)}
    cells = {k: f"{1.0 + 0.1 * (k % 5):.1f}" for k in range(60)} | dict(values)
    lines = [*above, f"t{delimiter}y"]
    for k in sorted(set(range(60)) - set(lost)):
        minute, second = divmod(int(abs(seconds[k])) % 3600, 60)
        forms = {
            "iso": f"2024-03-01T10:{minute:02d}:{second:02d}",
            "day first": f"13.03.2024 10:{minute:02d}:{second:02d}",
            "error": f"{seconds[k]:.3f}" if k != 17 else "ERROR",
        }
        lines.append(f"{forms.get(style, f'{seconds[k]:.3f}')}{delimiter}{cells[k]}")
    path = tmp_path / "r.csv"
    path.write_text("\n".join(lines) + end, encoding="utf-8")
    accepted(tmp_path, specified(tmp_path, kind, sampling={"period": period}), path)
