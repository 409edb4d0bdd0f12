"""Slots in all gaps together are counted, and the period is compared, before any is filled."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reobserve.core.errors import InputError
from reobserve.estimation.estimate import Estimation
from reobserve.estimation.estimate_command import estimate_file
from reobserve.estimation.row_by_row import RowByRow
from reobserve.estimation.state_file import load_state, save_state
from reobserve.estimation.writing import header
from tests.reobserve.estimation.records import specification, streamed

TITLES = ["t", "speed", "current", "voltage"]


def record(path: Path, times: list[int]) -> Path:
    """A record with timestamps in periods of 10 ms."""
    rows = [f"{10 * time},0.1,0.2,0.3\n" for time in times]
    path.write_text(",".join(TITLES) + "\n" + "".join(rows), encoding="utf-8")
    return path


def spread(rows: int, gaps: int, length: int) -> list[int]:
    """Times with gaps in which so many samples are lost, the first after 30 rows."""
    steps = np.ones(rows, dtype=int)
    steps[30 : 30 + 3 * gaps : 3] = 1 + length
    return [int(time) for time in np.cumsum(steps)]


@pytest.mark.parametrize(("gaps", "length", "filled"), [(2, 500_066, False), (2, 2_000, True)])
def test_slots_of_all_gaps_are_counted_together(
    gaps: int, length: int, filled: bool, tmp_path: Path
) -> None:
    text = record(tmp_path / "r.csv", spread(130, gaps, length))
    chosen = specification("kalman")
    if filled:
        made = estimate_file(chosen, text, tmp_path / "e.csv")
        assert made.report.estimates == 130 + gaps * length
        return
    said = (
        rf"^sampling.at_gap: coast would fill {gaps * length} sampling periods of 0.01 s in the "
        r"gaps of .*; 1000000 and 1 for each row are the most; restart fills none$"
    )
    for block in (200, 10**6):
        with pytest.raises(InputError, match=said):
            estimate_file(chosen, text, tmp_path / "e.csv", block=block)
        assert not (tmp_path / "e.csv").exists()


def test_restart_bridges_no_long_gap(tmp_path: Path) -> None:
    text = record(tmp_path / "r.csv", spread(130, 24, 990_000))
    chosen = specification("kalman", sampling={"at_gap": "restart"})
    made = estimate_file(chosen, text, tmp_path / "e.csv")
    assert made.report.restarts == 24
    assert made.report.estimates < 130 + 24 * 15


def test_rows_may_be_resampled_ten_times_finer(tmp_path: Path) -> None:
    """And to no more in all than a million and ten a row."""
    text = record(tmp_path / "r.csv", list(range(2000)))
    sampling = {"period": 0.00101, "uneven": "linear", "missing": "interpolate", "gap": 0.1}
    made = estimate_file(specification("kalman", sampling=sampling), text, tmp_path / "e.csv")
    assert made.report.estimates == int(19.99 / 0.00101) + 1
    many = record(tmp_path / "m.csv", spread(130, 3, 399_999))
    sampling = {**sampling, "period": 0.01, "gap": 1e5}
    with pytest.raises(InputError, match=r"^sampling.at_gap: coast would fill 1199\d\d\d sampl"):
        estimate_file(specification("kalman", sampling=sampling), many, tmp_path / "m2.csv")
    sampling |= {"at_gap": "restart"}
    with pytest.raises(InputError, match=r"^sampling.gap: 100000 s would fill 1199\d\d\d sampling"):
        estimate_file(specification("kalman", sampling=sampling), many, tmp_path / "m2.csv")


def read(reader: RowByRow, lines: list[str], out: list[str]) -> None:
    for line in lines:
        out.append(reader.read(line))  # noqa: PERF401
    reader.finish()


@pytest.mark.parametrize("period", [1e-8, 1e-5, 5e-3])
def test_stream_compares_the_period_before_it_fills(period: float, tmp_path: Path) -> None:
    text = record(tmp_path / "r.csv", list(range(30)))
    chosen = specification("kalman", sampling={"period": period})
    for rows in (30, 21):
        lines = text.read_text(encoding="utf-8").splitlines(keepends=True)[1:rows]
        reader = RowByRow(Estimation(chosen, TITLES, "r"), TITLES)
        out: list[str] = []
        with pytest.raises(InputError, match=r"^sampling.period: .* disagrees with the timestamps"):
            read(reader, lines, out)
        assert len("".join(out)) < 20_000


@pytest.mark.parametrize("stop", [0, 7, 12, 40])
def test_rows_that_wait_for_the_period_give_the_results_of_the_file(
    stop: int, tmp_path: Path
) -> None:
    """With a gap of 500 periods after the second row, and a stop of the stream while rows wait."""
    text = record(tmp_path / "r.csv", [0, 1, *range(501, 560)])
    chosen = specification("kalman")
    estimate_file(chosen, text, tmp_path / "e.csv")
    expected = (tmp_path / "e.csv").read_text(encoding="utf-8")
    assert streamed(chosen, text) == expected
    lines = text.read_text(encoding="utf-8").splitlines(keepends=True)[1:]
    estimation = Estimation(chosen, TITLES, "r")
    out, rows = header(estimation.titles), RowByRow(estimation, TITLES)
    for k, line in enumerate(lines):
        if k == stop:
            rows.settle()
            save_state(tmp_path / "s.json", estimation, "d", None)
            estimation = Estimation(chosen, TITLES, "r")
            load_state(tmp_path / "s.json", estimation, "d")
            rows = RowByRow(estimation, TITLES)
        out += rows.read(line)
    assert out + rows.finish() == expected


def test_record_that_ends_while_rows_wait_is_estimated(tmp_path: Path) -> None:
    text = record(tmp_path / "r.csv", [0, 1, 2, 503, 504])
    chosen = specification("kalman")
    made = estimate_file(chosen, text, tmp_path / "e.csv")
    assert made.report.estimates == 505
    assert streamed(chosen, text) == (tmp_path / "e.csv").read_text(encoding="utf-8")
