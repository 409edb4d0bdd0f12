"""The measured record: what a bank says by the compass alone against the gyroscope."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from reobserve.cli import main
from tests.own_data.records import read_results

MEASURED = Path(__file__).parents[2] / "examples/measured"


def test_a_compass_tells_when_the_sensor_turns(tmp_path: Path) -> None:
    estimates, report = tmp_path / "estimates.csv", tmp_path / "report.json"
    record = [str(MEASURED / f"turning.{kind}") for kind in ("yaml", "csv")]
    assert main(["estimate", *record, "--out", str(estimates), "--report", str(report)]) == 0
    found, status = read_results(estimates)
    assert {"filled", "predicted"} <= set(status) <= {"measured", "filled", "predicted"}

    seen = pd.read_csv(MEASURED / "turning.csv").to_numpy()
    time, rate = seen[:, 0], np.radians(seen[:, 1])
    fast = time[rate > np.radians(100)]
    time_of, probability = found["time"], found["probability_turning"]
    told = time_of[probability > 0.5]
    assert told[0] == pytest.approx(fast[0], abs=0.25)
    assert told[-1] == pytest.approx(fast[-1], abs=0.25)
    settled = (time_of > fast[0] + 0.5) & (time_of < fast[-1] - 0.5)
    assert probability[settled].min() > 0.9
    assert probability[(time_of < fast[0] - 0.5) | (time_of > fast[-1] + 0.5)].max() < 0.5

    heading = np.unwrap(np.arctan2(found["field_y"], found["field_x"]))
    turned = np.trapezoid(rate, time)
    assert heading[0] - heading[-1] == pytest.approx(turned, rel=0.01)  # it turns the field back

    alarm = json.loads(report.read_text())["alarms"]["turning"]
    assert alarm["first"] == pytest.approx(fast[0], abs=0.25)
