"""How close two models may be: thresholds, alarms, delays, and the computations of detectors."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_lyapunov

from reobserve.core.errors import InputError
from reobserve.core.validation import parse
from reobserve.observers.kalman import KalmanFilter
from reobserve.papers.imm import keys, study, study_closeness, study_rows
from reobserve.papers.imm.detection import Share, curve, detection_rates, enough_gap, measure
from reobserve.papers.imm.detectors import (
    distances,
    likelihoods,
    log_odds,
    rest_likelihoods,
    unmixed_log_odds,
)
from reobserve.papers.imm.nu_gap import nu_gap
from reobserve.papers.imm.setup import bank, modes
from reobserve.papers.imm.setup import run as run_bank
from reobserve.papers.imm.study_closeness import Grid, alarm_time, driven
from reobserve.replication.metrics.study_table import StudyTable
from reobserve.replication.parameters.job import read_job
from reobserve.systems.linear import LinearModel
from tests.papers.imm.test_paper import Tree, parameters, record

Array = NDArray[np.float64]
Row = dict[str, Any]

DETECTORS = (
    "kalman", "svsf", "svsf_thin", "svsf_scale_0.0001", "unmixed", "cusum", "glr",
)  # fmt: skip
BANKS = DETECTORS[:4]

# --- Alarms ---------------------------------------------------------------------------------------

GRID = Grid(0.5, 10, 6, 2, 1)


@pytest.mark.parametrize(
    ("row", "time"),
    [
        (2, -1.5), (5, 0.0),  # the last rows before the fault has an effect
        (6, 0.5), (9, 2.0),
        (1, np.nan), (None, np.nan),  # the start is not evaluated
    ],
)  # fmt: skip
def test_alarm_time_is_the_first_crossing(row: int | None, time: float) -> None:
    statistic = np.zeros(10)
    if row is not None:
        statistic[row] = 1.0
    assert alarm_time(statistic, 0.5, GRID) == pytest.approx(time, nan_ok=True)
    assert np.isnan(alarm_time(statistic, 1.0, GRID))  # reaching a threshold is not an alarm


def test_detector_statistics_follow_from_alarms() -> None:
    times = np.array([-0.3, 0.0, 0.1, 0.2, 0.4, np.nan, np.nan])
    found = detection_rates(0.02, times)
    assert found.alarmed == Share(2, 7)
    assert found.detected == Share(3, 5)
    assert found.delay == pytest.approx(0.4)  # of 0.1, 0.2, 0.4, never, never
    assert np.isnan(detection_rates(0.02, np.array([0.1, np.nan, np.nan])).delay)
    none = detection_rates(0.02, np.array([-0.1, -0.2]))
    assert none.alarmed.value == 1.0
    assert np.isnan(none.detected.value)
    assert none.detected.interval == (0.0, 1.0)


@pytest.mark.parametrize(
    ("right", "runs", "low", "high"),
    [  # Newcombe (1998), Table I, method 3
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ],
)
def test_wilson_intervals_agree_with_published_values(
    right: int, runs: int, low: float, high: float
) -> None:
    assert Share(right, runs).interval == pytest.approx((low, high), abs=5e-5)


def test_sufficient_gap_is_found() -> None:
    gaps = [0.01, 0.02, 0.08, 0.32]
    assert enough_gap(gaps, [0.5, 0.9, 1.0, 1.0], 0.95) == pytest.approx(0.04)
    assert enough_gap(gaps, [0.5, 0.75, 0.75, 1.0], 0.95) == pytest.approx(0.08 * 4**0.8)
    # A model detected at one gap and missed at a larger one does not count as detected.
    assert enough_gap(gaps, [0.5, 1.0, 0.5, 1.0], 0.75) == pytest.approx(0.16)
    assert enough_gap(gaps, [1.0, 1.0, 0.95, 1.0], 0.95) == 0.01
    assert np.isnan(enough_gap(gaps, [1.0, 1.0, 1.0, 0.9], 0.95))


# --- Computations of the detectors --------------------------------------------------------------


@cache
def noisy() -> tuple[Array, Array]:
    """Ends of steps and inputs of the setting without mixing noise, around the leak."""
    found, part = record("plain"), slice(4700, 5400)
    measured = np.ascontiguousarray(found["measured"][1:][part, :3])
    return measured, np.ascontiguousarray(found["input"][:-1].reshape(-1)[part])


def pair(name: str, **changed: Any) -> Any:
    """A bank of the normal and the leakage model, with its components."""
    tree = deepcopy(parameters().section("observers", name))
    body = parse(keys.Observer, {**tree, **changed})  # type: ignore[arg-type]
    normal, _, leakage = modes(parse(keys.Plant, parameters().section("plant")))
    return bank(
        parse(keys.Plant, parameters().section("plant")), body, 1e-3, [normal, leakage]
    ), body


@pytest.mark.parametrize("name", ["kalman", "svsf"])
def test_log_odds_agree_with_bank_probabilities(name: str) -> None:
    one = pair(name)
    found = log_odds(one, *noisy())
    probability = run_bank(*one, *noisy())["probability"]
    np.testing.assert_allclose(1 / (1 + np.exp(-found)), probability[:, 1], rtol=1e-9, atol=1e-12)
    assert np.abs(found).max() <= 700


def test_diverging_bank_raises_no_alarm() -> None:
    one = pair("kalman", process_noise=1e150)
    measured, held = noisy()
    found = log_odds(one, 1e160 * measured, held)
    assert np.isneginf(found[-1])


def test_separate_filters_agree_with_an_unmixed_bank() -> None:
    one = pair("kalman", mixing=False)
    both = np.stack([likelihoods(one, mode, *noisy()) for mode in (0, 1)], axis=1)
    found = unmixed_log_odds(np.asarray(one[0].transition), both)
    wanted = run_bank(*one, *noisy())["probability"]
    np.testing.assert_allclose(1 / (1 + np.exp(-found)), wanted[:, 1], rtol=1e-9, atol=1e-12)
    ends = np.abs(found[[300, -1]])
    assert found[300] < -1 < 1 < found[-1], ends  # precondition: both modes have been detected


def test_distances_agree_with_the_innovations() -> None:
    one = pair("kalman")
    normal = one[0].filters[0]
    assert isinstance(normal, KalmanFilter)
    measured, held = noisy()
    found = distances(rest_likelihoods(one, 800), likelihoods(one, 0, measured, held))
    state = normal.init(np.zeros(5), one[1].initial_covariance, u=[held[0], 0.0])
    posterior = normal.predict(state.posterior, [held[0], 0.0])
    for k in range(40):
        after = normal.correct(posterior, measured[k], [held[k + 1], held[k]])
        wanted = after.innovation @ np.linalg.solve(after.innovation_covariance, after.innovation)
        assert found[k] == pytest.approx(wanted, rel=1e-6, abs=1e-8), k
        posterior = normal.predict(after.posterior, [held[k + 1], held[k]])


def test_state_noise_has_the_stated_covariance() -> None:
    A, H = np.array([[0.8, 0.1], [-0.2, 0.7]]), np.array([[1.0, 0.3]])
    one, other = (
        LinearModel(
            sign * A, np.zeros((2, 1)), H, Q=1.0, R=1.0, sampling_period=1.0, unusual=True
        ).arrays
        for sign in (1, -1)
    )
    kicks = np.sqrt([0.3, 0.2]) * np.random.default_rng(3).standard_normal((200_000, 2))
    found = driven(one, other, 100_000, kicks)[:, 0]
    spread = solve_discrete_lyapunov(A, np.diag([0.3, 0.2]))
    for part in (found[100:100_000], found[100_100:]):
        assert np.var(part) == pytest.approx((H @ spread @ H.T)[0, 0], rel=0.03)
    for part, sign in ((found[:100_000], 1.0), (found[100_000:], -1.0)):  # and changes by its model
        lag = np.mean(part[100:-1] * part[101:])
        assert lag == pytest.approx(sign * (H @ A @ spread @ H.T)[0, 0], rel=0.05)
    x = A @ kicks[0] + kicks[1]
    np.testing.assert_allclose(
        driven(one, other, 1, kicks[:2]), [H @ kicks[0], H @ (x - 2 * A @ kicks[0])]
    )


# --- The study ----------------------------------------------------------------------------------

FEW: Tree = {
    "shares": [0.05, 0.4], "noise_levels": [0.03, 0.3], "driven_levels": [0.1], "runs": 4,
    "faultless_runs": 9, "false_alarm_probability": 0.1,
}  # fmt: skip


def close(**stated: Any) -> list[Row]:
    settings = deepcopy(parameters().settings("study", "closeness"))
    settings["study"].update({**FEW, **stated})
    return study.run(settings, record("plain"))


@cache
def few() -> list[Row]:
    return close()


def table(rows: Sequence[Row]) -> StudyTable:
    return StudyTable.of(rows, study_rows.KINDS)


def test_rows_do_not_depend_on_the_number_of_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(study_closeness, "THREADS", 1)
    assert repr(close()) == repr(few())  # nan is unequal to nan


def test_evaluation_window_must_end_before_the_run() -> None:
    settings = deepcopy(parameters().settings("study", "closeness"))
    body = settings["study"]
    body["horizon"] = body["onset"] + body["averaging_time"]
    study_closeness.check(read_job(keys.Parameters, settings))
    body["horizon"] -= read_job(keys.Parameters, settings).scenario.period
    with pytest.raises(
        InputError, match=r"^averaging_time: \S+ s must fit between onset and horizon, "
    ):
        study_closeness.check(read_job(keys.Parameters, settings))


def test_rows_are_ordered_by_plant_models_and_runs() -> None:
    wanted = []
    for sweep in ("exact_0.03", "exact_0.3", "driven_0.1"):
        for share in FEW["shares"]:
            wanted.append(("models", sweep, share, 0, "nu_gap"))
            wanted += [(name, sweep, share, 0, "threshold") for name in DETECTORS]
            for run in (1, 2, 3, 4):
                for name in DETECTORS:
                    wanted.append((name, sweep, share, run, "alarm_time"))
                    if name in BANKS:
                        wanted.append((name, sweep, share, run, "probability_after"))
    columns = ("observer", "sweep", "level", "run", "quantity")
    assert [tuple(row[name] for name in columns) for row in few()] == wanted


def test_gap_is_computed_between_the_models() -> None:
    normal, _, leakage = modes(parse(keys.Plant, parameters().section("plant")))
    for row in few():
        if row["observer"] == "models":
            pairs = []
            for model in (normal, normal.blended(leakage, row["level"])):
                b, a = model.coefficients
                pairs.append((b.tolist(), [1.0, *a.tolist()]))
            assert row["value"] == nu_gap(*pairs)


def test_additional_runs_do_not_change_earlier_ones() -> None:
    fewer = close(runs=1, shares=[0.4], noise_levels=[0.3], driven_levels=[])
    kept = [r for r in few() if (r["sweep"], r["level"]) == ("exact_0.3", 0.4) and r["run"] < 2]
    assert repr(fewer) == repr(kept)


def test_fault_free_records_differ_from_evaluated_ones() -> None:
    """Each run has its own noise and input."""
    job = read_job(keys.Parameters, deepcopy(parameters().settings("study", "closeness")))
    one = next(study_closeness._pairs(job))
    rows = one.grid.begin
    first, second = (one.record("judged", number, rows) for number in (1, 2))
    other = one.record("faultless", 1, rows)
    for measured, held in (second, other):
        assert not np.array_equal(held, first[1])
        assert not np.array_equal(measured, first[0])
    longer = one.record("judged", 1, one.grid.steps)
    np.testing.assert_array_equal(longer[1][:rows], first[1])


def test_distant_models_are_detected_at_once_and_close_ones_are_not() -> None:
    found = table(few())
    for name in ("kalman", "unmixed", "cusum"):
        far = curve(found, name, "exact_0.03")[-1]
        assert far.detected.value == 1.0
        assert 0 < far.delay < 0.05
        near = curve(found, name, "exact_0.3")[0]
        assert near.detected.value < 0.9


def test_metrics_agree_with_the_runs() -> None:
    found = table(few())
    numbers = {(one.observer, one.metric): one.value for one in measure(found, 0.95)}
    at = "noise=0.03 plant=exact"
    for name in DETECTORS:
        close_pair, far_pair = curve(found, name, "exact_0.03")
        for share, one in (("0.05", close_pair), ("0.4", far_pair)):
            here = f"{at} share={share}"
            assert numbers[name, f"alarmed_share {here}"] == one.alarmed.value
            assert numbers[name, f"detected_share {here}"] == pytest.approx(
                one.detected.value, nan_ok=True
            )
            assert numbers[name, f"median_delay {here}"] == pytest.approx(one.delay, nan_ok=True)
        whole = Share(close_pair.alarmed.count + far_pair.alarmed.count, 8)
        assert numbers[name, f"alarmed_share {at}"] == whole.value
        limits = [numbers[name, f"alarmed_share_{end} {at}"] for end in ("low", "high")]
        assert limits == pytest.approx(list(whole.interval))
    assert numbers["models", "nu_gap share=0.4"] == curve(found, "glr", "exact_0.3")[-1].gap


def test_layer_unit_of_the_parameter_file_reproduces_the_observer() -> None:
    """A unit that is the parameter file's own gives what the observer gives."""
    rows = table(close(layer_scales=[1.0], noise_levels=[0.03], driven_levels=[], shares=[0.4]))
    stated = rows.where(observer="svsf")["value"]
    np.testing.assert_array_equal(rows.where(observer="svsf_scale_1")["value"], stated)
    thinner = table(few()).where(observer="svsf_scale_0.0001", sweep="exact_0.03", level=0.4)[
        "value"
    ]
    assert not np.array_equal(thinner, stated)
