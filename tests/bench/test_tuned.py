"""The kept settings are those of the task files and of the code; results are those known before."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from reobserve.bench.scoring import score_task
from reobserve.bench.table import CELLS, Results, write_cells, write_checkpoints
from reobserve.bench.task import Task
from reobserve.bench.tuned_file import objective, read_tuned, tune_once
from reobserve.core.files import read_table

ROOT = Path(__file__).parents[2]
TASKS = sorted(path.stem for path in (ROOT / "config/bench").glob("*.yaml"))
GOLDEN = ROOT / "tests/golden/bench"
_NUMBERS = ("error", "low", "high", "ratio", "ratio_low", "ratio_high", "lag", "quantile")


@cache
def task(name: str) -> Task:
    return Task.read(ROOT / f"config/bench/{name}.yaml")


def tuned(name: str) -> Any:
    return read_tuned(task(name), ROOT / "config/bench/tuned" / name)


@pytest.mark.parametrize("name", TASKS)
def test_settings_have_the_objective_that_they_were_kept_with(name: str) -> None:
    """If not, records or methods have changed since: run `snakemake bench_tune` and keep those."""
    main = task(name).main
    for method, kept in tuned(name).items():
        one = kept.training[main].repeats[0]
        found = objective(task(name), method, main, 0, one.settings)
        assert found == pytest.approx(one.objective, abs=1e-6), method


@pytest.fixture(scope="module")
def scored(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Results of a task, computed once."""

    @cache
    def of(name: str) -> Results:
        folder = tmp_path_factory.mktemp(name)
        cells, checkpoints = score_task(task(name), tuned(name))
        write_cells(cells, folder / "table.csv")
        write_checkpoints(checkpoints, folder / "evaluations.csv")
        return Results.read(task(name), folder / "table.csv", folder / "evaluations.csv")

    return of


@pytest.mark.parametrize("name", TASKS)
def test_the_comparison_is_the_golden_one(name: str, scored: Any) -> None:
    golden = read_table(GOLDEN / f"{name}.csv", CELLS, key=CELLS[:4])
    found = scored(name).cells
    assert len(found) == len(golden)
    for one, kept in zip(found, golden, strict=True):
        place = tuple(kept[key] for key in CELLS[:4])
        assert tuple(one[key] for key in CELLS[:4]) == place
        assert (one["seeds"], one["within"]) == (float(kept["seeds"]), kept["within"]), place
        for key in _NUMBERS:
            assert one[key] == pytest.approx(float(kept[key] or "nan"), rel=1e-4, nan_ok=True), (
                *place, key,
            )  # fmt: skip


def error(results: Results, condition: str, method: str, training: str, given: bool) -> float:
    cell = results.cell(condition, method, training, given)
    assert cell is not None
    return float(cell["error"])


def test_augmented_filter_and_learning_observers_tie_on_torque(scored: Any) -> None:
    """Within 5 %: all three estimate the fault by the integral of the same residual."""
    errors = [error(scored("torque"), "nominal", one, "", False)
              for one in ("adaptive", "ilo", "random_walk")]  # fmt: skip
    assert max(errors) < 1.05 * min(errors)


@pytest.mark.parametrize(("name", "method"), [("torque", "random_walk"), ("vdp", "ekf")])
def test_a_filter_that_is_given_the_noise_is_as_good_as_re_tuned(
    name: str, method: str, scored: Any
) -> None:
    """The gain depends on the ratio of both covariances, which tuning found."""
    reported = error(scored(name), "noise", method, "", True)
    assert reported == pytest.approx(error(scored(name), "noise", method, "noise", True), rel=0.02)
    assert reported < error(scored(name), "noise", method, "", False)


def test_filters_beat_normal_forms_on_van_der_pol(scored: Any) -> None:
    """In the nominal condition; extended and unscented filter differ by less than a permille."""
    found = {one: error(scored("vdp"), "nominal", one, "", False)
             for one in ("ekf", "ukf", "normal_0", "normal_2", "normal_4")}  # fmt: skip
    assert found["ekf"] < min(found["normal_0"], found["normal_2"], found["normal_4"])
    assert found["ukf"] == pytest.approx(found["ekf"], rel=1e-3)


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("name", "method"),
    [("torque", "random_walk"), ("torque", "adaptive"), ("vdp", "ekf"), ("vdp", "normal_4")],
)
def test_a_second_optimiser_finds_the_same_error(name: str, method: str) -> None:
    one = tuned(name)[method].training[task(name).main].repeats[0]
    other = tune_once(task(name), method, task(name).main, 0, optimiser="nelder_mead")
    assert other.score == pytest.approx(math.exp(one.objective), rel=0.02)
