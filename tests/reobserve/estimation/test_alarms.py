"""Alarms: whether, when and how large; none while the observer starts up."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from reobserve.core.validation import parse
from reobserve.estimation.alarms import Alarm
from reobserve.estimation.data_report import AlarmReport, DataReport
from reobserve.estimation.estimate import Estimation
from reobserve.estimation.estimate_command import estimate_file
from reobserve.estimation.specification import Specification, StatedThreshold
from reobserve.estimation.start_up import start_up
from tests.reobserve.estimation.records import read_results, write_record

Array = NDArray[np.float64]

PERIOD = 0.1


def followed(values: Array, sigmas: Array | None = None, **rule: Any) -> AlarmReport:
    """The result of an alarm above 1 in blocks of three rows, which must equal that of one
    block."""
    reports = []
    for size in (3, len(values)):
        report = DataReport(
            alarms={"large": AlarmReport("V", rule.get("start_up", 0.0), threshold=1.0)}
        )
        report.alarms["large"].started = 0.0
        alarm = Alarm(
            StatedThreshold("large", "u", beyond=1.0), 0, None if sigmas is None else 1, PERIOD
        )
        table = np.column_stack([values, values if sigmas is None else sigmas])
        for k in range(0, len(values), size):
            time = PERIOD * np.arange(k, min(k + size, len(values)))
            alarm.raised(time, table[k : k + size], report, {})
        reports.append(report.alarms["large"])
    assert reports[0] == reports[1]
    return reports[0]


def test_interval_has_ends_size_and_peak() -> None:
    values = np.zeros(60)
    values[10:20] = np.linspace(2.0, -3.0, 10)
    sigmas = np.full(60, 0.5)
    found = followed(values, sigmas).summary()
    (one,) = found["intervals"]
    assert (found["first"], found["interval_count"]) == (1.0, 1)
    inside = np.abs(values[10:20]) > 1.0
    assert found["rows"] == inside.sum()
    assert (one["start"], one["end"]) == (1.0, pytest.approx(1.9))
    assert one["mean"] == pytest.approx(values[10:20].mean())
    assert one["standard_deviation"] == pytest.approx(np.std(values[10:20], ddof=1))
    assert (one["sigma"], one["peak"]) == (pytest.approx(0.5), -3.0)


def test_only_long_interruptions_end_an_interval() -> None:
    values = np.zeros(80)
    values[[10, 20, 21, 32, 60]] = 2.0  # nine, none, ten and 27 rows in between
    found = followed(values).summary()
    ends = [(round(10 * one["start"]), round(10 * one["end"])) for one in found["intervals"]]
    assert ends == [(10, 21), (32, 32), (60, 60)]
    assert found["intervals"][0]["mean"] == pytest.approx(6.0 / 12.0)
    assert found["intervals"][1]["standard_deviation"] is None


def test_unlisted_intervals_are_counted() -> None:
    values = np.zeros(20 * 70)
    values[::20] = 2.0
    found = followed(values).summary()
    assert (found["interval_count"], len(found["intervals"]), found["rows"]) == (70, 50, 70)


def test_no_alarm_is_raised_during_start_up() -> None:
    values = np.full(40, 2.0)
    assert followed(values, start_up=1.5).first == pytest.approx(1.5)


@pytest.mark.parametrize("pole", [0.5, 0.9, 0.99, -0.8])
def test_start_up_time_agrees_with_closed_form(pole: float) -> None:
    """For an error that decays by powers of a pole: down to one per cent of its start."""

    def run(y: Array) -> Array:
        return np.column_stack([y[0, 0] * pole ** np.arange(len(y)), np.zeros(len(y))])

    rows = start_up(run, 1, [None, None])
    assert rows.tolist() == [int(np.ceil(np.log(0.01) / np.log(abs(pole)))) + 1, 100]


def luenberger(alarm: dict[str, Any]) -> Specification:
    tree = {
        "observer": {
            "kind": "luenberger", "poles": [0.9], "time": "discrete", "A": [[1.0]],
            "C": [[1.0]], "Q": [1.0], "R": [1.0], "initial_state": [0.0],
        },
        "columns": {
            "time": {"column": "t"}, "measurements": [{"column": "level", "unit": "m"}],
        },
        "sampling": {"period": PERIOD, "missing": "interpolate", "at_gap": "restart"},
        "alarms": [{"name": "off", "of": "residual level", "beyond": 0.2, **alarm}],
    }  # fmt: skip
    return parse(Specification, tree)


@pytest.mark.parametrize("stated", [None, 2.0, 0.0])
def test_wrong_initial_state_raises_no_alarm_but_a_step_does(
    stated: float | None, tmp_path: Path
) -> None:
    """An observer with its pole at 0.9 starts 5 m off; the level steps by 1 m at 20 s."""
    level = np.where(np.arange(400) < 200, 5.0, 6.0)
    gap = np.ones(400, dtype=bool)
    gap[300:330] = False  # after which the observer restarts
    time = PERIOD * np.arange(400)
    columns = {"t": time, "level": level}
    chosen = luenberger({} if stated is None else {"start_up": stated})
    record = write_record(tmp_path / "r.csv", {name: one[gap] for name, one in columns.items()})
    estimate_file(chosen, record, tmp_path / "e.csv", report=tmp_path / "r.json")
    found, _ = read_results(tmp_path / "e.csv")
    reported = json.loads((tmp_path / "r.json").read_text())["alarms"]["off"]
    expected = 4.5 if stated is None else stated  # 0.9^44 is below one per cent
    assert reported["start_up"] == pytest.approx(expected)
    starts = [0.0, 33.0]
    early = np.any(
        [(found["time"] > at - 1e-6) & (found["time"] < at + expected - 1e-6) for at in starts],
        axis=0,
    )
    assert np.isnan(found["alarm off"]).tolist() == early.tolist()
    if stated is None:
        assert reported["first"] == pytest.approx(20.0)
        (one,) = reported["intervals"]
        last = 200 + np.flatnonzero(0.9 ** np.arange(50) > 0.2)[-1]
        assert one["end"] == pytest.approx(PERIOD * last)
    else:
        assert reported["first"] == pytest.approx(stated)


def test_start_up_is_derived_only_if_not_specified() -> None:
    made = Estimation(luenberger({"start_up": 1.0}), ["t", "level"], "r")
    assert made.start_up is None
    assert Estimation(luenberger({}), ["t", "level"], "r").start_up == pytest.approx([4.5] * 2)
