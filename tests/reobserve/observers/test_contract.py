"""Requirements on every observer, tested on the records of `cases`."""

from __future__ import annotations

import copy
import inspect
import pickle
import sys
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass, replace
from functools import cache
from typing import Any

import numba
import numpy as np
import pandas as pd
import pytest
from numba.core.dispatcher import Dispatcher
from numpy.typing import NDArray

from reobserve.core.errors import DivergenceError, InputError
from reobserve.core.interrupts import FIRST
from reobserve.core.value import Value
from reobserve.observers.contract import IntegratingObserver, Observer
from reobserve.observers.imm import IMM
from reobserve.observers.levant import LevantDifferentiator
from reobserve.observers.run import Run
from tests.reobserve.observers.case import Case, observe
from tests.reobserve.observers.cases import CASES

Array = NDArray[np.float64]
RecordOf = Callable[[Case], dict[str, Any]]

SHORT = 40  # rows of a part that need not settle


@cache
def made(name: str) -> Case:
    """A case, whose record takes up to half a second to simulate."""
    return CASES[name]()


@pytest.fixture(params=CASES)
def case(request: pytest.FixtureRequest) -> Case:
    """A case with arrays of its own."""
    one = made(request.param)
    return replace(one, y=one.y.copy(), u=None if one.u is None else one.u.copy())


def part(case: Case, first: int, last: int, state: Any) -> Any:
    """The run over some rows."""
    u = None if case.u is None else case.u[first:last]
    return case.observer.run(case.y[first:last], u, start=state)


def row_of(case: Case, row: int) -> tuple[Array, Array | None]:
    return case.y[row], None if case.u is None else case.u[row]


def cut(record: dict[str, Any], rows: int | slice) -> dict[str, Any]:
    """Some rows of each array of a record."""

    def of(values: Any) -> Any:
        return tuple(map(of, values)) if isinstance(values, tuple) else of_one(values)

    def of_one(values: Array | None) -> Array | None:
        return None if values is None else values[rows]

    return {name: of(values) for name, values in record.items()}


def plain(case: Case) -> dict[str, Any]:
    """A short record."""
    return cut({"y": case.y, "u": case.u}, slice(0, SHORT))


def detailed(case: Case) -> dict[str, Any]:
    """A short record with everything an observer can read: jumps and midpoints, or gaps."""
    record = plain(case)
    if case.observer.reads_missing:
        record["y"] = record["y"].copy()
        record["y"][5], record["y"][20:23] = np.nan, np.nan
        record["y"][9].flat[0] = np.nan
    if isinstance(case.observer, IntegratingObserver):
        rng = np.random.default_rng(3)

        def near(values: Array | None, rows: list[int]) -> Array | None:
            if values is None:
                return None
            moved = values.copy()
            moved[rows] += 0.01 * rng.normal(size=moved[rows].shape)
            return moved

        jumps = list(range(3, SHORT))
        for name, rows in (("before", jumps), ("middle", list(range(SHORT)))):
            record[name] = tuple(near(record[each], rows) for each in ("y", "u"))
    return record


def same(one: Any, other: Any) -> bool:
    """Whether two states are bitwise identical."""
    if is_dataclass(one):
        return type(one) is type(other) and all(
            same(getattr(one, field.name), getattr(other, field.name)) for field in fields(one)
        )
    if isinstance(one, list | tuple):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, np.ndarray):
        return np.array_equal(one, other, equal_nan=True)
    return bool(one == other)


def same_rows(run: Any, other: Any, rows: slice = slice(None)) -> bool:
    """Whether a run equals some rows of another bitwise."""
    pairs = ((run.estimates, other.estimates), (run.before, other.before))
    return all(
        list(one) == list(two)
        and all(np.array_equal(one[name], two[name][rows], equal_nan=True) for name in two)
        for one, two in pairs
    )


# --- Calls --------------------------------------------------------------------------------------


@pytest.mark.parametrize("record_of", [plain, detailed])
def test_stepping_and_run_are_bitwise_identical(case: Case, record_of: RecordOf) -> None:
    record = record_of(case)
    run, state = case.observer.run(**record, start=case.state), case.state
    for row in range(SHORT):
        state, estimate = case.observer.step(state, **cut(record, row))
        assert estimate.time == run.time[row]
        assert estimate.units == run.units
        assert list(estimate.estimates) == list(run.estimates)
        for name in run.estimates:
            assert np.array_equal(estimate[name], run[name][row], equal_nan=True), (row, name)
    assert same(state, run.end)


@pytest.mark.parametrize("at", [1, 2, 5, 7, 21, SHORT - 1])
@pytest.mark.parametrize("record_of", [plain, detailed])
def test_two_consecutive_runs_equal_one(case: Case, record_of: RecordOf, at: int) -> None:
    record, run = record_of(case), case.observer.run
    whole, first = run(**record, start=case.state), run(**cut(record, slice(at)), start=case.state)
    second = run(**cut(record, slice(at, None)), start=first.end)
    assert same_rows(first, whole, slice(0, at))
    assert same_rows(second, whole, slice(at, SHORT))
    assert first.missing + second.missing == whole.missing
    assert np.array_equal(np.concatenate([first.time, second.time]), whole.time)
    assert same(second.end, whole.end)


def test_limits_and_midpoints_are_used(case: Case) -> None:
    record = detailed(case)
    if isinstance(case.observer, IntegratingObserver) and case.notices_midpoints:
        run = case.observer.run(**record, start=case.state)
        for name in ("before", "middle"):
            one = {key: value for key, value in record.items() if key != name}
            assert not same_rows(case.observer.run(**one, start=case.state), run), name
    elif not isinstance(case.observer, IntegratingObserver):
        with pytest.raises(TypeError, match="unexpected keyword argument 'before'"):
            case.observer.step(case.state, *row_of(case, 0), before=row_of(case, 0))


@pytest.mark.parametrize("rows", [1, 2, SHORT])
def test_run_returns_one_row_per_input_row(case: Case, rows: int) -> None:
    run = part(case, 0, rows, case.state)
    assert len(run) == len(run.time) == rows
    assert set(run.units) == set(run.estimates)
    for name in run.estimates:
        assert len(run[name]) == rows, name
    for name, limits in run.before.items():
        assert limits.shape == run[name].shape
    assert run.end.count == rows - 1
    last = [np.ravel(values) for values in row_of(case, rows - 1) if values is not None]
    row = np.concatenate(last)
    if len(row) == case.observer.measurements + case.observer.inputs:  # no derivatives to compute
        assert np.array_equal(run.end.sample, row)


def test_state_is_not_modified_by_later_steps(case: Case) -> None:
    state = part(case, 0, 9, case.state).end
    kept = pickle.loads(pickle.dumps(state))
    record = frozen(case.y), None if case.u is None else frozen(case.u)
    case = replace(
        case, y=record[0], u=record[1]
    )  # read-only, so that a run that writes into it fails
    once = part(case, 9, SHORT, state)
    case.observer.step(state, *row_of(case, 9))
    assert same(state, kept)
    assert same_rows(part(case, 9, SHORT, state), once)


def test_run_without_a_state_starts_by_default_or_requires_one(case: Case) -> None:
    if type(case.observer)._start is Observer._start:
        with pytest.raises(InputError, match=r"^start: must be given: \w+\.init says"):
            observe(case, start=None)
        return
    run = observe(case, start=None)
    assert len(run) == len(case.y)
    assert same_rows(observe(case, start=None), run)


# --- Time ---------------------------------------------------------------------------------------


def test_time_is_in_seconds(case: Case) -> None:
    period = case.observer.sampling_period
    run = part(case, 0, SHORT, case.state)
    assert np.array_equal(run.time, period * np.arange(SHORT))
    later = part(case, SHORT, 2 * SHORT, run.end)
    assert np.array_equal(later.time, period * np.arange(SHORT, 2 * SHORT))
    times = 1e3 + period * np.arange(len(case.y))
    stamped = observe(case, time=times)
    assert np.array_equal(stamped.time, times)
    assert not np.shares_memory(stamped.time, times)
    assert same_rows(stamped, observe(case))


@pytest.mark.parametrize("off", [0.5, -1.0, 1.0])
def test_uneven_times_are_refused_naming_the_row(case: Case, off: float) -> None:
    period = case.observer.sampling_period
    times = period * np.arange(len(case.y))
    times[7:] += off * period
    reported = (
        rf"^time: goes from .* s at row 7, must go on by the sampling period of {period:g} s"
        "(; for other times .*)?$"
    )
    with pytest.raises(InputError, match=reported):
        observe(case, time=times)


# --- Results of a run ---------------------------------------------------------------------------


def test_run_converts_to_a_data_frame(case: Case) -> None:
    run = part(case, 0, SHORT, case.state)
    frame = run.to_pandas()
    assert frame.index.name == "time"
    assert np.array_equal(frame.index, run.time)
    named = case.observer.component_names
    columns = [
        "_".join(
            (
                name,
                *(
                    str(place + 1) if names is None else names[place]
                    for place, names in zip(
                        index, named.get(name, (None,) * len(index)), strict=True
                    )
                ),
            )
        )
        for name in run.estimates
        for index in np.ndindex(run[name].shape[1:])
    ]
    assert list(frame) == columns
    flat = np.hstack([run[name].reshape(SHORT, -1) for name in run.estimates])
    assert np.array_equal(frame.to_numpy(), flat, equal_nan=True)


def test_run_plots_itself(case: Case) -> None:
    run = part(case, 0, SHORT, case.state)
    axes = run.plot().axes
    assert len(axes) == len(run.estimates)
    for ax, name in zip(axes, run.estimates, strict=True):
        assert np.array_equal(ax.lines[0].get_xdata(), run.time)
        first = run[name].reshape(SHORT, -1)[:, 0]
        assert np.array_equal(ax.lines[0].get_ydata(), first, equal_nan=True)
        unit = run.units[name]
        assert ax.get_ylabel() == (f"{name} [{unit}]" if unit else name)
    assert axes[-1].get_xlabel() == "time [s]"
    name = next(iter(run))
    assert list(run) == list(run.estimates)
    assert name in run
    assert "nothing" not in run
    assert len(run.plot([name]).axes) == 1
    with pytest.raises(InputError, match=r"^estimate: there is no 'nothing'"):
        run.plot(["nothing"])


def test_repr_is_one_line(case: Case) -> None:
    run = part(case, 0, SHORT, case.state)
    _, estimate = case.observer.step(run.end, *row_of(case, SHORT))
    for shown in (repr(case.observer), repr(run), repr(run.end), repr(estimate)):
        assert len(shown) < 600
        assert "\n" not in shown
        assert "object of type" not in shown
    assert repr(case.observer).startswith(f"{type(case.observer).__name__}(")
    assert "sampling_period=" in repr(case.observer)


def test_observers_and_states_compare_by_identity(case: Case) -> None:
    state = part(case, 0, 3, case.state).end
    for one in (case.observer, state):
        assert one == one  # noqa: PLR0124
        assert one != pickle.loads(pickle.dumps(one))
        assert {one: "kept"}[one] == "kept"


def test_plant_is_first_argument_and_period_is_keyword() -> None:
    """Filters have the period in their model; a differentiator has only a bound as its plant."""
    plant = {"model", "filters", "system", "normal_form", "decay"}
    for make in CASES.values():
        observer = make().observer
        parameters = inspect.signature(type(observer)).parameters
        assert next(iter(parameters)) in plant or isinstance(observer, LevantDifferentiator)
        one = getattr(observer, "filters", (observer,))[0]
        if hasattr(getattr(one, "model", None), "sampling_period"):
            assert "sampling_period" not in parameters
        else:
            period = parameters["sampling_period"]
            assert (period.kind, period.default) == (period.KEYWORD_ONLY, period.empty)


def test_arrays_are_read_only(case: Case) -> None:
    """The arrays of observers and states, from a run, a step, a copy or a pickle."""
    run = part(case, 0, 3, case.state)
    state, _ = case.observer.step(run.end, *row_of(case, 3))
    pickled = pickle.loads(pickle.dumps((case.observer, state)))
    values = [case.observer, run.end, state, copy.deepcopy(state), *pickled]
    count = 0
    for value in values:
        for array in arrays_in(value):
            with pytest.raises(ValueError, match="read-only"):
                array[...] = 0.0
            count += 1
    assert count >= 4


def arrays_in(value: Any) -> Iterator[Array]:
    """The arrays in the fields of an object, recursively."""
    if isinstance(value, np.ndarray):
        yield value
    elif isinstance(value, tuple):
        for one in value:
            yield from arrays_in(one)
    elif isinstance(value, Value):
        for field in fields(value):
            yield from arrays_in(getattr(value, field.name))


def test_pickled_observer_resumes_bitwise_identically(case: Case) -> None:
    first = part(case, 0, 9, case.state)
    observer, state, run = pickle.loads(pickle.dumps((case.observer, first.end, first)))
    assert repr(observer) == repr(case.observer)
    assert same(state, first.end)
    assert isinstance(run, Run)
    assert same_rows(run, first)
    rest = part(case, 9, SHORT, first.end)
    assert same_rows(part(replace(case, observer=observer), 9, SHORT, run.end), rest)


# --- Arguments ----------------------------------------------------------------------------------


def specialisations() -> int:
    """The number of compiled specialisations of all kernels."""
    kernels = {
        id(thing): len(thing.signatures)
        for name, module in sys.modules.items()
        if name.startswith("reobserve.")
        for thing in vars(module).values()
        if isinstance(thing, Dispatcher)
    }
    return sum(kernels.values())


def test_steps_compile_nothing(case: Case) -> None:
    """Kernels are compiled for writable arrays; those of states are read-only."""
    state = part(case, 0, 3, case.state).end
    before = specialisations()
    for row in range(3, 6):
        state, _ = case.observer.step(state, *row_of(case, row))
    observer, state = pickle.loads(pickle.dumps((case.observer, state)))
    part(replace(case, observer=observer), 6, 9, copy.deepcopy(state))
    assert specialisations() == before


def frozen(values: Array) -> Array:
    copy = values.copy()
    copy.flags.writeable = False
    return copy


def strided(values: Array) -> Array:
    """A view of every second column or number."""
    return np.repeat(values, 2, axis=-1)[..., ::2]


KINDS: dict[str, Callable[[Array], Any]] = {
    "lists": lambda values: values.tolist(),
    "read-only": frozen,
    "columns first": np.asfortranarray,
    "strided": strided,
    "frames": lambda values: pd.DataFrame(values) if values.ndim == 2 else pd.Series(values),
}


@pytest.mark.parametrize("kind", KINDS)
def test_array_likes_give_identical_bits_without_compilation(case: Case, kind: str) -> None:
    wanted = part(case, 0, SHORT, case.state)
    state, estimate = case.observer.step(wanted.end, *row_of(case, SHORT))
    as_kind, before = KINDS[kind], specialisations()
    known = None if case.u is None else as_kind(case.u[:SHORT])
    found = observe(case, y=as_kind(case.y[:SHORT]), u=known)
    assert same_rows(found, wanted)
    y, u = row_of(case, SHORT)
    stepped, again = case.observer.step(
        found.end, as_kind(np.atleast_1d(y)), None if u is None else as_kind(np.atleast_1d(u))
    )
    assert same(stepped, state)
    assert all(np.array_equal(again[name], estimate[name]) for name in estimate.estimates)
    assert specialisations() == before


def test_invalid_records_are_refused_naming_argument_and_row(case: Case) -> None:
    nan = case.y.copy()
    nan[5] = np.inf
    with pytest.raises(InputError, match=r"^y: sample 5 is "):
        observe(case, y=nan)
    with pytest.raises(InputError, match=r"^time: has \d+ rows, must have \d+ like y$"):
        observe(case, time=np.arange(3.0))
    with pytest.raises(InputError, match=r"^start: "):
        observe(case, start=case.y)
    with pytest.raises(InputError, match=r"^on_divergence: "):
        observe(case, on_divergence="ignore")
    if case.u is not None:
        with pytest.raises(InputError, match=r"^u: has 4 rows, must have \d+ like y$"):
            observe(case, u=case.u[:4])
        with pytest.raises(InputError, match=r"^u: is left out"):
            observe(case, u=None)


NOT_ROWS: dict[str, tuple[Callable[[int], Any], str]] = {
    "empty": (lambda rows: np.zeros((0, 1)), "has shape"),
    "too wide": (lambda rows: np.zeros((rows, 9)), "has shape"),
    "too deep": (lambda rows: np.zeros((rows, 1, 1, 1)), "has shape"),
    "one number": (lambda rows: 1.0, "has shape"),
    "text": (lambda rows: ["a"] * rows, "is no array of numbers"),
    "ragged": (lambda rows: [[1], [1, 2]] * rows, "is no array of numbers"),
}


@pytest.mark.parametrize("kind", NOT_ROWS)
def test_non_record_is_refused_naming_the_argument(case: Case, kind: str) -> None:
    make, said = NOT_ROWS[kind]
    for name in ("y", "u"):
        with pytest.raises(InputError, match=rf"^{name}: {said}"):
            observe(case, **{name: make(len(case.y))})
    if kind in ("too wide", "text", "ragged"):
        with pytest.raises(InputError, match=r"^y: "):
            case.observer.step(case.state, make(1), row_of(case, 0)[1])


def test_invalid_inputs_limits_and_midpoints_are_refused_naming_the_row(case: Case) -> None:
    y, u = row_of(case, 0)
    with pytest.raises(InputError, match=r"^y: sample 0 is "):
        case.observer.step(case.state, np.full(np.shape(y), np.inf), u)
    holed = None if case.u is None else case.u.copy()
    if holed is not None:
        holed[4] = np.nan
        with pytest.raises(InputError, match=r"^u: sample 4 is "):
            observe(case, u=holed)
    if isinstance(case.observer, IntegratingObserver):
        for name in ("before", "middle"):
            with pytest.raises(InputError, match=rf"^{name} y: has 3 rows, must have \d+ like y$"):
                observe(case, **{name: (case.y[:3], None)})
            with pytest.raises(InputError, match=rf"^{name}: .* must be a pair of y and u$"):
                observe(case, **{name: case.y})
            if holed is not None:
                with pytest.raises(InputError, match=rf"^{name} u: sample 4 is "):
                    observe(case, **{name: (None, holed)})


# --- Divergence ---------------------------------------------------------------------------------


def test_divergence_is_reported_in_record_time(case: Case) -> None:
    y, u = case.y[:SHORT].copy(), None if case.u is None else case.u[:SHORT].copy()
    signs = np.resize([1.0, -1.0], SHORT - 20)
    for values in (y, u):
        if values is not None:
            values[20:] = ((case.huge or 1e300) * signs).reshape(-1, *[1] * (values.ndim - 1))
    times = 50.0 + case.observer.sampling_period * np.arange(SHORT)
    arguments = {"y": y, "u": u, "time": times}
    run = observe(case, **arguments, on_divergence="return")
    if case.huge is None:  # cannot diverge
        assert run.diverged_at is None
        assert len(run) == SHORT
        assert all(np.isfinite(run[name]).all() for name in run.estimates)
        return
    assert run.diverged_at == run.time[-1] == times[len(run) - 1]
    assert 19 <= len(run) - 1 < SHORT - 1
    clean = part(case, 0, 20, case.state)
    assert all(np.array_equal(run[name][:20], clean[name][: len(run)]) for name in clean.estimates)
    assert all(np.isfinite(run[name]).all() for name in run.estimates)
    assert run.end is case.state
    with pytest.raises(
        DivergenceError, match=f"^{type(case.observer).__name__} diverged"
    ) as reported:
        observe(case, **arguments)
    assert reported.value.time == run.diverged_at
    # Resuming with the diverging row, the last finite time is before the record.
    rest = len(run)
    before = observe(case, y=y[:rest], u=None if u is None else u[:rest], time=times[:rest])
    again = case.observer.run(
        y[rest:], None if u is None else u[rest:], start=before.end, time=times[rest:],
        on_divergence="return",
    )  # fmt: skip
    assert len(again) == 0
    assert again.diverged_at == pytest.approx(run.diverged_at, rel=1e-12)


# --- Alignment ----------------------------------------------------------------------------------


def moved(values: Array) -> Iterator[Array]:
    """The record shifted by a row, late and early."""
    yield np.concatenate([values[:1], values[:-1]])
    yield np.concatenate([values[1:], values[-1:]])


def worst_error(case: Case, **changed: Any) -> float:
    """The largest error after settling, as a multiple of its bound."""
    run = observe(case, **changed)
    return max(
        float(np.abs(run[name] - truth)[case.settled :].max()) / case.bounds[name]
        for name, truth in case.truth.items()
    )


@pytest.mark.nightly_cases("IMM of extended Kalman filters")
def test_only_correctly_aligned_rows_give_the_true_values(case: Case) -> None:
    aligned = worst_error(case)
    assert aligned < 1.0
    for y in moved(case.y):
        assert worst_error(case, y=y) > case.worse * aligned
    if case.u is not None:
        for u in moved(case.u):
            assert worst_error(case, u=u) > case.worse * aligned


def test_long_loops_look_in_time_and_can_be_interrupted(
    case: Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    if isinstance(case.observer, IMM) and not case.observer._linear:
        pytest.skip("its loop is one of Python")
    if numba.config.DISABLE_JIT:
        pytest.skip("no loop is compiled")

    class SignalError(Exception):
        pass

    rows = []

    def raise_late(row: int) -> int:
        rows.append(row)
        if row > FIRST:
            raise SignalError
        return row + FIRST

    times = 2 * FIRST // len(case.y) + 1
    y, u = (None if one is None else np.concatenate([one] * times) for one in (case.y, case.u))
    monkeypatch.setattr("reobserve.core.interrupts.next_poll", raise_late)
    with pytest.raises(SignalError):
        case.observer.run(y, u, start=case.state, on_divergence="return")
    assert rows == [FIRST, 2 * FIRST]
