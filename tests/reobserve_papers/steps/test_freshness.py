"""Results that are not those of a build: out of date, or edited."""

from __future__ import annotations

import base64
import json
import os
import subprocess
from pathlib import Path

import pytest

from reobserve_papers.steps import freshness

SUMMARY = """\
output_file\tdate\trule\tlog-file(s)\tstatus\tplan
results/a/fig1.png\tnow\tplot\t\tok\tno update
results/a/fig1.csv\tnow\tmetrics\t\tok\tno update
results/a/fig2.csv\tnow\tmetrics\t\tok\tupdate pending
results/a/fig3.csv\tnow\tmetrics\t\trule implementation changed\tupdate pending
"""


@pytest.mark.parametrize("seconds", [0.0, -60.0, 0.01])
def test_edited_and_outdated_files_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seconds: float
) -> None:
    records = tmp_path / ".snakemake/metadata"
    records.mkdir(parents=True)
    for name in ("fig1.png", "fig1.csv"):
        path = tmp_path / "results/a" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
        record = records / base64.b64encode(f"results/a/{name}".encode()).decode()
        record.write_text(json.dumps({"endtime": path.stat().st_mtime}))
    edited = tmp_path / "results/a/fig1.csv"
    stamp = edited.stat().st_mtime + seconds
    os.utime(edited, (stamp, stamp))
    summary = subprocess.CompletedProcess([], 0, SUMMARY, "")
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: summary)
    found = freshness.states(tmp_path)
    assert list(found) == [
        tmp_path / "results/a" / name for name in ("fig1.png", "fig1.csv", "fig2.csv", "fig3.csv")
    ]
    edits = freshness.EDITED if seconds else ""
    assert list(found.values()) == [
        "", edits, freshness.FOR_INPUTS[1], "rule implementation changed",
    ]  # fmt: skip
    whole = freshness.out_of_date(tmp_path, ["a"], bench=False)
    assert whole == {path: why for path, why in found.items() if why}
