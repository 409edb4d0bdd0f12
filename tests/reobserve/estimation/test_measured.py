"""A measured record: a bank that uses only the compass, compared with the gyroscope."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from reobserve.cli.main import main
from tests import ROOT
from tests.reobserve.estimation.records import read_results

MEASURED = ROOT / "examples/measured"


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
