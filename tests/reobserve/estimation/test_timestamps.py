"""Timestamps may deviate from the grid by `jitter`; otherwise the message names the value."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.estimation.data_report import DataReport
from reobserve.estimation.estimate_command import estimate_file
from reobserve.estimation.families.examples import simulated
from reobserve.estimation.sampling_grid import UnevenError, least_jitter
from reobserve.estimation.timestamps import Timestamps
from tests.reobserve.estimation.records import record_at, specification, write_record

Array = NDArray[np.float64]

PERIOD = 0.01


def read(time: Array, **sampling: Any) -> tuple[Array, DataReport]:
    """The grid positions of timestamps in blocks of seven, and their report."""
    report = DataReport()
    stated = specification("kalman", sampling={"period": PERIOD, **sampling}).sampling
    made = Timestamps(stated, report, "r.csv")
    parts = [
        made.read(time[k : k + 7], np.zeros((len(time[k : k + 7]), 1)))[2]
        for k in range(0, len(time), 7)
    ]
    return np.concatenate(parts), report


def jittered(seed: int, most: float, rows: int = 2000) -> Array:
    """Timestamps up to ``most`` periods off the grid, including both extremes."""
    off = np.random.default_rng(seed).uniform(-most, most, rows)
    off[[rows // 4, rows // 4 + 1]] = most, -most
    times: Array = 3.0 + PERIOD * (np.arange(rows) + off)
    return times


@pytest.mark.parametrize("seed", range(10))
def test_timestamps_are_accepted_up_to_the_jitter(seed: int) -> None:
    """For any offset of the first one, which does not define the grid."""
    time = jittered(seed, 0.38)
    slots, report = read(time, jitter=0.4)
    assert np.array_equal(slots, time)
    assert report.lost == 0
    assert report.jitter == pytest.approx(0.38, abs=0.002)
    with pytest.raises(UnevenError):
        read(jittered(seed, 0.42), jitter=0.4)
    assert least_jitter([time[:100], time[100:]], PERIOD)[0] == 0.38


def test_mean_interval_leaves_out_gaps_of_a_resampled_record() -> None:
    """The logger's clock is slow by 0.2 %, and stands still for an hour."""
    step = 1.002 * PERIOD
    time = np.arange(400) * step + 3600.0 * (np.arange(400) >= 200)
    _, report = read(time, uneven="linear", missing="skip", at_gap="restart")
    assert report.mean_interval == pytest.approx(step, rel=1e-9)


def test_single_shifted_timestamp_is_counted_once() -> None:
    """Not in both adjacent intervals."""
    time = PERIOD * np.arange(100.0)
    time[50] += 0.3 * PERIOD
    _, report = read(time, jitter=0.16)
    assert report.jitter == pytest.approx(0.15, abs=0.002)  # of a grid in the middle
    with pytest.raises(UnevenError):
        read(time, jitter=0.14)


def test_lost_rows_are_counted_between_jittered_ones() -> None:
    time = jittered(3, 0.3)
    kept = np.ones(len(time), dtype=bool)
    kept[[100, 400, 401, 900]] = False
    kept[1200:1260] = False
    slots, report = read(time[kept], jitter=0.35, missing="skip", gap=1.0)
    assert report.lost == 64
    assert np.rint((slots - 3.0) / PERIOD).astype(int).tolist() == list(range(len(time)))


def test_clock_drift_below_0_1_percent_is_accepted() -> None:
    slots, report = read(PERIOD * 1.0008 * np.arange(5000.0))
    assert (len(slots), report.lost) == (5000, 0)
    with pytest.raises(UnevenError):
        read(PERIOD * 1.002 * np.arange(5000.0))


def refused(time: Array, tmp_path: Path, **sampling: Any) -> str:
    columns = record_at(simulated("kalman"), np.clip(time, 0.0, 10.0))
    record = write_record(tmp_path / "r.csv", {**columns, "t": 1000.0 * time})
    stated = {"period": PERIOD, "missing": "refuse", "at_gap": "refuse", **sampling}
    with pytest.raises(InputError) as error:
        estimate_file(specification("kalman", sampling=stated), record, tmp_path / "e.csv")
    return str(error.value)


def test_refusal_names_the_jitter_that_would_accept_the_record(tmp_path: Path) -> None:
    time = jittered(4, 0.38, 900) - 3.0
    time[0] = 0.0
    said = refused(time, tmp_path)
    assert said.startswith(f"sampling.jitter: 0.01 is exceeded in line 4 of {tmp_path}/r.csv: its ")
    least = float(said.partition("stamped late, ")[2].partition(" accepts the record")[0])
    assert least in (0.38, 0.39)
    record, out = tmp_path / "r.csv", tmp_path / "e.csv"
    stated = {"period": PERIOD, "missing": "refuse", "at_gap": "refuse"}
    chosen = specification("kalman", sampling={**stated, "jitter": least})
    assert estimate_file(chosen, record, out).report.jitter <= least
    lower = specification("kalman", sampling={**stated, "jitter": least - 0.02})
    with pytest.raises(UnevenError):
        estimate_file(lower, record, out)


def test_record_without_a_time_grid_is_refused_suggesting_resampling(tmp_path: Path) -> None:
    steps = np.random.default_rng(1).uniform(0.2, 1.8, 500)
    said = refused(PERIOD * np.cumsum(steps), tmp_path)
    assert "no jitter below 0.5 accepts the record" in said
    assert "sampling.uneven: linear, previous or pchip resamples them" in said


def test_slightly_wrong_period_is_reported(tmp_path: Path) -> None:
    said = refused(1.003 * PERIOD * np.arange(900.0), tmp_path)
    assert said.startswith("sampling.period: 0.01 s disagrees with the timestamps of ")
    assert said.endswith("which go on by 0.01003 s on average")
