"""What a user of the estimators of a delay relies on, and the numbers of the comparison."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from reobserve.core.errors import DivergenceError, InputError
from reobserve.observers.fixed_step import run_on_halves
from reobserve.papers.delay.estimator import DelayEstimator, State
from reobserve.papers.delay.estimator_adaptive import AdaptiveDelayEstimator
from reobserve.papers.delay.estimator_least_squares import LeastSquaresDelayEstimator
from tests.observers.halves import rows_of, stepped
from tests.papers.delay.scalar_plant import (
    ALL,
    BOUNDS,
    FAST,
    SMOOTH,
    Input,
    half_steps,
    observed,
    paper_delay,
    past_of,
    record,
    run,
    short_delay,
)


@pytest.mark.parametrize("kind", ALL)
def test_streaming_gives_the_bits_of_a_batch(kind: str) -> None:
    """With an input that jumps, before the start and after, and a kink at the start."""
    estimator = replace(ALL[kind](0.05), delay_bounds=(0.1, 0.72))
    output, control, past = record(estimator, FAST, short_delay, 9.0)
    control_before, past_before = control.copy(), past.copy()
    control[40:] += 0.1
    control_before[41:] += 0.1
    past[20:], past_before[21:] = 0.0, 0.0
    start = estimator.init(0.0, 0.3, **past_of(past, past_before))
    whole = run_on_halves(estimator, output, control, state=start, u_before=control_before)
    state, found = stepped(estimator, start, output, control, u_before=control_before)
    assert np.array_equal(whole["delay"], rows_of(found, "delay"))
    assert np.array_equal(whole["values"], rows_of(found, "values"))
    assert np.array_equal(whole.state.values, state.values)
    assert state.count == whole.state.count == 180
    assert np.array_equal(whole.state.history.right, state.history.right)
    assert np.array_equal(whole.state.history.left, state.history.left)
    assert np.ptp(whole["delay"]) > 0.05
    # The limits of u from the left are read, in the record and in its past; a relay, which looks
    # at the sign alone, need not notice.
    if kind not in SMOOTH:
        return
    for other, left in ((start, control), (estimator.init(0.0, 0.3, **past_of(past)), None)):
        before = control_before if left is None else left
        run = run_on_halves(estimator, output, control, state=other, u_before=before)
        assert not np.array_equal(run["delay"], whole["delay"])


def test_least_squares_winds_up_at_rest_and_says_when() -> None:
    estimator = LeastSquaresDelayEstimator(1.0, 1.0, BOUNDS, 1.0, 100.0, sampling_period=0.01)
    still = np.tile([1.0, 0.0], (2001, 1))
    output = 1 - np.exp(-half_steps(0.01, 10.0)[:, None]) * 0.5
    state = estimator.init(0.4, 0.3, np.tile([1.0, 0.0], (151, 1)))
    done = run_on_halves(estimator, output, still, state=state, on_divergence="return")
    assert done.diverged_at is not None
    assert 0 < done.diverged_at < 10
    assert done.state is state
    assert len(done) == round(done.diverged_at / 0.01) + 1
    assert np.isfinite(done["values"]).all()
    last = 2 * len(done) - 1
    before = run_on_halves(estimator, output[:last], still[:last], state=state)
    assert before.diverged_at is None
    said = f"finite up to t = {done.diverged_at:g} s .* its step of 0.01 s is too long"
    with pytest.raises(DivergenceError, match=said):
        estimator.step(
            before.state, output[last + 1], still[last + 1], middle=(output[last], still[last])
        )


def test_bounds_of_the_delay_are_two_numbers_however_they_are_given() -> None:
    given = replace(ALL["relay"](0.01), delay_bounds=np.array([0, 1]))  # type: ignore[arg-type]
    assert given.delay_bounds == (0.0, 1.0)


@pytest.mark.parametrize(
    ("kind", "change", "sentence"),
    [
        ("adaptive", {"delay_bounds": (-0.1, 1)}, "delay_bounds: -0.1 and 1 s must be 0 <= tau_"),
        ("adaptive", {"delay_bounds": (1, 1)}, "delay_bounds: 1 and 1 s must be 0 <= tau_min <"),
        ("adaptive", {"delay_bounds": (1,)}, "delay_bounds: has shape (1,), must be a list of 2"),
        ("relay", {"input_gain": 0}, "input_gain: 0 must not be zero"),
        ("relay", {"sampling_period": 0}, "sampling_period: 0 must be greater than zero"),
        ("relay", {"decay": np.nan}, "decay: nan has an entry that is not finite"),
        ("relay", {"relay_gain": -1}, "relay_gain: -1 must be greater than zero"),
        ("relay", {"relay_on": "tau"}, "relay_on: 'tau' must be one of delay, inverse"),
        ("adaptive", {"filter_time": 0}, "filter_time: 0 must be greater than zero"),
        ("adaptive", {"forgetting": 0}, "forgetting: 0 must be greater than zero"),
        ("adaptive", {"adaptation_gain": -2}, "adaptation_gain: -2 must be greater than zero"),
        ("adaptive", {"filter_time": 1e-3}, "filter_time: makes a rate of 1000 1/s, which with "),
        ("adaptive", {"forgetting": 300}, "forgetting: makes a rate of 300 1/s, which with step"),
        ("least squares", {"initial_covariance": 0}, "initial_covariance: 0 must be greater than"),
        ("least squares", {"forgetting": -1}, "forgetting: -1 must be zero or more"),
        ("least squares", {"forgetting": 300}, "forgetting: makes a rate of 300 1/s, which with"),
        ("least squares", {"decay": 0}, "decay: 0 must be greater than zero"),
        ("least squares", {"decay": 300}, "decay: makes a rate of 300 1/s, which with steps of "),
    ],
)
def test_wrong_parameters_are_refused(kind: str, change: dict[str, object], sentence: str) -> None:
    with pytest.raises(InputError) as caught:
        replace(ALL[kind](0.01), **change)  # type: ignore[arg-type]
    assert str(caught.value).startswith(sentence)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"delay": 1.6}, "delay: 1.6 s must be from 0 to 1.5 s"),
        ({"delay": -0.1}, "delay: -0.1 s must be from 0 to 1.5 s"),
        ({"delay": 0.0}, "delay: 0 s must be greater than zero for a relay on"),
        ({"state": np.inf}, "state: inf has an entry that is not finite"),
        ({"past_u": np.zeros((150, 2))}, "past_u: goes back 1.49 s, must go back the greatest"),
        ({"past_u": np.zeros((151, 3))}, "past_u: has shape (151, 3), must have one row or more"),
        ({"past_u": np.zeros((0, 2))}, "past_u: has shape (0, 2), must have one row or more of 2"),
        ({"past_u": np.full((151, 2), np.nan)}, "past_u: sample 0 is [nan, nan], must"),
        ({"before": np.zeros((153, 2))}, "before: has 153 rows, must have 151 like past_u"),
        ({"middle": np.zeros((151, 4))}, "middle: has shape (151, 4), must have one row or more"),
    ],
)
def test_a_wrong_start_is_refused(arguments: dict[str, object], sentence: str) -> None:
    good = {"state": 0.0, "delay": 0.3, "past_u": np.zeros((151, 2))}
    with pytest.raises(InputError) as caught:
        ALL["inverse"](0.01).init(**{**good, **arguments})  # type: ignore[arg-type]
    assert str(caught.value).startswith(sentence)


def test_wrong_records_are_refused() -> None:
    estimator, other = ALL["relay"](0.01), ALL["adaptive"](0.01)
    output, control = np.zeros((5, 2)), np.zeros((5, 2))
    state = estimator.init(0.0, 0.3, np.zeros((151, 2)))
    another = other.init(0.0, 0.3, np.zeros((151, 2)))
    coarse = ALL["relay"](0.02).init(0.0, 0.3, np.zeros((151, 2)))
    columns = "must have one row or more of 2"
    wrong: list[tuple[tuple[Any, ...], State, str]] = [
        ((np.zeros((5, 3)), control), state, f"y: has shape (5, 3), {columns}"),
        ((output, np.zeros((5, 3))), state, f"u: has shape (5, 3), {columns}"),
        ((output, control), another, "state: is of an estimator of another kind, sampling peri"),
        ((output, control), coarse, "state: is of an estimator of another kind, sampling peri"),
    ]
    for rows, start, sentence in wrong:
        with pytest.raises(InputError) as caught:
            estimator.run(*rows, state=start)
        assert str(caught.value).startswith(sentence)
    with pytest.raises(InputError, match=r"^y: has shape \(5, 2\), must have one row or more of 1"):
        other.run(output, control, state=another)


def test_longer_pasts_do_no_harm_and_shared_docstrings_warn() -> None:
    estimator = ALL["adaptive"](0.05)
    output, control, past = record(estimator, FAST, short_delay, 3.0)
    longer = FAST(0.025 * np.arange(-100, 1))
    one, other = (observed(estimator, (output, control, rows)) for rows in (past, longer))
    assert np.array_equal(one["delay"], other["delay"])
    for make in ALL.values():
        assert "reconstruction" in (type(make(0.05)).__doc__ or "")


# ---- The comparison of Fig. 3


def rms_in_the_windows(estimator: DelayEstimator) -> list[float]:
    """Over the ends of the three constant pieces, and over the varying one."""
    h = estimator.sampling_period
    delay = run(estimator, Input(), paper_delay, 120.0)["delay"]
    time = h * np.arange(len(delay))
    wrong = delay - paper_delay(time)
    return [
        float(np.sqrt(np.mean(wrong[(time >= a) & (time < b)] ** 2)))
        for a, b in ((12, 20), (32, 40), (52, 60), (66, 120))
    ]


@pytest.mark.parametrize(
    ("forgetting", "expected"),
    [(0.0, [0.0061, 0.3635, 0.4130, 0.3396]), (2.0, [0.0005, 0.0003, 0.0007, 0.0318])],
)
def test_least_squares_falls_asleep_unless_it_forgets(
    forgetting: float, expected: list[float]
) -> None:
    estimator = LeastSquaresDelayEstimator(
        1.0, 1.0, BOUNDS, 1000.0, forgetting, sampling_period=0.005
    )
    assert np.allclose(rms_in_the_windows(estimator), expected, rtol=0, atol=1e-4)


@pytest.mark.parametrize(("fade", "gain", "varying"), [(1.0, 100.0, 0.0863), (5.0, 1000.0, 0.0292)])
def test_the_adaptive_law_has_no_bias_and_tracks_as_it_is_tuned(
    fade: float, gain: float, varying: float
) -> None:
    estimator = AdaptiveDelayEstimator(1.0, 1.0, BOUNDS, 0.01, fade, gain, sampling_period=0.005)
    *still, moving = rms_in_the_windows(estimator)
    assert max(still) < 1e-5
    assert moving == pytest.approx(varying, abs=1e-4)
