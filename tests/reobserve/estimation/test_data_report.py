"""The data report on the terminal: one line for each finding, and no others."""

from __future__ import annotations

import numpy as np
import pytest

from reobserve.estimation.data_report import (
    MOST_LISTED,
    AlarmReport,
    DataReport,
    Interval,
    follow,
)
from reobserve.estimation.report_table import as_table


def test_report_of_a_complete_record_has_four_lines() -> None:
    report = DataReport(rows=101, first=0.0, last=1.0, intervals=100, estimates=101)
    assert as_table(report, 0.01).splitlines() == [
        "  rows read        101",
        "  time             0 to 1 s",
        "  sampling period  0.01 s, timestamps say 0.01 s on average",
        "  estimates        101",
    ]


def test_first_gaps_are_listed_and_all_are_counted() -> None:
    report = DataReport(rows=700, first=0.0, last=9.9, intervals=690, lost=300, estimates=690)
    for k in range(MOST_LISTED + 10):
        report.open_gap(float(k))
        report.close_gap(k + 0.5)
    assert len(report.gaps) == MOST_LISTED
    report.restarts, report.repeated, report.jitter = 60, 2, 0.25
    report.count(report.missing, "speed", 3)
    report.count(report.missing, "current", 0)
    report.statuses = {"measured": 630, "restarted": 60}
    report.warnings.append("one")
    assert [line.split("  ")[-1].strip() for line in as_table(report, 0.01).splitlines()[3:]] == [
        "25 % of a period", "300", "2", "speed 3",
        *(f"{k} s to {k}.5 s" for k in range(5)), str(MOST_LISTED + 10), "60",
        "690: 630 measured, 60 restarted", "warning: one",
    ]  # fmt: skip


def test_report_lists_alarms() -> None:
    odd = AlarmReport("rad/s", 0.5, True, 0.75, rows=4, first=1.5, learned=40, mean=0.25)
    odd.current = Interval(1.5, 1.8)
    for value in (1.0, 2.0, -3.0, 2.0):
        odd.current.add(value, 0.25, odd.excess)
    quiet = AlarmReport("1", 0.0, threshold=0.5)
    early = AlarmReport("V", 0.0, True)
    blind = AlarmReport("V", 0.0, True, learned=1, ready=True)
    listed = {"odd": odd, "quiet": quiet, "early": early, "blind": blind}
    report = DataReport(rows=1, alarms=listed)
    assert [line.split("  ")[-1].strip() for line in as_table(report, 0.1).splitlines()[2:]] == [
        "once, 4 rows, first at 1.5 s; threshold 0.75 rad/s from the mean 0.25, both of 40 values; "
        "start-up 0.5 s",
        "1.5 to 1.8 s: mean 0.5 rad/s, standard deviation 2.4 (by the observer 0.25), "
        "peak -3 rad/s",
        "none; threshold 0.5",
        "no threshold: 0 values until the end of the stretch that sets it",
        "no threshold: 1 values until the end of the stretch that sets it",
    ]


def test_epoch_timestamps_are_reported_with_their_digits() -> None:
    report = DataReport(rows=2, first=0.25, last=1.75, shift=1774749598)
    report.open_gap(0.5)
    reported = as_table(report, 0.1)
    assert "1774749598.25 to 1774749599.75 s" in reported
    assert "1774749598.5 s to the end" in reported


def test_rows_of_which_an_alarm_is_unknown_are_not_in_its_interval() -> None:
    found = AlarmReport("m", 0.0)
    values, raised = np.array([50.0, 500.0, 45.0, 60.0]), np.array([1.0, np.nan, 0.0, 1.0])
    follow(np.arange(4.0), values, np.array([1.0, 1e3, 1.0, 1.0]), raised, found, 1.0)
    assert found.current is not None
    assert found.current.summary() == {
        "start": 0.0, "end": 3.0, "mean": pytest.approx(155.0 / 3.0), "peak": 60.0,
        "standard_deviation": pytest.approx(np.std([50.0, 45.0, 60.0], ddof=1)), "sigma": 1.0,
    }  # fmt: skip
