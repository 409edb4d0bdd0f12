"""Titles that end in a unit: it is used, or refused, and never ignored."""

from __future__ import annotations

import math
from typing import Any

import pytest

from reobserve.core.errors import InputError
from reobserve.core.validation import parse
from reobserve.estimation.estimate import Estimation
from reobserve.estimation.row_by_row import RowByRow
from reobserve.estimation.specification import Specification

OBSERVER = {
    "kind": "kalman", "time": "discrete", "states": {"x": "rad/s"}, "measurements": {"x": "rad/s"},
    "A": [[1.0]], "C": [[1.0]], "Q": 1.0, "R": 1.0, "initial_state": [0.0],
    "initial_covariance": 1.0e12,
}  # fmt: skip


def estimated(title: str, cell: str, model: str = "rad/s", **column: Any) -> float:
    """The estimate from a single row, which is its measurement."""
    observer = {**OBSERVER, "states": {"x": model}, "measurements": {"x": model}}
    columns = {"measurements": [{"column": "speed", **column}]}
    tree = {"observer": observer, "columns": columns, "sampling": {"period": 1.0}}
    rows = RowByRow(Estimation(parse(Specification, tree), [title], "r.csv"), [title])
    return float((rows.read(cell) + rows.finish()).split(",")[1])


@pytest.mark.parametrize(
    "title",
    [
        "speed [deg/s]", "speed (deg/s)", "speed / deg/s", "speed, deg/s", "speed/(deg/s)",
        "speed(deg/s)", " speed  (deg/s) ", "speed (°/s)", "speed [DPS]",
    ],
)  # fmt: skip
def test_unit_in_a_title_is_used(title: str) -> None:
    for column in ("speed", title.strip()):
        found = estimated(title, "180.0", column=column)
        assert found == pytest.approx(math.pi, rel=1e-9)


@pytest.mark.parametrize(
    ("title", "column"),
    [
        ("speed (left) [deg/s]", "speed (left)"), ("speed, left (deg/s)", "speed, left"),
        ("speed, left, deg/s", "speed, left"), ("front/left, deg/s", "front/left"),
    ],
)  # fmt: skip
def test_last_brackets_of_a_title_hold_the_unit(title: str, column: str) -> None:
    assert estimated(title, "180.0", column=column) == pytest.approx(math.pi, rel=1e-9)


@pytest.mark.parametrize("index", ["[0]", "[1]", "[2]", "[12]", "(1)", "(3)"])
def test_index_at_the_end_of_a_name_is_no_unit(index: str) -> None:
    """As of one of several signals in a log of PX4 or Betaflight; [1] is a unit after a blank."""
    name = f"gyro{index}"
    assert estimated(name, "5.0", column=name) == pytest.approx(5.0, rel=1e-9)
    assert estimated(name, "5.0", "%", column=name, unit="%") == pytest.approx(5.0, rel=1e-9)
    found = estimated(f"{name} [deg/s]", "180.0", column=name)
    assert found == pytest.approx(math.pi, rel=1e-9)
    assert estimated("speed [1]", "5.0", "%") == pytest.approx(500.0, rel=1e-9)


@pytest.mark.parametrize("title", ["speed (left)", "speed [LSB]", "speed / raw", "speed, raw"])
def test_title_that_ends_in_no_unit_needs_a_stated_one(title: str) -> None:
    with pytest.raises(InputError, match=r"^columns\.measurements\.0\.unit: is missing: the title"):
        estimated(title, "60.0")
    assert estimated(title, "60.0", unit="rpm") == pytest.approx(2.0 * math.pi, rel=1e-9)


def test_title_without_a_unit_has_that_of_the_model() -> None:
    assert estimated("speed", "2.0") == pytest.approx(2.0, rel=1e-9)
    assert estimated("speed []", "2.0") == pytest.approx(2.0, rel=1e-9)
    assert estimated("speed [-]", "2.0", "1") == pytest.approx(2.0, rel=1e-9)


def test_title_that_is_a_unit_itself_is_refused_with_both_readings() -> None:
    for title in ("km/h", "T/K"):
        with pytest.raises(InputError, match=r"may be a unit, or (km in h|T in K)$"):
            estimated(title, "1.0", column=title)
    assert estimated("km/h", "3.6", "m/s", column="km/h", unit="km/h") == pytest.approx(1.0)
    assert estimated("T/K", "2.0", "K", column="T") == pytest.approx(2.0)


def test_stated_unit_must_be_one_of_the_title() -> None:
    assert estimated("speed [1/min]", "60.0", unit="rpm") == pytest.approx(2.0 * math.pi)
    with pytest.raises(InputError, match=r"says rad/s, the header of r\.csv says 1/min"):
        estimated("speed [1/min]", "60.0", unit="rad/s")
    with pytest.raises(InputError, match=r"'1/min' cannot become 'rad/s'.* turns or radians"):
        estimated("speed (1/min)", "60.0")


def test_whole_title_is_preferred_to_one_with_a_unit() -> None:
    observer = {**OBSERVER, "states": {"x": "V"}, "measurements": {"x": "V"}}
    tree = {
        "observer": observer, "columns": {"measurements": [{"column": "U"}]},
        "sampling": {"period": 1.0},
    }  # fmt: skip
    rows = RowByRow(
        Estimation(parse(Specification, tree), ["U [mV]", "U"], "r.csv"), ["U [mV]", "U"]
    )
    assert float((rows.read("1.0,2.0") + rows.finish()).split(",")[1]) == pytest.approx(2.0)


@pytest.mark.parametrize("title", ["Time (ms)", "Time / ms", "Time, ms", "Time [ms]"])
def test_time_has_the_unit_of_its_title(title: str) -> None:
    columns = {"time": {"column": "Time"}, "measurements": [{"column": "v"}]}
    sampling = {"period": 0.25}
    tree = {"observer": OBSERVER, "columns": columns, "sampling": sampling}
    rows = RowByRow(Estimation(parse(Specification, tree), [title, "v"], "r.csv"), [title, "v"])
    found = [rows.read(f"{250 * k},1.0") for k in range(5)]
    assert [text.partition(",")[0] for text in found] == ["0.0", "0.25", "0.5", "0.75", "1.0"]
