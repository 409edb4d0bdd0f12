"""Results as text: the same bytes a column at a time and row by row, and fewer digits if stated."""

from __future__ import annotations

import io
import math
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as parquet
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reobserve.cli.main import main
from reobserve.core.progress import progress
from reobserve.estimation import writing
from reobserve.estimation.data_report import DataReport
from reobserve.estimation.estimate import Estimated, Estimation
from reobserve.estimation.estimate_command import estimate_file
from reobserve.estimation.families.examples import simulated
from reobserve.estimation.gaps import STATUSES
from reobserve.estimation.record_file import File
from reobserve.estimation.row_by_row import RowByRow
from tests.reobserve.estimation.records import specification, write_record

RNG = np.random.default_rng(5)
RECORD = {name: values[:300] for name, values in simulated("kalman").record().items()}
NUMBERS = st.one_of(
    st.floats(),
    st.floats(-10.0, 10.0),
    st.integers(-(10**6), 10**6).map(float),
    st.builds(lambda m, e: m * 10.0**e, st.integers(-(10**8), 10**8), st.integers(-13, 6)),
    st.builds(lambda m, e: (m + 0.5) * 10.0**e, st.integers(-999, 999), st.integers(-6, 6)),
    st.builds(lambda e, up: float(np.nextafter(10.0**e, up)), st.integers(-6, 18),
              st.sampled_from([0.0, 1e300])),
    st.integers(-40, 60).map(lambda e: 2.0**e),
)  # fmt: skip


def block(numbers: list[float]) -> Estimated:
    rows = len(numbers)
    alarms = np.array([[(0.0, 1.0, math.nan)[k % 3]] for k in range(rows)])
    status = np.array([k % len(STATUSES) for k in range(rows)], dtype=np.int8)
    columns = np.column_stack([numbers, numbers[::-1]])
    return Estimated(np.arange(rows) / 100, columns, alarms, status)


def by_row(rows: Estimated, report: DataReport, digits: int | None) -> str:
    parts = zip(
        map(report.stamp, rows.time.tolist()), rows.numbers.tolist(), rows.alarms.tolist(),
        rows.status.tolist(), strict=True,
    )  # fmt: skip
    return "".join(writing.line(*part, digits) for part in parts)


REPORTS = {
    "seconds": DataReport(period=0.01), "epoch": DataReport(period=0.01, shift=1_772_460_300),
    "UTC": DataReport(period=0.01, origin=1_772_460_300, zone="UTC"),
    "zone": DataReport(period=1.0, origin=1_774_745_999, zone="Europe/Berlin"),
    "changed": DataReport(period=0.01, origin=1_774_745_999, zone="Europe/Berlin"),
}  # fmt: skip


@pytest.mark.nightly
@settings(max_examples=400, deadline=None)
@given(
    st.lists(NUMBERS, min_size=1, max_size=8),
    st.sampled_from([None, *range(1, 18)]),
    st.sampled_from(list(REPORTS)),
)
def test_columns_at_once_are_the_rows(numbers: list[float], digits: int | None, clock: str) -> None:
    rows, report = block(numbers * 60), REPORTS[clock]
    assert writing.text(rows, report, digits) == by_row(rows, report, digits)


def test_many_numbers_are_spelled_as_python_spells_them() -> None:
    exponents = np.repeat(np.arange(-8, 18), 400)
    numbers = RNG.normal(size=len(exponents)) * 10.0**exponents
    for digits in (None, 1, 2, 3, 6, 9, 10, 11, 15, 17):
        rows = block([*numbers, *np.round(numbers, 3)])
        report = REPORTS["seconds"]
        assert writing.text(rows, report, digits) == by_row(rows, report, digits)


def test_shortest_form_is_known() -> None:
    numbers = [0.1, 1.0, 1e-5, 1 / 3, math.nan, -2.5e9, 123456.789, *[0.25] * 60]
    cells = [line.split(",")[1] for line in writing.text(block(numbers), DataReport()).splitlines()]
    known = ["0.1", "1.0", "1e-05", "0.3333333333333333", "", "-2500000000.0", "123456.789"]
    assert cells[:8] == [*known, "0.25"]
    lines = writing.text(block(numbers), DataReport(), 3).splitlines()
    known = ["0.1", "1", "1e-05", "0.333", "", "-2.5e+09", "1.23e+05"]
    assert [line.split(",")[1] for line in lines[:8]] == [*known, "0.25"]


@pytest.mark.parametrize("digits", [1, 6, 17])
def test_fewer_digits_are_those_of_the_numbers_in_files_and_streams(
    digits: int, tmp_path: Path
) -> None:
    record, chosen = write_record(tmp_path / "r.csv", RECORD), specification("kalman")
    estimate_file(chosen, record, tmp_path / "all.csv")
    estimate_file(chosen, record, tmp_path / "e.csv", digits=digits)
    title, *lines = (tmp_path / "e.csv").read_text().splitlines(keepends=True)
    numbers = [k for k, name in enumerate(title.split(",")) if name.startswith("speed")]
    for line, other in zip(lines, (tmp_path / "all.csv").read_text().splitlines()[1:], strict=True):
        cells, exact = line.strip().split(","), other.split(",")
        assert [cells[0], cells[-1]] == [exact[0], exact[-1]]
        assert [cells[k] for k in numbers] == [f"{float(exact[k]):.{digits}g}" for k in numbers]
    estimation = Estimation(chosen, list(RECORD), "r.csv")
    rows = RowByRow(estimation, list(RECORD), digits)
    text = record.read_text().splitlines(keepends=True)[1:]
    assert "".join(map(rows.read, text)) + rows.finish() == "".join(lines)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--digits 0 --out e.csv", "--digits: 0 must be a whole number from 1 to 17"),
        ("--digits 18 --stream", "--digits: 18 must be a whole number from 1 to 17"),
        ("--digits 6 --out e.parquet", "--digits: is for text, such as .csv; e.parquet has all"),
    ],
)
def test_digits_that_cannot_be_are_refused(
    options: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    assert main(["estimate", "--example", "kalman", "--out", "s.yaml", "--data", "r.csv"]) == 0
    given_ = ["estimate", "s.yaml", *([] if "--stream" in options else ["r.csv"])]
    assert main([*given_, *options.split()]) == 1
    assert message in capsys.readouterr().err
    assert not list(tmp_path.glob("e.*"))
    assert main(["estimate", "s.yaml", "r.csv", "--out", "e.csv", "--digits", "4"]) == 0
    line = Path("e.csv").read_text(encoding="utf-8").splitlines()[9]
    assert all(len(cell.lstrip("-0.")) <= 9 for cell in line.split(",")[1:-1])


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("ending", [".csv", ".csv.gz", ".csv.zst", ".parquet"])
def test_share_that_was_read_grows_to_all_of_it(ending: str, tmp_path: Path) -> None:
    count = 20_000
    columns = {"t": np.arange(count) / 100, "y": RNG.normal(size=count)}
    record = tmp_path / f"r{ending}"
    if ending == ".parquet":
        parquet.write_table(pa.table(columns), record)
    else:
        text = write_record(tmp_path / "text.csv", columns).read_bytes()
        with pa.output_stream(str(record)) as stream:
            stream.write(text)
    shares = list[float]()
    blocks = File(record, block=2**14).blocks(["t", "y"], tell=shares.append)
    assert sum(map(len, blocks)) == count
    assert len(shares) > 10
    assert shares == sorted(shares)
    assert shares[0] < 0.5
    assert shares[-1] == 1.0


def test_parquet_is_never_completely_in_memory(tmp_path: Path) -> None:
    count = 2_000_000
    record = tmp_path / "r.parquet"
    parquet.write_table(pa.table({"y": RNG.normal(size=count)}), record, row_group_size=count)
    pool = pa.system_memory_pool()
    default, most = pa.default_memory_pool(), 0
    pa.set_memory_pool(pool)
    try:
        for _ in File(record, block=2**18).blocks(["y"]):
            most = max(most, pool.bytes_allocated())
    finally:
        pa.set_memory_pool(default)
    assert record.stat().st_size > 8 * count
    assert most < 4 * count


def test_progress_is_shown_on_a_terminal_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    record = write_record(tmp_path / "r.csv", RECORD)
    estimate_file(specification("kalman"), record, tmp_path / "e.csv")
    assert capsys.readouterr().err == ""
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    size = record.stat().st_size
    estimate_file(specification("kalman"), record, tmp_path / "again.csv", block=size // 2 + 1)
    found = [part for part in terminal.getvalue().split("\r") if part]
    assert found[-1] == "r.csv: 100% read \n"
    assert len(found) == 2
    assert (tmp_path / "again.csv").read_bytes() == (tmp_path / "e.csv").read_bytes()


def test_line_of_progress_ends_before_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)

    def fails() -> None:
        with progress("{} of 2") as tell:
            tell(1)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fails()
    assert terminal.getvalue() == "\r1 of 2 \n"
