"""Warnings about a record: the same for any zero of a scale, and with a gap in its first rows."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from reobserve.core.validation import parse
from reobserve.estimation.diagnostics import MOST_ROWS, FirstRows
from reobserve.estimation.estimate_command import estimate_file
from reobserve.estimation.families.examples import examples, simulated
from reobserve.estimation.gaps import Stretch
from reobserve.estimation.specification import Specification
from tests.reobserve.estimation.records import specification, write_record

Array = NDArray[np.float64]

ROWS = 400
TIME = np.arange(ROWS, dtype=float)
NOISE = np.random.default_rng(7).standard_normal(ROWS)
WALK: dict[str, Any] = {
    "time": "discrete", "A": [[1.0, 1.0], [0.0, 1.0]], "C": [[1.0, 0.0]],
    "states": {"x": "K", "rate": "K/s"}, "measurements": {"x": "K"},
}  # fmt: skip
OBSERVERS: dict[str, dict[str, Any]] = {
    "luenberger": WALK | {"kind": "luenberger", "poles": [0.5, 0.6]},
    "slow luenberger": WALK | {"kind": "luenberger", "poles": [0.995, 0.99]},
    "kalman": WALK | {"kind": "kalman", "Q": [1e-4, 1e-8], "R": 0.01, "initial_covariance": 1.0},
    "quick kalman": WALK | {"kind": "kalman", "Q": [1.0, 1.0], "R": 1e-6, "initial_covariance": 1},
    "levant": {"kind": "levant", "gains": {"L": 1e-3, "order": 2}},
    "slow levant": {"kind": "levant", "gains": {"L": 1e-9, "order": 2}},
}
RECORDS = {
    "rest": 0.1 * NOISE,
    "step": np.where(TIME < 170, 0.0, 30.0) + 0.1 * NOISE,
    "sine": 20.0 * np.sin(2 * np.pi * TIME / 80) + 0.1 * NOISE,
    "ramp": 0.2 * TIME + 0.1 * NOISE,
    "counts": np.round(40.0 * np.sin(2 * np.pi * TIME / 200)),
    "silent": np.zeros(ROWS),
}


def warned(
    observer: dict[str, Any], values: Array, folder: Path, zero: float = 0.0,
    offset: float | None = None, unit: str = "",
) -> list[str]:  # fmt: skip
    """The warnings, without their numbers. The observer starts at ``zero`` without an offset."""
    start = [zero if offset is None else 0.0, 0.0]
    stated = {} if observer["kind"] == "levant" else {"initial_state": start}
    column = {"column": "x"} | ({} if offset is None else {"offset": offset})
    tree = {
        "observer": observer | stated,
        "columns": {"time": {"column": "t"}, "measurements": [column | {"unit": unit or "K"}]},
        "sampling": {"period": 1.0, "missing": "interpolate", "at_gap": "restart"},
    }
    if observer["kind"] == "levant":
        column["model_unit"] = "K"
    chosen: Specification = parse(Specification, tree)
    record = write_record(folder / "r.csv", {"t": TIME, "x": values})
    made = estimate_file(chosen, record, folder / "e.csv")
    where = r"the \d+ rows of the longest stretch|the first \d+ rows"
    numbers = rf"[0-9.]+ (%|times)|far more than|{where}|(?<=[ (])-?[0-9.]+(?=[ ,)])"
    return [re.sub(numbers, "", one) for one in made.report.warnings]


@pytest.mark.nightly_cases("slow luenberger-rest", "slow luenberger-step", "luenberger-step")
@pytest.mark.parametrize("record", RECORDS)
@pytest.mark.parametrize("name", OBSERVERS)
def test_warnings_do_not_depend_on_the_zero_of_a_scale(
    name: str, record: str, tmp_path: Path
) -> None:
    observer, values = OBSERVERS[name], RECORDS[record]
    expected = warned(observer, values, tmp_path)
    for zero in (293.15, 4000.0, -50.0):
        assert warned(observer, values + zero, tmp_path, zero) == expected, zero
        assert warned(observer, values + zero, tmp_path, zero, offset=zero) == expected, zero


def test_each_kind_of_warning_occurs(tmp_path: Path) -> None:
    """What does not depend on the zero is not nothing."""
    for name, record, said in (
        ("slow luenberger", "sine", "residual x: it is  of the spread of what is measured"),
        ("slow levant", "sine", "residual x: it is"),
        ("kalman", "step", "innovations: over  they do not fit the filter: "),
        ("quick kalman", "rest", "rate: noise moves it by"),
        ("slow levant", "step", "derivatives_1: started again at half"),
    ):
        found = warned(OBSERVERS[name], RECORDS[record] + 293.15, tmp_path, 293.15)
        assert any(one.startswith(said) for one in found), (name, record, found)
    for name, record in (("luenberger", "sine"), ("kalman", "rest"), ("levant", "ramp")):
        found = warned(OBSERVERS[name], RECORDS[record] + 293.15, tmp_path, 293.15)
        assert not any("residual" in one for one in found), (name, record, found)


@pytest.mark.parametrize(
    ("name", "record"),
    [("kalman", "step"), ("kalman", "sine"), ("slow levant", "step"), ("slow levant", "sine"),
     ("luenberger", "sine"), ("quick kalman", "rest")],
)  # fmt: skip
def test_gap_in_the_tenth_row_changes_no_warning(name: str, record: str, tmp_path: Path) -> None:
    values = RECORDS[record] + 10.0
    expected = warned(OBSERVERS[name], values, tmp_path, 10.0)
    assert bool(expected) == (name != "luenberger")
    values[10:25] = np.nan
    assert warned(OBSERVERS[name], values, tmp_path, 10.0) == expected


def test_longest_stretch_is_kept_however_it_comes() -> None:
    lengths = [10, 50, 30, MOST_ROWS + 5, 7000]
    for size in (7, 1000, 10**6):
        first = FirstRows()
        begun = 0.0
        for length in lengths:
            time = begun + np.arange(length)
            for k in range(0, length, size):
                part = time[k : k + size]
                status = np.zeros(len(part), dtype=np.int8)
                first.take(Stretch(part, part[:, None], part[:, None], status, k == 0))
            begun += length
        assert first.longest()[0][:, 0].tolist() == list(range(90, 90 + MOST_ROWS))


FAULTY = ("augmented-kalman", "augmented-kalman-bias", "fault-bank", "eso", "ilo-sampled")


@pytest.mark.nightly_after(5)
@pytest.mark.parametrize("name", dict.fromkeys([*FAULTY, *examples()]))
def test_healthy_beginning_of_an_example_warns_of_nothing(name: str, tmp_path: Path) -> None:
    """Up to its fault, if it has one, but that a short record is short."""
    plant = simulated(name)
    faults = [plant.signals[one] for one in ("fault", "offset", "worn") if one in plant.signals]
    begins = [plant.time[np.argmax(one != 0.0)] for one in faults if one.any()]
    columns = plant.record()
    healthy = columns["t"] < 1000.0 * min(begins, default=np.inf)
    assert (name in FAULTY) <= bool(begins)
    record = {title: values[healthy] for title, values in columns.items()}
    path = write_record(tmp_path / "r.csv", record)
    report = estimate_file(specification(name), path, tmp_path / "e.csv").report
    assert [one for one in report.warnings if "cannot be raised in" not in one] == []
    assert all(alarm.rows == 0 for alarm in report.alarms.values())


@pytest.mark.parametrize(
    "rule", [{"beyond": 0.005}, {"above": 0.005}, {"above": 5, "below": -0.005}]
)
@pytest.mark.parametrize("name", FAULTY[:4])
def test_noise_as_large_as_the_threshold_of_an_alarm_is_said(
    name: str, rule: dict[str, Any], tmp_path: Path
) -> None:
    """Of a fault that is zero; with the deviation of the filter as threshold it is expected."""
    of = "speed_offset" if "bias" in name else "voltage_lost"
    columns = {title: values[:500] for title, values in simulated(name).record().items()}
    path = write_record(tmp_path / "r.csv", columns)
    sigmas = [{"sigmas": 6}] if name != "eso" else []
    for alarm in (rule, *sigmas, None):
        alarms = [] if alarm is None else [{"name": "it", "of": of, **alarm}]
        chosen = specification(name, alarms=alarms)
        report = estimate_file(chosen, path, tmp_path / "e.csv").report
        said = any(one.startswith(f"{of}: noise moves it by") for one in report.warnings)
        assert said == (alarm is rule)
