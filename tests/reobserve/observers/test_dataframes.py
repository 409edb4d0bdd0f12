"""Frames of pandas as records: names of columns, an index of times, and what is no number."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from reobserve import (
    AugmentedKalmanFilter,
    ExtendedKalmanFilter,
    FaultBank,
    InputError,
    KalmanFilter,
    LinearModel,
    NonlinearModel,
    SmoothVariableStructureFilter,
    UnscentedKalmanFilter,
    luenberger,
    rts_smoother,
)
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
    return KALMAN.run(y, u, start=KALMAN.init([0.0, 0.0], 1.0), **given)


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


NONLINEAR = NonlinearModel.from_ode(
    ["push - speed", "speed - load"], ["speed", "load"], Q=1.0, R=1.0, sampling_period=0.5,
    state_names=["speed", "load"], output_names=["left", "right"], input_names=["push"],
)  # fmt: skip
FAULT: Any = {"fault_matrix": [[1.0], [0.0]]}


@pytest.mark.parametrize(
    "named",
    [
        KalmanFilter(MODEL, gate=3.0, noise_memory=5.0),
        SmoothVariableStructureFilter(MODEL, boundary_layer=1.0, convergence_rate=0.5),
        AugmentedKalmanFilter(MODEL, random_walk=0.1, unknown_input_names=["force"], **FAULT),
        FaultBank(
            MODEL, drift=0.1, jump=1.0, jump_rate=0.1, jump_time=1.0, fault_names=["force"], **FAULT
        ),
        ExtendedKalmanFilter(NONLINEAR), UnscentedKalmanFilter(NONLINEAR),
    ],
    ids=lambda one: type(one).__name__,
)  # fmt: skip
def test_columns_have_the_names_of_their_signals(named: Any) -> None:
    """No component is numbered but those of the filters of a bank."""
    made = named.run(VALUES, PUSH.to_numpy(), start=named.init([0.0, 0.0], 1.0))
    of_filter = r"^(probability|innovation)_\d" if isinstance(named, FaultBank) else "$"
    assert not re.findall(r"_\d", " ".join(re.sub(of_filter, "", one) for one in made.to_pandas()))


def test_smoother_of_a_frame_keeps_dates() -> None:
    model = LinearModel(
        0.9 * np.eye(2), np.diag([1.0, 5.0]), np.eye(2), Q=1.0, R=1.0, sampling_period=0.5,
        input_names=["push", "pull"],
    )  # fmt: skip
    kalman, u = KalmanFilter(model), frame("push pull")
    filtered = kalman.run(pd.DataFrame(VALUES, index=DATES), u, start=kalman.init([0.0, 0.0], 1.0))
    sought = rts_smoother(kalman.run(VALUES, VALUES, start=kalman.init([0.0, 0.0], 1.0)))
    found = rts_smoother(filtered)
    assert np.array_equal(found["state"], sought["state"])
    assert found.to_pandas().index.equals(DATES)


def test_columns_that_nobody_reads_change_nothing() -> None:
    log = pd.concat([frame(), PUSH], axis=1).assign(note="calm", right_2=np.nan)
    sought = run(frame(), PUSH)
    assert np.array_equal(run(log, log)["state"], sought["state"])
    start, row = KALMAN.init([0.0, 0.0], 1.0), log.iloc[0].drop("note").astype(float)
    _, found = KALMAN.step(start, row, row)
    assert np.array_equal(found["state"], sought["state"][0])
    with pytest.raises(InputError, match=r"y: has no column right, .*; did you mean 'rigth'"):
        run(log.rename(columns={"right": "rigth"}).drop(columns="right_2"), log)


@pytest.mark.parametrize("measured", [["left"], ["right"], ["right", "left"], []])
def test_step_takes_the_sensors_that_measured_by_name(measured: list[str]) -> None:
    start, row = KALMAN.init([0.3, 0.1], 1.0), dict(zip(["left", "right"], VALUES[0], strict=True))
    given = {name: row[name] for name in measured}
    _, found = KALMAN.step(start, given, {"push": 2.0})
    _, sought = KALMAN.step(start, [given.get("left", np.nan), given.get("right", np.nan)], [2.0])
    assert np.array_equal(found["state"], sought["state"])


@pytest.mark.parametrize(
    ("y", "u", "said"),
    [
        ({"rigth": 1.0}, {"push": 2.0}, "y: 'rigth' names no output; did you mean 'right'"),
        ({"left": 1.0}, {}, "u: has no entry push, must have push"),
        ({"left": 1.0}, {"push": 1.0, "pull": 2.0}, "u: 'pull' names no input"),
        ({"left": "high"}, {"push": 1.0}, "y: .* is no array of numbers"),
    ],
)
def test_names_in_a_step_that_do_not_fit_are_refused(y: Any, u: Any, said: str) -> None:
    with pytest.raises(InputError, match=f"^{said}"):
        KALMAN.step(KALMAN.init([0.0, 0.0], 1.0), y, u)


def test_columns_without_names_are_taken_by_position() -> None:
    assert np.array_equal(run(pd.DataFrame(VALUES))["state"], run(VALUES)["state"])


@pytest.mark.parametrize(
    ("y", "u", "said"),
    [
        (frame("left middle"), PUSH, "y: has no column right, .*; there are: left, middle"),
        (
            frame(),
            PUSH.rename(columns={"push": "pull"}),
            "u: has no column push, must have push; did you mean 'pull'",
        ),
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
    ],
)
def test_entry_that_is_no_number_is_named(y: Any, said: str) -> None:
    with pytest.raises(InputError, match=said):
        run(y, PUSH.to_numpy())


def test_na_is_a_missing_measurement_and_no_input() -> None:
    nullable = frame().astype("Float64").where(VALUES != 20.0)
    sought = run(np.where(VALUES == 20.0, np.nan, VALUES), PUSH.to_numpy())
    found = run(nullable[["right", "left"]])
    assert np.array_equal(found["state"], sought["state"])
    assert found.missing == 1
    with pytest.raises(InputError, match="u: sample 1 is"):
        run(VALUES, PUSH.astype("Float64").where(VALUES[:, :1] != 2.0))


def test_sample_as_a_series_is_matched_by_name() -> None:
    start = KALMAN.init([0.0, 0.0], 1.0)
    _, sought = KALMAN.step(start, [1.0, 10.0], [2.0])
    row, push = pd.Series({"right": 10.0, "left": 1.0}), pd.Series({"push": 2.0})
    _, found = KALMAN.step(start, row, push)
    assert np.array_equal(found["state"], sought["state"])
    _, found = KALMAN.step(start, frame().iloc[0], [2.0])
    assert np.array_equal(found["state"], sought["state"])
    with pytest.raises(InputError, match=r"y: has no entry right, .*; there are: middle, left"):
        KALMAN.step(start, row.rename({"right": "middle"}), push)
    with pytest.raises(InputError, match="u: has no entry push, must have push; did"):
        KALMAN.step(start, row, pd.Series({"pull": 2.0}))


def test_index_of_periods_is_one_of_times() -> None:
    model = LinearModel([[1.0]], C=[[1.0]], Q=1.0, R=1.0, sampling_period=3600.0)
    kalman, hours = KalmanFilter(model), pd.period_range("2026-01-01", periods=4, freq="h")
    found = kalman.run(pd.Series(VALUES[:, 0], index=hours), start=kalman.init([0.0], 1.0))
    assert found.to_pandas().index.equals(hours.to_timestamp())
    rows = pd.Series(VALUES[:3, 0], index=hours[[0, 1, 3]])
    with pytest.raises(InputError, match=r"y: has an index that goes from .* at row 2"):
        kalman.run(rows, start=kalman.init([0.0], 1.0))


def test_count_of_rows_with_a_gap_is_refused() -> None:
    u = PUSH.to_numpy()
    for index in ([10, 11, 12, 13], [0, 10, 20, 30]):
        assert len(run(frame(index=index), u)) == 4
    for index in ([0, 1, 3, 4], [3, 2, 1, 0], [0, 0, 0, 0]):
        with pytest.raises(InputError, match=r"y: has an index .* must go on by equal steps"):
            run(frame(index=index), u)
    assert len(run(frame(index=[0, 1, 3, 4]), u, time=0.5 * np.arange(4.0))) == 4


@pytest.mark.parametrize(
    "times", [DATES, DATES.tz_localize(None), DATES.tz_localize(None).to_period("ms")]
)
def test_dates_as_time_are_seconds_since_1970(times: Any) -> None:
    found = run(VALUES, PUSH.to_numpy(), time=times)
    first = DATES[0].timestamp() + (0.0 if times is DATES else 3600.0)
    assert found.time.tolist() == [first, first + 0.5, first + 1.0, first + 1.5]
    with pytest.raises(InputError, match=r"time: goes from .* at row 1"):
        run(VALUES, PUSH.to_numpy(), time=DATES[[0, 2, 3, 3]])
    unknown = DATES.tz_localize(None).to_numpy().copy()
    unknown[1] = np.datetime64("NaT")
    with pytest.raises(InputError, match="time: is not known at row 1"):
        run(VALUES, PUSH.to_numpy(), time=unknown)


def test_next_frame_goes_on_from_the_state_or_is_refused() -> None:
    whole = run(frame())
    first = run(frame().iloc[:2], PUSH.iloc[:2])
    second = KALMAN.run(frame().iloc[2:], PUSH.iloc[2:], start=first.end)
    assert np.array_equal(second["state"], whole["state"][2:])
    assert second.time.tolist() == [1.0, 1.5]
    for seconds in (60.0, -0.5, -1e6):
        later = frame().iloc[2:].set_axis(DATES[2:] + pd.Timedelta(seconds, "s"))
        with pytest.raises(InputError, match=r"y: has an index that begins at .* must go on by"):
            KALMAN.run(later, PUSH.iloc[2:].to_numpy(), start=first.end)
    with pytest.raises(InputError, match=r"y: has an index that begins at"):
        KALMAN.run(frame(), PUSH, start=whole.end)  # the same day again


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
