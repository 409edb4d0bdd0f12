"""Angles, outliers, an R to estimate, parameters as states and detectors in specifications."""

from __future__ import annotations

from pathlib import Path
from typing import Any, get_type_hints

import numpy as np
import pytest
import yaml

from reobserve.core.documents import parse_yaml
from reobserve.core.errors import InputError
from reobserve.detection import chi_square_window, cusum_of_mean, glr_of_mean, normalised
from reobserve.estimation.data_report import AlarmReport
from reobserve.estimation.detector_alarms import DetectorAlarm, DetectorRule
from reobserve.estimation.estimate import Estimation
from reobserve.estimation.estimate_command import estimate_file
from reobserve.estimation.families import FAMILIES, family
from reobserve.estimation.families.examples import simulated, specification_text
from reobserve.estimation.specification import as_specification, read_specification
from tests.reobserve.estimation.records import read_results, streamed, write_record

COMPASS: dict[str, Any] = {
    "observer": {
        "kind": "kalman", "time": "continuous", "A": [[0, 1], [0, 0]], "C": [[1, 0]],
        "states": {"heading": "deg", "rate": "deg/s"}, "measurements": {"compass": "deg"},
        "Q": [1e-4, 1e-3], "R": 0.04, "initial_state": [345, 0], "initial_covariance": [1, 400],
    },
    "columns": {"time": {"column": "t"}, "measurements": [{"column": "compass"}]},
    "sampling": {"period": 0.1, "missing": "skip", "gap": 10.0, "at_gap": "coast"},
}  # fmt: skip
TIME = 0.1 * np.arange(400)
STRAIGHT = 345.0 + 20.0 * TIME + 0.2 * np.random.default_rng(3).standard_normal(400)


def specified(tmp_path: Path, changes: dict[str, Any], base: Any = None) -> Path:
    tree = yaml.safe_load(yaml.safe_dump(base or COMPASS))
    for key, value in changes.items():
        *path, last = key.split(".")
        part = tree
        for step in path:
            part = part[int(step) if isinstance(part, list) else step]
        part[last] = value
    path = tmp_path / "s.yaml"
    path.write_text(yaml.safe_dump(tree))
    return path


def estimated(tmp_path: Path, changes: dict[str, Any], compass: Any, time: Any = TIME) -> Any:
    record = write_record(tmp_path / "r.csv", {"t": time, "compass": compass})
    made = estimate_file(
        read_specification(specified(tmp_path, changes)), record, tmp_path / "e.csv", block=500
    )
    found, status = read_results(tmp_path / "e.csv")
    stated = read_specification(tmp_path / "s.yaml")
    assert streamed(stated, record) == (tmp_path / "e.csv").read_text()
    return made, found, status


def test_angle_that_wraps_is_the_one_that_goes_on(tmp_path: Path) -> None:
    _, expected, _ = estimated(tmp_path, {}, STRAIGHT)
    compass = STRAIGHT % 360.0
    compass[50:60] = np.nan
    there = STRAIGHT.copy()
    there[50:60] = np.nan
    _, expected, _ = estimated(tmp_path, {}, there)
    wrap = {"columns.measurements.0.wrap": 360}
    _, found, _ = estimated(tmp_path, wrap, compass)
    np.testing.assert_allclose(found["heading"], expected["heading"], atol=1e-9)
    np.testing.assert_allclose(found["rate"], expected["rate"], atol=1e-9)
    # The filter wraps by itself what is predicted for longer than half a turn.
    own = {"observer.periods": {"heading": 360, "compass": 360}}
    _, found, _ = estimated(tmp_path, own, compass)
    turned = (expected["heading"] + 180.0) % 360.0 - 180.0
    np.testing.assert_allclose(found["heading"], turned, atol=1e-9)
    np.testing.assert_allclose(found["rate"], expected["rate"], atol=1e-9)
    # The period may be text of numbers and pi.
    text = {"observer.periods": {"heading": "2*pi*180/pi", "compass": "360"}}
    assert np.array_equal(estimated(tmp_path, text, compass)[1]["rate"], found["rate"])
    made, _, _ = estimated(tmp_path, {}, compass)
    assert "; of an angle that wraps, observer.periods states" in " ".join(made.report.warnings)
    made, _, _ = estimated(tmp_path, {}, np.clip(there, 0.0, 400.0))
    assert "that wraps" not in " ".join(made.report.warnings)
    # In radians, of a column in degrees.
    changes = wrap | {
        "observer.states": {"heading": "rad", "rate": "rad/s"},
        "observer.measurements": {"compass": "rad"},
        "columns.measurements.0.unit": "deg",
        "observer.initial_state": [345 / 57.29577951308232, 0],
        "observer.Q": [1e-4 / 57.29577951308232**2, 1e-3 / 57.29577951308232**2],
        "observer.R": 0.04 / 57.29577951308232**2,
        "observer.initial_covariance": [1 / 57.29577951308232**2, 400 / 57.29577951308232**2],
    }  # fmt: skip
    _, found, _ = estimated(tmp_path, changes, compass)
    np.testing.assert_allclose(np.degrees(found["rate"]), expected["rate"], atol=1e-6)


def test_outliers_are_left_out_counted_and_an_alarm_can_be_of_them(tmp_path: Path) -> None:
    spoilt = STRAIGHT.copy()
    spoilt[[100, 250]] += 50.0
    holes = STRAIGHT.copy()
    holes[[100, 250]] = np.nan
    alarm = [{"name": "spike", "of": "compass_outlier", "above": 6, "start_up": 0}]
    made, found, _ = estimated(tmp_path, {"observer.gate": 6, "alarms": alarm}, spoilt)
    assert made.report.outliers == {"compass": 2}
    assert np.flatnonzero(found["alarm spike"]).tolist() == [100, 250]
    _, expected, _ = estimated(tmp_path, {}, holes)
    assert np.array_equal(found["rate"], expected["rate"])
    many = STRAIGHT.copy()
    many[200:] += 90.0
    made, _, _ = estimated(tmp_path, {"observer.gate": 6}, many)
    assert any("the gate leaves out more than" in one for one in made.report.warnings)


def test_noise_of_a_measurement_is_estimated(tmp_path: Path) -> None:
    changes = {"observer.noise_memory": 5.0, "observer.R": 0.4}
    _, found, _ = estimated(tmp_path, changes, STRAIGHT)
    assert found["compass_noise_variance"][-1] == pytest.approx(0.04, rel=0.5)


DETECTORS = [
    {"name": "window", "detector": "chi_square_window", "length": 5, "false_alarm_rate": 1e-4},
    {"name": "sum", "detector": "cusum_of_mean", "of": "compass", "shift": 1,
     "false_alarm_rate": 1e-4},
    {"name": "ratio", "detector": "glr_of_mean", "lengths": [1, 4, 16], "false_alarm_rate": 1e-4},
]  # fmt: skip


def test_detectors_as_alarms_are_those_of_the_library(tmp_path: Path) -> None:
    faulty = STRAIGHT.copy()
    faulty[200:] += 1.5
    faulty[[50, 51]] = np.nan
    made, found, _ = estimated(tmp_path, {"alarms": DETECTORS}, faulty)
    design = made.design
    run = design.observer.run(faulty, start=design.start())
    distances, whitened = normalised(run)
    for name, expected in (
        ("window", chi_square_window(distances, 1, 5, 1e-4)),
        ("sum", cusum_of_mean(whitened[:, 0], 1.0, 1e-4)),
        ("ratio", glr_of_mean(whitened, [1, 4, 16], 1e-4)),
    ):
        assert np.array_equal(found[f"alarm {name}"] == 1, expected.alarm), name
        assert made.report.alarms[name].threshold == pytest.approx(expected.threshold)
        assert expected.first is not None
        assert 200 <= expected.first < 230


def test_cumulative_sum_of_a_measurement_sees_that_one_alone() -> None:
    e, S = np.zeros((4, 2)), np.tile([[1.0, 0.8], [0.8, 1.0]], (4, 1, 1))
    e[:, 0] = 3.0
    estimates = {"innovation": e, "innovation_covariance": S}
    for place, expected in ((0, [2.5, 5.0, 7.5, 10.0]), (1, [0.0] * 4)):
        rule = DetectorRule("sum", "cusum_of_mean", 1e-4, shift=1.0, of="y")
        alarm = DetectorAlarm(rule, 0.1, place)
        found = AlarmReport("1", 0.0)
        assert alarm._statistic(estimates, found).tolist() == expected


GATED = [
    name
    for kind in FAMILIES if hasattr(get_type_hints(family(kind))["system"], "gate")
    for name in family(kind).records
]  # fmt: skip
RESIDUALS = [
    {"of": "residual FIRST", "beyond": 1},
    {"of": "residual FIRST", "above": 1},
    {"of": "residual FIRST", "below": -1},
    {"of": "residual FIRST", "sigma": 6, "until": 1},
]
PREDICTED = [
    {"of": "innovation FIRST", "beyond": 1},
    {"of": "innovation FIRST", "sigmas": 5},
    {"of": "residual FIRST", "above": 1, "sigmas": 5},
    DETECTORS[0], DETECTORS[1] | {"of": "FIRST"}, DETECTORS[2],
]  # fmt: skip


def set_up(name: str, alarms: list[dict[str, Any]], **rules: Any) -> None:
    """Set up an example with alarms, in which FIRST is its first measurement."""
    tree: Any = parse_yaml(specification_text(name), "example")
    first = tree["columns"]["measurements"][0]["column"]
    tree["observer"] |= rules
    tree["alarms"] = [
        alarm
        | {"name": f"alarm_{k}"}
        | ({"of": alarm["of"].replace("FIRST", first)} if "of" in alarm else {})
        for k, alarm in enumerate(alarms)
    ]
    Estimation(as_specification(tree), list(simulated(name).record()), "r.csv")


@pytest.mark.nightly_cases(
    "kalman-steady", "augmented-kalman-bias", "imm-svsf", "extended-kalman", "augmented-kalman"
)
@pytest.mark.parametrize("name", GATED)
def test_alarms_that_a_gate_blinds_are_refused(name: str) -> None:
    bank = name.startswith(("imm", "fault-bank", "delay-grid"))  # which predict no variances
    blind = RESIDUALS if bank else RESIDUALS + PREDICTED
    set_up(name, blind)
    set_up(name, [{"of": "FIRST_outlier", "beyond": 6}], gate=6)
    for alarm in blind:
        with pytest.raises(InputError, match=r"^alarms\.0\..* is blind to what the gate"):
            set_up(name, [alarm], gate=6)
    if bank:
        return
    set_up(name, blind, gate=6, outliers="inflate")
    for of in ("residual", "innovation"):
        with pytest.raises(InputError, match=r"^alarms\.0\.sigmas: 6 must be below the gate, 6: "):
            set_up(name, [{"of": f"{of} FIRST", "sigmas": 6}], gate=6, outliers="inflate")


def test_parameter_of_a_text_model_is_estimated(tmp_path: Path) -> None:
    record = write_record(tmp_path / "r.csv", simulated("extended-kalman").record())
    text: Any = parse_yaml(specification_text("extended-kalman"), "example")
    text["observer"]["parameters"]["friction"] = 0.3
    text["observer"]["parameter_states"] = {"friction": {"initial_variance": 0.1, "unit": "1/s"}}
    (tmp_path / "s.yaml").write_text(yaml.safe_dump(text))
    estimate_file(read_specification(tmp_path / "s.yaml"), record, tmp_path / "e.csv")
    found, _ = read_results(tmp_path / "e.csv")
    assert found["friction"][-1] == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"observer.periods": {"cmpass": 360}}, "observer.periods.cmpass: .*compass"),
        ({"observer.periods": {"compass": "2*x"}}, "periods.compass: '2.x' must be a number, or t"),
        ({"observer.periods": {"compass": "1/0"}}, "periods.compass: '1/0' must be a number, or t"),
        ({"observer.periods": {"compass": "-pi"}}, "periods.compass: -3.14159 must be greater th"),
        ({"observer.outliers": "skip"}, "outliers: must be left out without a gate"),
        ({"observer.gate": -1}, "gate"),
        ({"columns.measurements.0.wrap": 0}, "wrap"),
        ({"alarms": [DETECTORS[0] | {"length": None}]}, "length"),
        ({"alarms": [DETECTORS[0] | {"false_alarm_rate": 2}]}, "false_alarm_rate: 2 must be from"),
        ({"alarms": [DETECTORS[0] | {"shift": 1}]}, "shift: must be left out with the detector"),
        ({"alarms": [DETECTORS[1] | {"of": "cmpass"}]}, "there is no measurement 'cmpass'"),
        (
            {"alarms": [DETECTORS[0]], "observer.kind": "imm", "observer.modes": {"one": {}},
             "observer.gains": {"transition": [[1]]}},
            "is for filters that predict the covariance",
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused(changes: dict[str, Any], message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message):
        estimated(tmp_path, changes, STRAIGHT)
