"""Tolerances of the bench's numbers: relative, by a record, and of what rounding decides."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reobserve.core.errors import ReobserveError
from reobserve.tuning.results import write_cells
from reobserve.tuning.scoring import score_task
from reobserve_papers.bench.perturbed import PerturbedTask
from reobserve_papers.golden import golden_bench
from reobserve_papers.golden.number_files import GoldenNumber
from tests.reobserve.tuning.test_scoring import kept
from tests.reobserve.tuning.toy import toy

HEADER = "condition,method,training,given_noise,seeds,error,quantile"
ERROR = ("bank", "error in windy, training nominal, given noise no", "")
SHARE = ("bank", "quantile in windy, training nominal, given noise no", "")


@pytest.fixture
def project(tmp_path: Path) -> Path:
    for task in ("leak", "level"):
        path = golden_bench.golden_table(tmp_path, task)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{HEADER}\nwindy,bank,nominal,no,24,0.5,0\n")
    return tmp_path


def built(folder: Path, task: str, error: str, share: str) -> Path:
    path = golden_bench.built_table(folder / "results", task)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"{HEADER}\nwindy,bank,nominal,no,24,{error},{share}\n")
    return folder / "results"


def moved(project: Path, task: str, error: str = "0.5", share: str = "0") -> list[str]:
    found = golden_bench.compare_task(project, built(project, task, error, share), task)
    return [one.place for one in found]


def test_share_may_differ_by_one_record_and_other_numbers_by_rounding(project: Path) -> None:
    for task in ("leak", "level"):
        assert moved(project, task, error="0.50004") == []
        assert moved(project, task, error="0.50006") == [f"bench {task}, {' '.join(ERROR[:2])}"]
    assert moved(project, "leak", share="0.041666") == []
    assert moved(project, "leak", share="0.0417") == [f"bench leak, {' '.join(SHARE[:2])}"]
    assert moved(project, "level", share="0.001") == [f"bench level, {' '.join(SHARE[:2])}"]


def test_what_repeats_move_further_has_ten_times_their_largest_change(project: Path) -> None:
    def table(error: str, within: str = "yes") -> dict[tuple[str, str, str], GoldenNumber]:
        return {
            ERROR: GoldenNumber(error, "", "5e-05"), SHARE: GoldenNumber("", "", ""),
            ("bank", "within", ""): GoldenNumber(within),
        }  # fmt: skip

    golden = table("0.5")
    assert golden_bench.wider(golden, [table("0.500004"), table("0.5", "no")]) == {}
    found = golden_bench.wider(golden, [table("0.500006"), table("0.49998")])
    assert found == {ERROR[:2]: pytest.approx(2e-4, rel=0.06)}
    golden_bench._write_tolerances(project, "level", {ERROR[:2]: 2e-4})
    golden_bench._write_tolerances(project, "leak", {ERROR[:2]: 3e-4})
    golden_bench._write_tolerances(project, "level", {ERROR[:2]: 4e-4})
    assert golden_bench.read_tolerances(project, "level") == {ERROR[:2]: 4e-4}
    assert moved(project, "level", error="0.50039") == []
    assert moved(project, "leak", error="0.50029") == []
    assert moved(project, "leak", error="0.50031") == [f"bench leak, {' '.join(ERROR[:2])}"]


def test_records_of_a_repeat_have_errors_of_their_own(tmp_path: Path) -> None:
    toy(tmp_path)
    one, other = (PerturbedTask.read(tmp_path / "toy.yaml") for _ in range(2))
    object.__setattr__(other, "repeat", 1)
    exact = toy(tmp_path).record("noise", 3)
    for task in (one, other):
        found = task.record("noise", 3)
        assert np.array_equal(found.truth, exact.truth)
        off = found.measurements / exact.measurements - 1.0
        assert 0.0 < np.abs(off).max() < 2e-15
        assert np.array_equal(found.measurements, task.record("noise", 3).measurements)
    again = other.record("noise", 3).measurements
    assert not np.array_equal(one.record("noise", 3).measurements, again)


@pytest.mark.nightly
def test_tolerances_are_measured_by_scoring_again(tmp_path: Path) -> None:
    """Of a constant the lag is rounding; nothing else of this task is. Settings there must be."""
    folder = tmp_path / "config/bench"
    folder.mkdir(parents=True)
    task = toy(folder)
    (tmp_path / "tests/golden/bench").mkdir(parents=True)
    golden_bench.golden_table(tmp_path, "toy").write_text(f"{HEADER}\n")
    with pytest.raises(ReobserveError, match=r"^bench toy: .*share.json"):
        golden_bench.measure(tmp_path, "toy")
    (folder / "tuned").mkdir()
    tuned = kept(task, folder / "tuned/toy")
    write_cells(score_task(task, tuned), golden_bench.golden_table(tmp_path, "toy"))
    assert {quantity.split()[0] for _, quantity in golden_bench.measure(tmp_path, "toy")} == {"lag"}
