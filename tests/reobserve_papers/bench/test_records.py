"""Records of the tasks of the bench."""

from __future__ import annotations

from pathlib import Path

import pytest

from reobserve_papers.bench.packaged_task import PackagedTask
from tests import ROOT

TASKS = sorted((ROOT / "config/bench").glob("*.yaml"))


@pytest.mark.parametrize("path", TASKS, ids=lambda path: path.stem)
def test_records_are_paired_across_conditions(path: Path) -> None:
    """All conditions of a seed have the same faults and the same unit noise."""
    task = PackagedTask.read(path)
    nominal = task.record("nominal", 3)
    for name, condition in task.conditions.items():
        record = task.record(name, 3)
        every = slice(None, None, condition.period)
        assert record.time == pytest.approx(nominal.time[every], abs=1e-12)
        assert (
            len(record.inputs) == len(record.measurements) == len(record.truth) == len(record.time)
        )
        if condition.model == 0 and not condition.plant:
            assert (record.truth == nominal.truth[every]).all()
    other = task.record("nominal", 4)
    assert (other.measurements != nominal.measurements).any()
