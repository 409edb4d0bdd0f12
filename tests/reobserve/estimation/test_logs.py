"""Three logs with one fault each: detected, timed and sized without tuning."""

from __future__ import annotations

import json
import subprocess
import sys
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest

from reobserve.cli.main import main
from reobserve.estimation.estimate_command import estimate_file
from reobserve.estimation.specification import read_specification
from tests import ROOT
from tests.reobserve.estimation.records import read_results

LOGS = ROOT / "examples/logs"

# Log, alarm, column, time and size of the fault, and the allowed delay [s] of the alarm: two time
# constants of the observer.
FAULTS = [
    ("bias", "biased", "bias", 8.0, 1.5, 0.05),
    ("thruster", "stuck z", "fault_3", 6.4, 0.3, 0.3),
    ("leak", "leaking", "leak", 600.0, 0.12, 90.0),
]


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("logs")
    subprocess.run([sys.executable, LOGS / "make_logs.py", folder], check=True)
    return folder


def estimated(name: str, logs: Path, specification: Path) -> dict[str, Any]:
    """The report on a log."""
    files = [str(specification), str(logs / f"{name}.csv")]
    written = ["--out", str(logs / "e.csv"), "--report", str(logs / "e.json")]
    assert main(["estimate", *files, *written]) == 0
    report: dict[str, Any] = json.loads((logs / "e.json").read_text(encoding="utf-8"))
    return report


def seconds(report: dict[str, Any], *times: Any) -> list[float]:
    """Times of a report in seconds, after the second in which it begins if they are dates."""
    if not isinstance(report["first"], str):
        return list(times)
    origin = datetime.fromisoformat(report["first"]).replace(microsecond=0)
    return [(datetime.fromisoformat(one) - origin).total_seconds() for one in times]


@pytest.mark.parametrize(("name", "alarm", "column", "begin", "size", "delay"), FAULTS)
def test_log_yields_the_correct_fault(
    name: str, alarm: str, column: str, begin: float, size: float, delay: float, logs: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    report = estimated(name, logs, LOGS / f"{name}.yaml")
    said = capsys.readouterr().err
    assert report["warnings"] == []
    found = report["alarms"].pop(alarm)
    assert all(other["rows"] == 0 for other in report["alarms"].values())
    (one,) = found["intervals"]
    assert found["first"] == one["start"]
    estimates, _ = read_results(logs / "e.csv")
    start, end, last = seconds(report, one["start"], one["end"], report["last"])
    assert begin <= start <= begin + delay
    assert end == pytest.approx(last)
    assert abs(one["mean"] - size) < 2.0 * one["standard_deviation"] < 0.25 * size
    assert 0.0 < found["start_up"] < begin
    late = estimates["time"] > start + 2.0 * delay
    assert estimates[column][late].mean() == pytest.approx(size, rel=0.03)
    assert f"mean {one['mean']:.4g}" in said


@pytest.mark.parametrize(("name", "rows"), [("bias", 790), ("thruster", 315), ("leak", 595)])
def test_healthy_beginning_of_a_log_warns_of_nothing(name: str, rows: int, logs: Path) -> None:
    """But that its start-up is long for a short record."""
    whole = (logs / f"{name}.csv").read_bytes()
    (logs / "healthy.csv").write_bytes(b"".join(whole.splitlines(keepends=True)[:rows]))
    chosen = read_specification(LOGS / f"{name}.yaml")
    report = estimate_file(chosen, logs / "healthy.csv", logs / "healthy-e.csv").report
    assert [one for one in report.warnings if "cannot be raised in" not in one] == []


def test_leak_is_overestimated_without_the_operating_point(logs: Path) -> None:
    """The difference between the outflow at 2 m and that of the linear model for the whole
    level."""
    text = (LOGS / "leak.yaml").read_text(encoding="utf-8")
    (logs / "leak.yaml").write_text(
        text.replace(", offset: 2.0", "")
        .replace(", offset: 4.0", "")
        .replace("initial_state: [0.0]", "initial_state: [2.0]"),
        encoding="utf-8",
    )
    report = estimated("leak", logs, logs / "leak.yaml")
    found = report["alarms"]["leaking"]
    assert seconds(report, found["first"])[0] < 300.0  # before the leak
    assert found["intervals"][0]["mean"] > 1.0  # 4 l/s - 2 m times 1 l/s a metre are missing
