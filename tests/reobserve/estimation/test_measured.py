"""A measured record: a bank that uses only the compass, compared with the gyroscope."""

from __future__ import annotations

import json
import shutil
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from reobserve.cli.main import main
from reobserve.tuning.intervals import interval
from reobserve.tuning.recorded import RecordedTask
from reobserve.tuning.scoring import Cell, ScoredRow, Scorer
from tests import ROOT
from tests.reobserve.estimation.records import read_results

MEASURED = ROOT / "examples/measured"

# What `reobserve tune` finds, by the names of candidates and the ends of keys.
TURNS: Mapping[str, Mapping[str, float]] = {
    "kalman": {"Q.1": 510}, "acceleration": {"Q.2": 8.7e3},
    "kalman_R": {"Q.1": 429, "noise_memory": 22.4},
    "bank": {"drift": 269, "jump": 133, "jump_rate": 0.0652, "jump_time": 2.95},
    "bank_R": {
        "drift": 287, "jump": 113, "jump_rate": 0.0764, "jump_time": 2.39, "noise_memory": 2.2,
    },
    "smoothed": {"Q.1": 65.4},
}  # fmt: skip
WITH_RESTS: Mapping[str, Mapping[str, float]] = {
    "kalman": {"Q.1": 287}, "acceleration": {"Q.2": 5.09e3},
    "kalman_R": {"Q.1": 245, "noise_memory": 17.0},
    "bank": {"drift": 251, "jump": 126, "jump_rate": 0.0297, "jump_time": 1.85},
    "bank_R": {
        "drift": 230, "jump": 139, "jump_rate": 0.00449, "jump_time": 3.33, "noise_memory": 3.82,
    },
    "smoothed": {"Q.1": 39.5},
}  # fmt: skip


def test_compass_bank_detects_sensor_rotation(tmp_path: Path) -> None:
    estimates, report = tmp_path / "estimates.csv", tmp_path / "report.json"
    record = [str(MEASURED / f"turning.{kind}") for kind in ("yaml", "csv")]
    assert main(["estimate", *record, "--out", str(estimates), "--report", str(report)]) == 0
    found, status = read_results(estimates)
    assert Counter(status) == {"measured": 390, "filled": 5, "predicted": 4}

    seen = pd.read_csv(MEASURED / "turning.csv").to_numpy()
    time, rate = seen[:, 0], seen[:, 1]
    fast = time[rate > 100.0]
    assert (fast[0], fast[-1]) == pytest.approx((65.77, 70.88), abs=0.005)
    time_of, probability = found["time"], found["probability_turning"]
    assert instants(time_of, probability > 0.9) == pytest.approx((65.88, 70.88, 4), abs=0.005)
    assert instants(time_of, probability > 0.5) == pytest.approx((65.83, 71.08, 4), abs=0.005)

    heading = np.degrees(np.unwrap(np.arctan2(found["field_y"], found["field_x"])))
    turned = np.trapezoid(rate, time)
    assert turned == pytest.approx(1035.6, abs=0.05)
    assert heading[0] - heading[-1] == pytest.approx(turned, abs=2.0)  # it reverses the field

    alarm = json.loads(report.read_text())["alarms"]["turning"]
    assert (alarm["first"], alarm["rows"]) == (pytest.approx(65.88, abs=0.005), 100)


def instants(time: Any, raised: Any) -> tuple[float, float, int]:
    """When it is first and last raised, and how often it switches."""
    reported = time[raised]
    return reported[0], reported[-1], int(np.count_nonzero(np.diff(raised)))


def test_heading_is_the_negative_angle_of_the_magnetometer() -> None:
    both = pd.merge(
        pd.read_csv(MEASURED / "heading.csv"), pd.read_csv(MEASURED / "turning.csv"), on="Time (s)"
    )
    assert len(both) == 401
    angle = np.unwrap(np.arctan2(both["Magnetometer Y (uT)"], both["Magnetometer X (uT)"]))
    assert both["Heading (deg)"].to_numpy() == pytest.approx(-np.degrees(angle), abs=0.005)


def scored(file: Path, found: Mapping[str, Mapping[str, float]]) -> dict[str, Cell]:
    """Scores with settings as found, among those of all candidates as specified."""
    task = RecordedTask.read(file)
    rows = [
        ScoredRow.of(name, "tuned", {f"observer.{key}": one for key, one in settings.items()})
        for name, settings in found.items()
        if name in task.methods
    ]
    for name, method in task.methods.items():
        assert method.paper is not None
        rows.append(ScoredRow.of(name, "paper", method.paper.settings))
    cells = Scorer(task).compared(rows, task.table[0])
    return {cell.row.method: cell for cell in cells if cell.row.training == "tuned"}


@pytest.mark.parametrize(
    ("file", "found", "errors", "smoothed", "smaller"),
    [
        ("tune", TURNS, (0.214, 0.228, 0.215, 0.226, 0.233, 0.137), (0.66, 0.39, 1.23), 8),
        ("tune_with_rests", WITH_RESTS, (0.207, 0.222, 0.208, 0.221, 0.224, 0.119),
         (0.61, 0.44, 0.87), 7),
    ],
)  # fmt: skip
def test_readme_states_which_observer_is_how_good(
    file: str, found: Mapping[str, Mapping[str, float]], errors: tuple[float, ...],
    smoothed: tuple[float, ...], smaller: int,
) -> None:  # fmt: skip
    cells = scored(MEASURED / f"{file}.yaml", found)
    for name, error in zip(found, errors, strict=True):
        assert cells[name].error[0] == pytest.approx(error, abs=0.0006), name
    assert {cells[name].within for name in found} == {"undecided", "late"}
    assert cells["smoothed"].ratio == pytest.approx(smoothed, abs=0.01)
    pairs = zip(cells["smoothed"].scores, cells["kalman"].scores, strict=True)
    assert sum(one.error < causal.error for one, causal in pairs) == smaller


def test_turns_rise_and_fall_in_several_samples() -> None:
    time, rate = pd.read_csv(MEASURED / "heading.csv").to_numpy()[:, :2].T
    found = []
    for since, until in ((44, 46), (49, 52), (54, 56), (65, 72)):
        inside = (time >= since) & (time < until)
        of, part = time[inside], np.abs(rate[inside])
        top = 200.0 if until == 72 else part.max()  # the fast turn overshoots
        high = np.flatnonzero(part > 0.9 * top)
        low = np.flatnonzero(part < 0.1 * top)
        found += [
            of[high[0]] - of[low[low < high[0]][-1]],
            of[low[low > high[-1]][0]] - of[high[-1]],
        ]
    assert (min(found), max(found)) == pytest.approx((0.3, 0.9), abs=0.05)


def ratio(one: Cell, other: Cell) -> tuple[float, ...]:
    """The ratio of two errors on the same segments, with its interval."""
    logs = [np.log([score.error for score in cell.scores]) for cell in (one, other)]
    return interval(logs[0] - logs[1])


def test_readme_states_what_estimating_the_noise_costs_and_saves(tmp_path: Path) -> None:
    right = scored(MEASURED / "tune_with_rests.yaml", WITH_RESTS)
    costs = [
        ratio(cells[f"{name}_R"], cells[name])[0]
        for cells in (right, scored(MEASURED / "tune.yaml", TURNS))
        for name in ("kalman", "bank")
    ]
    assert (min(costs), max(costs)) == pytest.approx((1.005, 1.032), abs=0.001)

    def with_noise(scale: float) -> dict[str, Cell]:
        shutil.copytree(MEASURED, tmp_path, dirs_exist_ok=True)
        for name in WITH_RESTS:
            text = (MEASURED / f"{name}.yaml").read_text(encoding="utf-8")
            (tmp_path / f"{name}.yaml").write_text(text.replace("R: 1.2 ", f"R: {1.2 * scale} "))
        return scored(tmp_path / "tune_with_rests.yaml", WITH_RESTS)

    small, large = with_noise(1 / 9), with_noise(9)
    for name, error, saved in (
        ("kalman", 0.244, (0.945, 0.901, 0.991)), ("bank", 0.278, (0.936, 0.838, 1.047)),
    ):  # fmt: skip
        assert small[name].error[0] == pytest.approx(error, abs=0.0006)
        assert ratio(small[f"{name}_R"], small[name]) == pytest.approx(saved, abs=0.002)
        lost = small[name].error[0] - right[name].error[0]
        assert small[name].error[0] - small[f"{name}_R"].error[0] == pytest.approx(
            lost / 3, rel=0.1
        )
        for one, other in ((name, name), (f"{name}_R", name), (f"{name}_R", f"{name}_R")):
            _, low, high = ratio(large[one], right[other])
            assert low < 1 < high
