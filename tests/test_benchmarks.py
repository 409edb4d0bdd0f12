"""The history of benchmarks: what the nightly workflow reports."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from benchmarks import __main__ as command
from benchmarks.report import Row, Section
from reobserve.core.code_paths import THREADS
from reobserve.core.documents import read_yaml
from tests import ROOT


def nightly_words() -> list[str]:
    """The arguments with which the nightly workflow runs benchmarks."""
    steps = read_yaml(ROOT / ".github/workflows/nightly.yml")["jobs"]["speed"]["steps"]
    (line,) = (step["run"] for step in steps if "-m benchmarks" in step.get("run", ""))
    (saved,) = (step["with"]["path"] for step in steps if "cache/save" in step.get("uses", ""))
    (restored,) = (
        step["with"]["path"] for step in steps if "cache/restore" in step.get("uses", "")
    )
    words = shlex.split(line)
    assert words[-2:] == ["--history", saved]
    assert saved == restored
    return words[words.index("benchmarks") + 1 :]


@pytest.mark.parametrize(
    ("shares", "codes"),
    [
        ([0.6, 0.62, 0.3, 0.61, 0.45, 0.47, 0.4], [0, 0, 0, 0, 0, 0, 1]),
        ([0.6, 0.62, 0.61, 0.6, 0.3, 0.6, 0.6], [0] * 7),  # fell once
        ([0.6, 0.62, 0.61, 0.3, 0.3, 0.6, 0.3], [0] * 7),
        ([0.6, 0.62, 0.61, 0.5, 0.5, 0.5], [0] * 6),  # less than a fifth
        ([0.6, 0.4, 0.4, 0.4], [0] * 4),  # too few to compare with
    ],
)
def test_ratio_to_c_that_falls_three_times_in_a_row_is_reported(
    shares: list[float],
    codes: list[int],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    for name in THREADS:
        monkeypatch.setenv(name, "1")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["benchmarks", *nightly_words()])
    monkeypatch.setattr(command, "RESULTS", tmp_path / "latest.json")
    found = []
    for share in shares:
        rows = [Row("KF", 1.0, "C -O3", share), Row("KF", 1.0, "numpy", share**9)]
        module = SimpleNamespace(run=lambda quick, rows=rows: Section("made up", "", rows))
        monkeypatch.setattr(command, "import_module", lambda name, module=module: module)
        found.append(command.main())
        reported = [one for one in capsys.readouterr().out.splitlines() if "FALLEN" in one]
        assert len(reported) == found[-1]
    assert found == codes
    assert len(list((tmp_path / "speed").iterdir())) == len(shares)
