"""Frames of pandas as records: names of columns, an index of times, and what is no number."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from reobserve import InputError, KalmanFilter, LinearModel, luenberger, rts_smoother
from tests.reobserve.observers.case import observe
from tests.reobserve.observers.cases import CASES

pd = pytest.importorskip("pandas")

MODEL = LinearModel(
    np.eye(2), [[1.0], [0.0]], np.eye(2), Q=1.0, R=1.0, sampling_period=0.5,
    state_names=["speed", "load"], output_names=["left", "right"], input_names=["push"],
)  # fmt: skip
KALMAN = KalmanFilter(MODEL)
DATES = pd.date_range("2026-03-29 00:59:59", periods=4, freq="500ms", tz="Europe/Berlin")
VALUES = np.array([[1.0, 10.0], [2.0, 20.0], [3.0, 30.0], [4.0, 40.0]])
PUSH = pd.DataFrame({"push": [0.0, 1.0, 0.0, 1.0]}, index=DATES)


def run(y: Any, u: Any = PUSH, **given: Any) -> Any:
    return KALMAN.run(y, u, state=KALMAN.init([0.0, 0.0], 1.0), **given)


def frame(names: str = "left right", index: Any = DATES) -> Any:
    return pd.DataFrame(VALUES, columns=names.split(), index=index)


def test_columns_are_matched_by_name_and_dates_stay() -> None:
    sought = run(VALUES, PUSH.to_numpy())
    swapped = frame()[["right", "left"]]
    found = run(swapped)
    assert np.array_equal(found["state"], sought["state"])
    table = found.to_pandas()
    assert table.index.equals(DATES)
    assert table["state_load"].tolist() == sought["state"][:, 1].tolist()
    assert run(frame(index=None), PUSH.reset_index(drop=True)).to_pandas().index.name == "time"


def test_smoother_takes_columns_by_name_and_keeps_dates() -> None:
    model = LinearModel(
        0.9 * np.eye(2), np.diag([1.0, 5.0]), np.eye(2), Q=1.0, R=1.0, sampling_period=0.5,
        input_names=["push", "pull"],
    )  # fmt: skip
    kalman, u = KalmanFilter(model), frame("push pull")
    filtered = kalman.run(pd.DataFrame(VALUES, index=DATES), u, state=kalman.init([0.0, 0.0], 1.0))
    sought = rts_smoother(kalman, filtered, VALUES)
    found = rts_smoother(kalman, filtered, u[["pull", "push"]])
    assert np.array_equal(found["state"], sought["state"])
    assert found.to_pandas().index.equals(DATES)
    with pytest.raises(InputError, match="u: has the columns push, load, must have push, pull"):
        rts_smoother(kalman, filtered, frame("push load"))


def test_columns_without_names_are_taken_by_position() -> None:
    assert np.array_equal(run(pd.DataFrame(VALUES))["state"], run(VALUES)["state"])


@pytest.mark.parametrize(
    ("y", "u", "said"),
    [
        (frame("left middle"), PUSH, "y: has the columns left, middle, must have left, right"),
        (frame(), PUSH.rename(columns={"push": "pull"}), "u: has the columns pull, must have push"),
        (frame(index=DATES[[0, 1, 3, 2]]), PUSH, "y: has an index that goes from .* at row 2"),
        (frame(index=[0.0, 0.5, 1.0, 2.0]), PUSH.to_numpy(), "y: .* from 1.0 to 2.0 at row 3"),
        (
            frame(index=pd.to_timedelta([0, 1, 2, 3], "s")),
            PUSH.to_numpy(),
            "y: has an index .* at row 1, must go on by the sampling period of 0.5 s",
        ),
        (frame(), PUSH.set_axis(DATES + pd.Timedelta("1s")), "u: has .* in the index of row 0, y"),
    ],
)
def test_other_names_and_times_are_refused(y: Any, u: Any, said: str) -> None:
    with pytest.raises(InputError, match=said):
        run(y, u)


@pytest.mark.parametrize(
    ("y", "said"),
    [
        ([[1.0, 2.0], [3.0, None]] * 2, r"y: is no array of numbers: the entry \[1, 1\] is None"),
        (VALUES.astype(object), "y: is no array of numbers: the dtype is object"),
        (np.ma.masked_equal(VALUES, 30.0), r"y: .*: the entry \[2, 1\] is masked"),
        (
            frame().astype("Float64").where(VALUES != 20.0),
            r"y: .*: the entry \[1, 1\] is .*NA.* and the dtype object",
        ),
    ],
)
def test_entry_that_is_no_number_is_named(y: Any, said: str) -> None:
    with pytest.raises(InputError, match=said):
        run(y, PUSH.to_numpy())


def test_poles_outside_the_unit_circle_are_named() -> None:
    model = LinearModel([[1.0, 0.1], [0.0, 1.0]], C=[[1.0, 0.0]], Q=1.0, R=1.0)
    with pytest.raises(InputError, match=r"poles: -3 is not inside the unit circle"):
        luenberger(model, [-3.0, -4.0])


@pytest.mark.parametrize("name", CASES)
def test_each_observer_takes_frames_with_times(name: str) -> None:
    case = CASES[name]()
    y, u = case.y[:5], None if case.u is None else case.u[:5]
    index = pd.to_timedelta(case.observer.sampling_period * np.arange(5.0), unit="s")
    found = observe(case, y=pd.DataFrame(y, index=index), u=None if u is None else pd.DataFrame(u))
    sought = observe(case, y=y, u=u)
    assert found.index.equals(index)
    for estimate in sought:
        assert np.array_equal(found[estimate], sought[estimate], equal_nan=True)
