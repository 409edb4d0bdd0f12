"""Alarms that use what a filter knows: after gaps, in its standard deviations, in its start-up."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.core.validation import parse
from reobserve.estimation.estimate import Estimation
from reobserve.estimation.estimate_command import estimate_file
from reobserve.estimation.estimates_plot import Plot
from reobserve.estimation.report_table import as_table
from reobserve.estimation.specification import Specification
from reobserve.estimation.start_up import start_up
from tests.reobserve.estimation.records import read_results, streamed, write_record

Array = NDArray[np.float64]

ROWS, GAP = 400, slice(150, 320)
DRIFT: dict[str, Any] = {
    "kind": "kalman", "time": "discrete", "A": [[1.0, 1.0], [0.0, 1.0]], "C": [[1.0, 0.0]],
    "states": {"temperature": "K", "drift": "K"}, "measurements": {"T": "K"},
    "Q": [0.1, 1e-3], "R": 0.5, "initial_state": [20.0, 0.0], "initial_covariance": 10.0,
}  # fmt: skip
WITHOUT = {"Q", "R", "initial_covariance"}
LUENBERGER = {key: value for key, value in DRIFT.items() if key not in WITHOUT}
OBSERVERS: dict[str, dict[str, Any]] = {
    "kalman": DRIFT,
    "kalman-steady": DRIFT | {"gain": "steady"},
    "augmented-kalman": DRIFT | {
        "kind": "augmented-kalman", "fault_matrix": [[0.0], [1.0]],
        "random_walk": 1e-9,
    },
    "luenberger": LUENBERGER | {"kind": "luenberger", "poles": [0.5, 0.6]},
    "imm": DRIFT | {
        "kind": "imm", "modes": {"one": {}, "two": {"R": 0.6}},
        "gains": {"transition": [[0.99, 0.01], [0.01, 0.99]]},
    },
}  # fmt: skip


def drifting() -> Array:
    """Temperatures that follow the model, with a seed for which the gap ends far off."""
    random = np.random.default_rng(4)
    rate = np.cumsum(0.03 * random.standard_normal(ROWS))
    level = 20.0 + np.cumsum(rate + 0.3 * random.standard_normal(ROWS))
    measured: Array = level + 0.7 * random.standard_normal(ROWS)
    return measured


def specified(
    observer: dict[str, Any], *alarms: dict[str, Any], at_gap: str = "coast"
) -> Specification:
    tree = {
        "observer": observer,
        "columns": {"time": {"column": "t"}, "measurements": [{"column": "T"}]},
        "sampling": {"period": 1.0, "missing": "skip", "at_gap": at_gap},
        "alarms": [{"name": f"a{k}", **one} for k, one in enumerate(alarms)],
    }
    found: Specification = parse(Specification, tree)
    return found


def estimated(chosen: Specification, values: Array, folder: Path, block: int = 100) -> Any:
    """The estimation and its columns, which those of a stream must equal."""
    record = write_record(folder / "r.csv", {"t": np.arange(len(values), dtype=float), "T": values})
    made = estimate_file(chosen, record, folder / "e.csv", block=block)
    assert streamed(chosen, record) == (folder / "e.csv").read_text()
    return made, read_results(folder / "e.csv")[0]


LEARNED = {"of": "residual T", "sigma": 6, "since": 20, "until": 140}


@pytest.mark.nightly_cases("rule1-kalman-steady", "rule0-kalman-steady", "rule0-augmented-kalman")
@pytest.mark.parametrize("name", ["kalman", "kalman-steady", "augmented-kalman"])
@pytest.mark.parametrize("rule", [LEARNED, {"of": "residual T", "beyond": 6.0}])
def test_no_alarm_after_a_gap_of_what_the_filter_predicts(
    name: str, rule: dict[str, Any], tmp_path: Path
) -> None:
    values = drifting()
    values[GAP] = np.nan
    made, found = estimated(specified(OBSERVERS[name], rule), values, tmp_path)
    reported = made.report.alarms["a0"]
    assert abs(found["residual T"][GAP.stop]) > 10.0
    assert (reported.first, reported.rows) == (None, 0)
    assert 1 <= reported.after_gap < 30
    assert f"{reported.after_gap} rows beyond it in or after gaps" in as_table(made.report, 1.0)
    # What is beyond the prediction, too, is an alarm; and later on the threshold is as before.
    for at in (GAP.stop, 360):
        faulty = values.copy()
        faulty[at:] += 3000.0 if at == GAP.stop else 15.0
        made, _ = estimated(specified(OBSERVERS[name], rule), faulty, tmp_path)
        assert made.report.alarms["a0"].first == at


@pytest.mark.parametrize("name", ["luenberger", "imm"])
def test_alarm_after_a_gap_is_doubtful_where_no_spread_is_predicted(
    name: str, tmp_path: Path
) -> None:
    values = drifting()
    values[GAP] = np.nan
    for at_gap, expected in (("coast", 1), ("restart", 0)):
        chosen = specified(OBSERVERS[name], LEARNED, at_gap=at_gap)
        made, _ = estimated(chosen, values, tmp_path)
        assert (made.report.alarms["a0"].after_gap > 0) == bool(expected)
        said = [one for one in made.report.warnings if "in a gap or soon after" in one]
        assert len(said) == expected
    with pytest.raises(
        InputError, match=r"alarms\.0\.sigmas: .*standard deviation of 'residual T'"
    ):
        estimated(specified(OBSERVERS[name], {"of": "residual T", "sigmas": 6}), values, tmp_path)


def test_estimate_in_a_gap_raises_an_alarm_if_it_is_certain(tmp_path: Path) -> None:
    """A temperature that drifts away without being measured, and a level that it passes by far."""
    values = 20.0 + np.arange(ROWS) * 0.3 + 0.7 * np.random.default_rng(1).standard_normal(ROWS)
    values[GAP] = np.nan
    passed = 20.0 + 0.3 * 200  # inside the gap
    sure = specified(DRIFT, {"of": "temperature", "above": passed}, {"of": "drift", "above": -50})
    made, found = estimated(sure, values, tmp_path)
    excess = found["temperature"] - passed
    certain = excess > 5 * found["temperature sigma"]
    inside = slice(GAP.start, GAP.stop)
    assert (excess[inside] > 0).any()
    assert not certain[inside].any()
    assert np.isnan(found["alarm a0"][inside]).sum() == (excess[inside] > 0).sum()
    assert made.report.alarms["a0"].after_gap >= (excess[inside] > 0).sum()
    assert (found["alarm a0"][GAP.stop + 20 :] == 1.0).all()
    assert (found["alarm a1"][inside] == 1.0).all()
    chosen = specified(OBSERVERS["luenberger"], {"of": "temperature", "above": passed})
    made, found = estimated(chosen, values, tmp_path)
    assert (found["alarm a0"][inside] == 1.0).any()
    assert any("in a gap or soon after" in one for one in made.report.warnings)


@pytest.mark.parametrize("of", ["innovation T", "residual T"])
@pytest.mark.parametrize("block", [7, 1000])
def test_innovation_in_its_predicted_standard_deviations(
    of: str, block: int, tmp_path: Path
) -> None:
    values = drifting()
    values[GAP] = np.nan
    values[350] += 12.0
    chosen = specified(DRIFT, {"of": of, "sigmas": 5}, {"of": of, "above": 0, "sigmas": 5},
                       {"of": of, "below": -1, "sigmas": 2})  # fmt: skip
    made, found = estimated(chosen, values, tmp_path, block)
    run = made.design.observer.run(values, start=made.design.start())
    e, spread = run["innovation"][:, 0], np.sqrt(run["innovation_covariance"][:, 0, 0])
    assert np.array_equal(found["alarm a0"], np.abs(e) > 5 * spread)
    assert np.array_equal(found["alarm a1"], e > 5 * spread)
    assert np.array_equal(found["alarm a2"], -1 - e > 2 * spread)
    reported = made.report.alarms["a0"]
    assert (reported.first, reported.start_up) == (350.0, 0.0)
    assert np.abs(e[GAP.stop]) > 5 * spread[100]
    assert "threshold 5 standard deviations of the observer" in as_table(made.report, 1.0)
    assert "threshold below -1 K by 2 standard deviations" in as_table(made.report, 1.0)


def test_estimate_in_its_standard_deviations(tmp_path: Path) -> None:
    values = drifting()
    rules = ({"of": "drift", "sigmas": 2}, {"of": "drift", "beyond": 0.2, "sigmas": 1})
    for name in ("kalman", "imm"):
        made, found = estimated(specified(OBSERVERS[name], *rules), values, tmp_path)
        drift, sigma = found["drift"], found["drift sigma"]
        assert np.array_equal(found["alarm a0"], np.abs(drift) > 2 * sigma)
        assert np.array_equal(found["alarm a1"], np.abs(drift) - 0.2 > sigma)
        assert made.report.alarms["a0"].rows > 0
    problem = "no standard deviation of 'drift'"
    with pytest.raises(InputError, match=problem):
        estimated(specified(OBSERVERS["luenberger"], rules[0]), values, tmp_path)


def test_one_sided_thresholds(tmp_path: Path) -> None:
    """A slow sine, which is beyond 1 twice in each period and above it once."""
    values = 3.0 * np.sin(2 * np.pi * np.arange(ROWS) / 200)
    rules: list[dict[str, Any]] = [
        {"above": 1.0}, {"below": -1.0}, {"beyond": 1.0}, {"above": 2.0, "below": -1.0},
        {"above": -1.0},
    ]  # fmt: skip
    chosen = specified(DRIFT, *({"of": "temperature", "start_up": 0, **one} for one in rules))
    made, found = estimated(chosen, values, tmp_path)
    x, alarms = found["temperature"], made.report.alarms
    expected = [x > 1.0, x < -1.0, np.abs(x) > 1.0, (x > 2.0) | (x < -1.0), x > -1.0]
    for k, one in enumerate(expected):
        assert np.array_equal(found[f"alarm a{k}"], one), rules[k]
    peaks = [alarms[f"a{k}"].summary()["intervals"][-1]["peak"] for k in range(5)]
    late = slice(110, None)
    assert peaks[1] == pytest.approx(x[late].min()) == peaks[3]
    assert alarms["a0"].summary()["intervals"][1]["peak"] == pytest.approx(x[late].max())
    table = as_table(made.report, 1.0)
    for said in ("above 1 K", "below -1 K", "1 K", "above 2 K or below -1 K", "above -1 K"):
        assert f"threshold {said}" in table
    bounds = [alarms[f"a{k}"].bounds for k in range(5)]
    assert bounds == [[1.0], [-1.0], [-1.0, 1.0], [2.0, -1.0], [-1.0]]
    summary = alarms["a3"].summary()
    assert (summary["above"], summary["below"], summary["threshold"]) == (2.0, -1.0, None)


def test_plot_has_the_bound_of_one_side(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    values = 3.0 * np.sin(2 * np.pi * np.arange(ROWS) / 200)
    chosen = specified(DRIFT, {"of": "temperature", "below": -1.0})
    estimation = Estimation(chosen, ["t", "T"], "r")
    plot = estimation.curves = Plot(estimation)
    estimation.feed(np.column_stack([np.arange(ROWS), values]))
    axes = plot.figure().axes
    dashed = [line.get_ydata()[0] for line in axes[0].get_lines() if line.get_color() == "0.35"]
    assert dashed == [-1.0]


@pytest.mark.parametrize(
    ("rule", "message"),
    [
        ({"above": 1, "beyond": 2}, r"alarms\.0\.above: must be left out beside beyond"),
        ({"above": 1, "below": 2}, r"alarms\.0\.below: 2 must be less than above, 1"),
        ({"beyond": -1}, r"alarms\.0\.beyond"),
        ({"sigmas": 0}, r"alarms\.0\.sigmas"),
        ({"above": 1, "sigma": 2}, r"alarms\.0\.sigma: unknown key; did you mean 'sigmas'"),
        ({}, r"alarms\.0: a threshold is missing: above, below, beyond or sigmas, or sigma and"),
        ({"sigma": 3}, r"alarms\.0\.until: is missing"),
        ({"of": "innovation U", "sigmas": 3}, r"alarms\.0\.of: there is no column 'innovation U'"),
    ],
)
def test_thresholds_that_exclude_each_other_are_refused(rule: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Estimation(specified(DRIFT, {"of": "temperature", **rule}), ["t", "T"], "r")


def test_detector_needs_a_covariance_that_is_predicted() -> None:
    rule = {"detector": "chi_square_window", "length": 3, "false_alarm_rate": 1e-3}
    with pytest.raises(InputError, match="is for filters that predict the covariance"):
        Estimation(specified(OBSERVERS["luenberger"], rule), ["t", "T"], "r")


# Start-up

BIAS: dict[str, Any] = {
    "kind": "augmented-kalman", "time": "discrete", "A": [[1.0]], "C": [[1.0], [1.0]],
    "states": {"level": "m"}, "measurements": {"a": "m", "b": "m"}, "unknown_inputs": {"bias": "m"},
    "fault_matrix": [[0.0]], "output_fault_matrix": [[1.0], [0.0]], "random_walk": 1e-6 / 60.0,
    "Q": 0.01, "R": [0.04, 0.09], "initial_state": [22.0], "initial_covariance": 4.0,
}  # fmt: skip


@pytest.mark.parametrize("unit", ["m", "mm"])
@pytest.mark.parametrize("bias", [1.2, 0.0])
def test_bias_from_the_first_row_on_is_found_in_the_start_up(
    unit: str, bias: float, tmp_path: Path
) -> None:
    random, scale = np.random.default_rng(1), {"m": 1.0, "mm": 1000.0}[unit]
    level = 22.0 + np.cumsum(0.1 * random.standard_normal(218))
    columns = {
        "a": scale * (level + bias + 0.2 * random.standard_normal(218)),
        "b": scale * (level + 0.3 * random.standard_normal(218)),
    }
    tree = {
        "observer": BIAS,
        "columns": {"measurements": [{"column": "a", "unit": unit}, {"column": "b", "unit": unit}]},
        "sampling": {"period": 60.0},
        "alarms": [{"name": "biased", "of": "bias", "beyond": 0.5},
                   {"name": "sure", "of": "bias", "sigmas": 5}],
    }  # fmt: skip
    chosen: Specification = parse(Specification, tree)
    made = estimate_file(chosen, write_record(tmp_path / "r.csv", columns), tmp_path / "e.csv")
    found, sure = made.report.alarms["biased"], made.report.alarms["sure"]
    said = [one for one in made.report.warnings if "exceeded already within the start-up" in one]
    if bias:
        assert found.first is not None
        assert sure.first is not None
        assert max(found.first, sure.first) < 1000.0
        assert found.earlier is not None
        assert found.earlier < found.first
        assert found.hidden > 0
        assert len(said) == 1
        assert "or earlier (beyond the threshold from" in as_table(made.report, 60.0)
    else:
        assert (found.first, sure.first, said) == (None, None, [])
        covers = [one for one in made.report.warnings if "cannot be raised in" in one]
        assert len(covers) == 1
        assert f"{found.ignored} of 218 rows, its start-up of {found.start_up:g} s" in covers[0]


def test_start_up_that_hides_an_alarm_is_reported(tmp_path: Path) -> None:
    """Of an observer without standard deviations, which starts at what it measures."""
    values = np.full(300, 5.0)
    values[100:] = 0.0
    for begin, end, earlier, hidden in ((0, 100, 0.0, 30), (5, 10, None, 5)):
        values[:] = 0.0
        values[begin:end] = 5.0
        rule = {"of": "temperature", "beyond": 2.0, "start_up": 30}
        observer = LUENBERGER | {"kind": "luenberger", "poles": [0.0, 0.1], "initial_state": [0, 0]}
        made, _ = estimated(specified(observer, rule), values, tmp_path, 7)
        found = made.report.alarms["a0"]
        assert abs(found.hidden - hidden) <= 3
        assert found.earlier == earlier
        assert found.first == (None if earlier is None else 30.0)
        assert len(made.report.warnings) >= (earlier is not None)
        assert f"in which {found.hidden} rows are beyond it" in as_table(made.report, 1.0)


@pytest.mark.nightly_cases("0.3")
@pytest.mark.parametrize("covariance", [1e-6, 0.3, 100.0])
def test_start_that_is_off_raises_no_alarm(covariance: float, tmp_path: Path) -> None:
    """Of a filter that starts 15 K off, however certain it is of that."""
    values = drifting() - 15.0
    observer = DRIFT | {"initial_covariance": covariance}
    rule = {"of": "drift", "beyond": 1.2}
    made, _ = estimated(specified(observer, rule), values, tmp_path, 7)
    assert made.report.alarms["a0"].first is None
    values[200:] += np.arange(200.0) * 3.0
    made, _ = estimated(specified(observer, rule), values, tmp_path, 7)
    first = made.report.alarms["a0"].first
    assert first is not None
    assert 200.0 < first < 230.0


def test_start_up_ends_where_the_deviation_is_near_its_last_value() -> None:
    """An impulse that decays by 0.99, and a deviation that falls from 3 to 1 by 0.9."""

    def run(y: Array) -> Array:
        rows = np.arange(len(y))
        return np.column_stack([y[0, 0] * 0.99**rows, 1.0 + 2.0 * 0.9**rows])

    rows = int(np.ceil(np.log(0.25 / 2.0) / np.log(0.9)))  # 1 + 2 * 0.9^k is 1.25
    assert start_up(run, 1, [1, None]).tolist()[0] == rows
    assert start_up(run, 1, [None, None]).tolist()[0] == np.ceil(np.log(0.01) / np.log(0.99)) + 1
