"""The search for the unstated numbers: reproducible, and consistent with its stored result."""

from __future__ import annotations

import json
import subprocess
import sys
from copy import deepcopy
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.core.validation import parse
from reobserve_papers.papers.imm import keys, plant, search
from reobserve_papers.papers.imm.calibration import Calibration, CalibrationTrial, switches
from reobserve_papers.papers.imm.study_rows import TUNED
from reobserve_papers.parameters.job import read_job
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.signals.series import Series
from reobserve_papers.steps.chain import reads
from reobserve_papers.steps.compute import signed
from reobserve_papers.steps.evaluation import Evaluator
from tests.reobserve_papers.papers import job_of
from tests.reobserve_papers.papers.imm.test_paper import SEED, Tree, parameters, record
from tests.reobserve_papers.papers.imm.test_studies import KEPT

Array = NDArray[np.float64]

# One second of the step, with the leak in its middle, two banks and two generations.
SMALL: Tree = {
    "plant": {"horizon": 1.4},
    "scenarios": {"step": {"onset": 1.0}},
    "metrics": {"before": [0.7, 1.0], "after": [1.2, 1.4], "overshoot": [1.1, 1.2]},
    "searches": {
        "calibrated": {
            "population": 1, "generations": 2, "neighbour_pairs": 0,
            "observers": ["kalman_tuned", "svsf_thin_tuned"],
        }
    },
}  # fmt: skip


@cache
def small_parameters() -> Parameters:
    return parameters(SMALL)


@cache
def small_record() -> Series:
    return plant.simulate(job_of(small_parameters(), "plant", "step"))


def write_record(path: Path, of: Parameters) -> None:
    settings = of.settings("plant", "step")
    signed(
        plant.simulate(read_job(keys.Parameters, settings)), of, "plant", "step", settings
    ).write(path)


def found(lines: list[str] | None = None, **stated: Any) -> dict[str, Any]:
    settings = deepcopy(small_parameters().settings("search", "calibrated"))
    settings["search"].update(stated)
    said: list[str] = [] if lines is None else lines
    return search.run(read_job(keys.Parameters, settings), small_record(), said.append)


@cache
def first() -> tuple[dict[str, Any], list[str]]:
    lines: list[str] = []
    return found(lines), lines


def test_search_can_be_evaluated_in_one_process() -> None:
    assert reads(small_parameters(), "search", "calibrated") == [("plant", "step")]
    evaluator = Evaluator(small_parameters())
    assert evaluator.result("search", "calibrated") == first()[0]


def calibration(of: Parameters, series: Series) -> Calibration:
    job = read_job(keys.Parameters, of.settings("search", "calibrated"))
    return Calibration(job.plant, job.observers, job.metrics, series)


def targets(of: Parameters) -> int:
    observers = of.settings("search", "calibrated")["observers"].values()
    return sum(len(body["quoted"]) + body["quoted_high"] for body in observers)


@pytest.mark.parametrize("threads", [1, 2])
def test_search_is_bitwise_reproducible_on_any_number_of_threads(
    threads: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(search, "THREADS", threads)
    assert json.dumps(found()) == json.dumps(first()[0])


def test_found_distance_agrees_with_its_numbers() -> None:
    one = first()[0]
    numbers = np.array([one["found"][name] for name in TUNED])
    trial = calibration(small_parameters(), small_record()).try_out(numbers)
    assert one["distance"] == trial.distance
    assert one["means"] == {name: list(means) for name, means in trial.means.items()}
    assert (one["tuned"], one["targets"]) == (9, 5) == (len(TUNED), targets(small_parameters()))
    # Without neighbours the worst is the candidate itself.
    assert one["worst_nearby"] == pytest.approx(one["distance"], rel=1e-6)


def test_found_numbers_are_within_bounds_and_rounded_to_three_digits() -> None:
    body = small_parameters().section("searches", "calibrated")
    low, high = search.bounds(parse(keys.Search, body))
    values = np.array([first()[0]["found"][name] for name in TUNED])
    assert np.all((values >= 0.99 * 10.0**low) & (values <= 1.01 * 10.0**high))
    assert [float(f"{value:.3g}") for value in values] == values.tolist()
    names = dict(zip(TUNED, zip(10.0**low, 10.0**high, strict=True), strict=True))
    for name, key in (
        ("process_noise_1", "process_noise"), ("process_noise_5", "process_noise"),
        ("measurement_noise_1", "position_noise"), ("measurement_noise_2", "velocity_noise"),
        ("measurement_noise_3", "acceleration_noise"), ("leave", "leave"),
    ):  # fmt: skip
        assert names[name] == pytest.approx(body[key], rel=1e-12)


def test_progress_is_reported_after_each_generation() -> None:
    one, lines = first()
    assert lines == [f"{count} trials, best distance {best:.4f}" for count, best in one["history"]]
    assert len(lines) == 2
    counts, best = zip(*one["history"], strict=True)
    # The first generation is evaluated with the start, 16 points of Sobol's sequence for nine
    # numbers.
    assert counts == (32, 48)
    assert one["trials"] == 48
    assert list(best) == sorted(best, reverse=True)


# --- With a known distance ----------------------------------------------------------------------

BEST = np.array([1e-6, 1e-5, 1e-7, 1e-4, 1e-3, 1e-5, 0.3, 5e3, 0.02])


@pytest.fixture
def tried(monkeypatch: pytest.MonkeyPatch) -> list[Array]:
    """The distance from BEST in decades, without a bank; none if the ninth is above 0.05. All
    trials are recorded.
    """
    found: list[Array] = []

    def try_out(_: Calibration, numbers: Array) -> CalibrationTrial:
        found.append(numbers)
        off = float(np.sqrt(np.mean(np.log10(numbers / BEST) ** 2)))
        return CalibrationTrial({}, off if numbers[-1] <= 0.05 else float("nan"))

    monkeypatch.setattr(search, "THREADS", 1)
    monkeypatch.setattr(Calibration, "try_out", try_out)
    return found


def test_search_finds_the_known_optimum(tried: list[Array]) -> None:
    one = found(population=3, generations=120)
    np.testing.assert_allclose(np.log10(list(one["found"].values())), np.log10(BEST), atol=0.05)
    assert one["distance"] < 0.02
    assert one["trials"] == one["history"][-1][0] == len(tried) - 2
    assert max(numbers[-1] for numbers in tried) > 0.05


def test_another_seed_takes_another_path(tried: list[Array]) -> None:
    settings = small_parameters().settings("search", "calibrated")
    for seed in (SEED, SEED + 1, SEED):
        search.run(read_job(keys.Parameters, {**settings, "seed": seed}), small_record(), str)
    ways = np.reshape(tried, (3, -1))
    np.testing.assert_array_equal(ways[0], ways[2])
    assert np.any(ways[0] != ways[1])


def test_each_candidate_is_scored_by_the_worst_of_itself_and_opposite_corners(
    tried: list[Array],
) -> None:
    one = found(neighbour_pairs=2, spread=0.25)
    # The last trials are the result alone, and with its neighbours.
    base = np.array(list(one["found"].values()))
    evaluated = np.array(tried[:-6]).reshape(-1, 5, 9)
    ratios = evaluated / evaluated[:, :1]
    np.testing.assert_allclose(ratios[0, 0], 1.0)
    np.testing.assert_allclose(np.abs(np.log(ratios[0, 1:])), np.log(1.25), rtol=1e-9)
    np.testing.assert_allclose(ratios[0, 1:3] * ratios[0, 3:], 1.0, rtol=1e-9)
    # The same corners for all candidates.
    np.testing.assert_allclose(ratios, np.broadcast_to(ratios[0], ratios.shape), rtol=1e-9)
    np.testing.assert_allclose(tried[-6], base, rtol=0)
    np.testing.assert_allclose(tried[-5:], base * ratios[0], rtol=1e-9)
    worst = max(np.sqrt(np.mean(np.log10(base * ratio / BEST) ** 2)) for ratio in ratios[0])
    assert one["worst_nearby"] == pytest.approx(worst, rel=1e-9)
    assert one["worst_nearby"] > one["distance"]


@pytest.mark.parametrize(
    ("bad", "key", "said"),
    [
        ({"process_noise": [1e-2, 1e-8]}, "process_noise", r"\[0.01, 1e-08\] must be above 0 and"),
        ({"position_noise": [0.0, 1.0]}, "position_noise", r"\[0, 1\] must be above 0 and rise"),
        ({"velocity_noise": [1.0, 1.0]}, "velocity_noise", r"\[1, 1\] must be above 0 and rise"),
        ({"acceleration_noise": [1, 2, 3]}, "acceleration_noise", "must be a list of 2 numbers"),
        ({"leave": "seldom"}, "leave", "'seldom' must be a list of numbers"),
    ],
)
def test_invalid_bounds_are_refused_before_any_trial(
    bad: Tree, key: str, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Calibration, "try_out", lambda *_: pytest.fail("a bank was run"))
    with pytest.raises(InputError, match=said) as caught:
        found(**bad)
    assert caught.value.parameter == f"search.{key}"


@pytest.mark.parametrize("value", [[1.0, 1.0], [0.0, 1.0]])
def test_bounds_that_are_not_positive_or_do_not_rise_are_refused(value: list[float]) -> None:
    with pytest.raises(InputError, match=r"^kept: \[[01], 1\] must be above 0 and rise$"):
        keys.bounds("kept", value)


# --- The stored search --------------------------------------------------------------------------


# Keys added after the search `calibrated`, with neutral values, and the names of keys at the time
# of the searches.
SINCE = {
    "layer_unit": 1.0, "inverse": "pseudo", "initial_mode": "unknown", "hand_over": "motion",
    "input_unit": "V",
}  # fmt: skip
NAMED = {
    "layer_scale": "layer_unit",
    "switching_condition": "hand_over",
    "self_transition": "stay",
}

SEARCHES = {"calibrated": "step", "switching": "velocity_step"}  # with their scenarios


@cache
def kept(name: str) -> dict[str, Any]:
    path = KEPT.with_name(f"imm_{name}.json")
    stored: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return stored


def own_parameters(name: str) -> Calibration:
    job = read_job(keys.Parameters, parameters().settings("search", name))
    return Calibration(job.plant, job.observers, job.metrics, record(SEARCHES[name]))


@pytest.mark.parametrize("name", SEARCHES)
def test_stored_numbers_agree_with_the_parameters(name: str) -> None:
    assert list(kept(name)["search"]["found"]) == list(TUNED)
    found = list(kept(name)["search"]["found"].values())
    np.testing.assert_allclose(found, own_parameters(name).tuned_numbers(), rtol=1e-12)


@pytest.mark.parametrize("name", SEARCHES)
def test_stored_distance_agrees_with_the_numbers(name: str) -> None:
    one = kept(name)["search"]
    trial = own_parameters(name).try_out(np.array(list(one["found"].values())))
    assert one["distance"] == pytest.approx(trial.distance, abs=1e-9)
    for observer, means in one["means"].items():
        assert means == pytest.approx(trial.means[observer], abs=1e-9)
    assert set(one["means"]) == set(trial.means)
    assert one.get("outside", trial.outside) == pytest.approx(trial.outside, abs=1e-9)


@pytest.mark.parametrize("name", SEARCHES)
def test_stored_search_has_consistent_counts(name: str) -> None:
    one = kept(name)["search"]
    observers = parameters().settings("search", name)["observers"].values()
    sought = sum(len(body["quoted"]) + body["quoted_high"] for body in observers)
    assert (one["tuned"], one["targets"]) == (len(TUNED), sought)
    assert one["trials"] == one["history"][-1][0]
    counts, best = zip(*one["history"], strict=True)
    assert len(set(np.diff(counts))) == 1
    assert list(best) == sorted(best, reverse=True)
    # Only the rounding to three digits separates the last generation and the stored result.
    assert one["worst_nearby"] == pytest.approx(best[-1], abs=1e-3)
    assert one["worst_nearby"] >= one["distance"]


@pytest.mark.parametrize("name", SEARCHES)
def test_stored_search_agrees_with_the_parameters(name: str) -> None:
    was, now = kept(name)["provenance"]["settings"], parameters().settings("search", name)
    for part in ("plant", "search", "seed"):
        assert was[part] == now[part], part
    for key, value in now["scenario"].items():
        assert {**SINCE, **was["scenario"]}[NAMED.get(key, key)] == value, key
    assert len(kept(name)["search"]["history"]) == now["search"]["generations"]
    for observer, body in now["observers"].items():
        for key, value in body.items():
            if key not in ("process_noise", "measurement_noise", "self_transition"):
                known = {**SINCE, **was["observers"][observer]}
                assert known[NAMED.get(key, key)] == value, (observer, key)


def test_only_thin_layers_switch_in_the_found_setting() -> None:
    least = parameters().section("searches", "switching", "switching")
    outside = kept("switching")["search"]["outside"]
    assert outside["svsf_retuned"] < least < outside["svsf_thin_retuned"]
    # In the unit of the other search none does.
    one = own_parameters("calibrated")
    trial = one.try_out(one.tuned_numbers())
    assert not switches(trial, one.observers, least)


@pytest.mark.parametrize(
    ("wide", "thin", "right"),
    [(0.0, 0.2, True), (0.0, 0.01, True), (0.01, 0.2, False), (0.0, 0.009, False)],
)
def test_switching_check_accepts_only_the_required_layers(
    wide: float, thin: float, right: bool
) -> None:
    observers = own_parameters("calibrated").observers
    trial = CalibrationTrial({}, 0.0, {"svsf_tuned": wide, "svsf_thin_tuned": thin})
    assert switches(trial, observers, 0.01) == right
    assert not switches(CalibrationTrial({}, 0.0), observers, 0.01)


def test_non_switching_layers_score_worse_than_switching_ones() -> None:
    plain, still = found(), found(switching=0.5)
    assert still["worst_nearby"] == pytest.approx(plain["worst_nearby"] + search.STILL, abs=0.2)


def reobserve(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    command = [str(Path(sys.executable).parent / "reobserve-papers"), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def kept_in(project: Path, parameters: Parameters) -> Path:
    """The folder of results with the parameters and the record that the search reads."""
    folder = project / "results/imm"
    (folder / "step").mkdir(parents=True)
    (folder / "parameters.json").write_text(parameters.text(), encoding="utf-8")
    write_record(folder / "step/plant.parquet", parameters)
    return folder


def test_search_command_writes_its_result_and_reports_progress(tmp_path: Path) -> None:
    folder = kept_in(tmp_path, small_parameters())
    output = folder / "calibrated.search.json"
    done = reobserve("stage", "search", folder / "parameters.json", "calibrated")
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    assert done.stderr.splitlines() == first()[1]
    stored = json.loads(output.read_text(encoding="utf-8"))
    assert stored["search"] == first()[0]
    assert stored["provenance"]["stage"] == "search"
    assert stored["provenance"]["settings"] == small_parameters().settings("search", "calibrated")


def test_failing_search_command_reports_why_and_writes_nothing(tmp_path: Path) -> None:
    bad = parameters({**SMALL, "searches": {"calibrated": {"leave": [0.2, 0.1]}}})
    folder = kept_in(tmp_path, bad)
    for name, said in (
        ("calibrated", "reobserve-papers: imm.search.leave: [0.2, 0.1] must be above 0 and rise\n"),
        (
            "calibratd",
            "reobserve-papers: imm.searches: there is no 'calibratd'; did you mean 'calibrated",
        ),
    ):
        done = reobserve("stage", "search", folder / "parameters.json", name)
        assert done.returncode == 1
        assert done.stderr.startswith(said)
        assert done.stderr.count("\n") == 1
        assert not list(folder.glob("*.search.json"))


def test_search_over_parameters_not_shared_by_the_banks_is_refused() -> None:
    """Before the first trial: all banks would otherwise get the same noise, whatever was stated."""
    settings = deepcopy(small_parameters().settings("search", "calibrated"))
    noise = settings["observers"]["svsf_thin_tuned"]["process_noise"]
    settings["observers"]["svsf_thin_tuned"]["process_noise"] = [2.0 * x for x in noise]
    said: list[str] = []
    with pytest.raises(InputError, match="must have the noise of the others tuned"):
        search.run(read_job(keys.Parameters, settings), small_record(), said.append)
    assert said == []
