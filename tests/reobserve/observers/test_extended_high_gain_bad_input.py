"""The extended observer in use: streams, reports and error messages."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

from reobserve.core.errors import DivergenceError, InputError
from reobserve.observers.extended_high_gain import (
    ExtendedHighGainObserver,
    ExtendedHighGainState,
    SwitchedOffWarning,
)
from reobserve.observers.fixed_step import run_on_halves
from tests.reobserve.observers.halves import rows_of, stepped
from tests.reobserve.observers.small_plants import pendulum
from tests.reobserve.observers.test_extended_high_gain import (
    FIRST_DELAY,
    Case,
    observed,
    observer,
    record,
    together,
)

# ---- Streams


@pytest.mark.parametrize("switched", ["delay", "all"])
def test_stepping_and_piecewise_runs_are_bitwise_identical_to_one_run(switched: str) -> None:
    """With noise on y and u, held over two steps, and the dynamic S."""
    case, h = Case("sine", 5.0, 2, 0.7, switched, dynamic=True), 0.01
    (y, u), built = record("sine", h, 10.0), observer(case, h)
    noise = np.repeat(np.random.default_rng(1).normal(0, 0.05, (len(y) // 4 + 1, 2)), 4, axis=0)
    right, left = noise[: len(y)], np.vstack([noise[:1], noise])[: len(y)]
    pair = np.column_stack([y, u[:, 0]])
    (y, a), (y_before, b) = (pair + right).T, (pair + left).T
    rate = u[:, 1:]
    u, u_before = np.column_stack([a, rate]), np.column_stack([b, rate])
    start = built.init([0.0, 0.0], delay=FIRST_DELAY)
    whole = run_on_halves(built, y, u, start=start, y_before=y_before, u_before=u_before)
    assert 0.05 < whole["switched_off"][1:].mean() < 0.4
    state, found = stepped(built, start, y, u, y_before, u_before)
    for name in ("state", "delay", "switched_off"):
        assert np.array_equal(rows_of(found, name), whole[name])
    first, rest = start, []
    for rows in (slice(801), slice(801, None)):
        run = run_on_halves(
            built, y[rows], u[rows], start=first, y_before=y_before[rows], u_before=u_before[rows]
        )
        first = run.end
        rest.append(together(run))
    assert np.array_equal(np.concatenate(rest), together(whole))
    assert run.end.count == state.count == whole.end.count == 1000
    # The limits from the left are used: without them the run differs.
    assert not np.array_equal(run_on_halves(built, y, u, start=start)["delay"], whole["delay"])


# ---- Reports


def test_too_large_step_diverges_and_reports_the_time() -> None:
    """rho times the step is 8, far above 2.78: the state grows until overflow."""
    case, step = Case("sine", 80.0, 2, 0.7), 0.1
    run = observed(case, step, 20.0)
    assert run.diverged_at is not None
    assert 0 < run.diverged_at < 20
    assert len(run["delay"]) == round(run.diverged_at / step) + 1 == len(run["switched_off"])
    assert np.isfinite(together(run)).all()
    assert run.end.count == 0, "the state that the run started from"
    (y, u), built = record("sine", step, 20.0), observer(case, step)
    last, start = 2 * len(run) - 1, built.init([0.0, 0.0], delay=FIRST_DELAY)
    before = run_on_halves(built, y[:last], u[:last], start=start)
    assert before.diverged_at is None
    with pytest.raises(DivergenceError, match=f"finite up to t = {run.diverged_at:g} s and not"):
        built.step(before.end, y[last + 1], u[last + 1], middle=(y[last], u[last]))


@pytest.mark.parametrize("switched", ["delay", "all"])
def test_threshold_that_is_never_exceeded_warns(switched: str) -> None:
    """|xi| of the pendulum is 4 at most, and 2 tau / 5 more for m = 2."""
    sentence = r"^threshold: 5 is above \|xi\^\| for 100 % of the record, so the delay was never "
    with pytest.warns(SwitchedOffWarning, match=sentence):
        run = observed(Case("sine", 2.5, 2, 5.0, switched), 0.01, 10.0)
    assert np.array_equal(run["switched_off"], [0.0, *np.ones(1000)])
    assert np.array_equal(run["delay"], np.full(1001, FIRST_DELAY))
    with warnings.catch_warnings():
        warnings.simplefilter("error", SwitchedOffWarning)
        some = observed(Case("sine", 2.5, 2, 3.9, switched), 0.01, 10.0)
        assert 0.5 < some["switched_off"][1:].mean() < 1
        # Single steps do not warn, as any of them may be switched off.
        y, u = record("sine", 0.01, 1.0)
        built = observer(Case("sine", 2.5, 2, 5.0, switched), 0.01)
        state, found = stepped(built, built.init([0.0, 0.0], delay=FIRST_DELAY), y, u)
    assert np.array_equal(rows_of(found, "switched_off"), [0.0, *np.ones(100)])
    with pytest.warns(SwitchedOffWarning, match=sentence) as reported:
        built.run(y[1:], u[1:], start=state)
    assert reported[-1].filename == __file__


# ---- Error messages

GOOD: dict[str, Any] = {
    "model": pendulum(), "sampling_period": 0.01, "rho": 5.0, "order": 2,
    "delay_bounds": (0.0, 1.5),
}  # fmt: skip
SKEW = [[1, 2, 0], [0, 1, 0], [0, 0, 1]]
BAD_OBSERVERS: list[Any] = [
    ({"rho": 0}, "rho: 0 must be greater than zero"),
    ({"rho": -1}, "rho: -1 must be greater than zero"),
    ({"rho": "5"}, "rho: '5' is not a number"),
    ({"rho": 1e200}, "rho: 1e+200 1/s must keep S and the gains inside the float range"),
    ({"sampling_period": 0}, "sampling_period: 0 must be greater than zero"),
    ({"order": 0}, "order: 0 must be a whole number, from 1 to 1000"),
    ({"order": 2.5}, "order: 2.5 must be a whole number"),
    ({"order": "2"}, "order: '2' must be a whole number"),
    ({"order": True}, "order: True must be a whole number"),
    ({"delay_bounds": (1, 1)}, "delay_bounds: [1, 1] s must be 0 or more, rising"),
    ({"delay_bounds": (1.5, 0)}, "delay_bounds: [1.5, 0] s must be 0 or more, rising"),
    ({"delay_bounds": (-0.1, 1)}, "delay_bounds: [-0.1, 1] s must be 0 or more, rising"),
    ({"delay_bounds": (1,)}, "delay_bounds: has shape (1,), must be a list of 2 numbers"),
    ({"delay_bounds": (0, np.inf)}, "delay_bounds: [0.0, inf] has an entry that is not finite"),
    ({"threshold": -0.1}, "threshold: -0.1 must not be negative"),
    ({"threshold": np.nan}, "threshold: nan has an entry that is not finite"),
    ({"switched": "gain"}, "switched: 'gain' must be one of delay, all"),
    ({"switched": None}, "switched: None must be one of delay, all"),
    ({"initial_matrix": -1.0}, "initial_matrix: must be positive definite, its eigenvalues are"),
    ({"initial_matrix": [1, 1]}, "initial_matrix: has shape (2,), must be one number"),
    ({"initial_matrix": SKEW}, "initial_matrix: [[1.0, 2.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1"),
    ({"initial_matrix": "algebraic"}, "initial_matrix: 'algebraic' is not a number"),
]


def refused(call: Any, sentence: str) -> None:
    with pytest.raises(InputError) as caught:
        call()
    said = str(caught.value)
    assert said.startswith(sentence)
    assert "\n" not in said
    assert ". " not in said, "more than one sentence"


@pytest.mark.parametrize(("change", "sentence"), BAD_OBSERVERS)
def test_invalid_observers_are_refused(change: dict[str, Any], sentence: str) -> None:
    refused(lambda: ExtendedHighGainObserver(**{**GOOD, **change}), sentence)


def test_bounds_stay_when_the_list_that_gave_them_changes() -> None:
    bounds = [0, 2]
    built = ExtendedHighGainObserver(**{**GOOD, "delay_bounds": bounds})
    bounds[1] = 1
    assert built.delay_bounds == (0.0, 2.0)


@pytest.mark.parametrize(
    ("estimate", "delay", "sentence"),
    [
        ([0, 0], 1.6, "delay: 1.6 s must be inside its bounds, [0, 1.5] s"),
        ([0, 0], -0.1, "delay: -0.1 s must be inside its bounds, [0, 1.5] s"),
        ([0, 0], np.nan, "delay: nan has an entry that is not finite"),
        ([0, 0], [0.3], "delay: [0.3] must be one number"),
        ([0, 0, 0], 0.3, "state: has shape (3,), must be a list of 2 numbers"),
        ([0, np.inf], 0.3, "state: [0.0, inf] has an entry that is not finite"),
        ("ab", 0.3, "state: 'ab' is not a number"),
    ],
)
def test_invalid_initial_states_are_refused(estimate: Any, delay: Any, sentence: str) -> None:
    refused(lambda: ExtendedHighGainObserver(**GOOD).init(estimate, delay=delay), sentence)


Y, U = np.zeros(5), np.ones((5, 3))
DERIVATIVES = "must have 3 columns, a signal and its derivatives up to the order 2, or one, the s"
BAD_RECORDS: list[Any] = [
    ({"u": U[:, :2]}, f"u: has shape (5, 2), {DERIVATIVES}"),
    ({"u": np.ones((5, 4))}, f"u: has shape (5, 4), {DERIVATIVES}"),
    ({"before": (Y, U[:, :2])}, f"before u: has shape (5, 2), {DERIVATIVES}"),
    ({"middle": (None, U[:, :2])}, f"middle u: has shape (5, 2), {DERIVATIVES}"),
]


@pytest.mark.parametrize(("changed", "sentence"), BAD_RECORDS)
def test_invalid_records_are_refused(changed: dict[str, Any], sentence: str) -> None:
    built = ExtendedHighGainObserver(**GOOD)
    rows: dict[str, Any] = {"y": Y, "u": U, **changed}
    refused(lambda: built.run(**rows, start=built.init([0, 0], delay=FIRST_DELAY)), sentence)


@pytest.mark.parametrize(
    ("row", "sentence"),
    [
        ((0.0, [1.0, 2.0]), f"u: has shape (1, 2), {DERIVATIVES}"),
        ((0.0, None), "u: is left out, must have shape (1, 3)"),
    ],
)
def test_invalid_single_samples_are_refused(row: tuple[Any, Any], sentence: str) -> None:
    built = ExtendedHighGainObserver(**GOOD)
    refused(lambda: built.step(built.init([0, 0], delay=FIRST_DELAY), *row), sentence)


def test_state_of_another_observer_is_refused() -> None:
    built, other = (
        ExtendedHighGainObserver(**GOOD),
        ExtendedHighGainObserver(**{**GOOD, "order": 1}),
    )
    problem = "start: must be of an observer of 2 states and the order 2"
    refused(lambda: built.run(Y, U, start=ExtendedHighGainState(np.zeros(2), np.zeros(3))), problem)
    refused(lambda: built.run(Y, U, start=other.init([0, 0], delay=FIRST_DELAY)), problem)
