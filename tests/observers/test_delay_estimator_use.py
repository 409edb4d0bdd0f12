"""What a user of the estimators of a delay relies on, and the numbers of the comparison."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from reobserve.errors import DivergenceError, InputError
from reobserve.observers.delay_adaptive import AdaptiveDelayEstimator
from reobserve.observers.delay_estimator import DelayEstimator
from reobserve.observers.delay_least_squares import LeastSquaresDelayEstimator
from tests.observers.scalar_plant import (
    ALL,
    BOUNDS,
    FAST,
    SMOOTH,
    Input,
    half_steps,
    paper_delay,
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
    whole = estimator.run(
        output, control, estimator.init(0.3, 0.0, past, past_before), control_before
    )
    state, delays = estimator.init(0.3, 0.0, past, past_before), [0.3]
    for k in range(0, len(output) - 1, 2):
        three = slice(k, k + 3)
        state, delay = estimator.step(state, output[three], control[three], control_before[three])
        delays.append(delay)
    assert np.array_equal(whole.delay, delays)
    assert np.array_equal(whole.state.values, state.values)
    assert state.count == whole.state.count == 180
    assert np.array_equal(whole.state.history.right, state.history.right)
    assert np.array_equal(whole.state.history.left, state.history.left)
    assert np.ptp(whole.delay) > 0.05


def test_least_squares_winds_up_at_rest_and_says_when() -> None:
    estimator = LeastSquaresDelayEstimator(1.0, 1.0, BOUNDS, 0.01, 1.0, 100.0)
    still = np.tile([1.0, 0.0], (2001, 1))
    output = 1 - np.exp(-half_steps(0.01, 10.0)[:, None]) * 0.5
    state = estimator.init(0.3, 0.4, np.tile([1.0, 0.0], (301, 1)))
    done = estimator.run(output, still, state, on_divergence="return")
    assert done.diverged_at is not None
    assert 0 < done.diverged_at < 10
    assert done.state is state
    assert len(done.delay) == round(done.diverged_at / 0.01) + 1
    assert np.isfinite(done.values).all()
    last = 2 * (len(done.delay) - 1)
    before = estimator.run(output[: last + 1], still[: last + 1], state)
    assert before.diverged_at is None
    with pytest.raises(DivergenceError, match=f"finite up to t = {done.diverged_at:g} s"):
        estimator.step(before.state, output[last : last + 3], still[last : last + 3])


def test_a_run_leaves_its_inputs_as_they_were() -> None:
    estimator = SMOOTH["adaptive"](0.05)
    output, control, past = record(estimator, FAST, short_delay, 1.0)
    state = estimator.init(0.3, 0.0, past)
    copies = [a.copy() for a in (output, control, state.values, state.history.right)]
    estimator.run(output, control, state)
    for kept, now in zip(copies, (output, control, state.values, state.history.right), strict=True):
        assert np.array_equal(kept, now)


@pytest.mark.parametrize(
    ("kind", "change", "sentence"),
    [
        ("adaptive", {"delay_bounds": (-0.1, 1)}, "delay_bounds: -0.1 and 1 s must be 0 <= tau_"),
        ("adaptive", {"delay_bounds": (1, 1)}, "delay_bounds: 1 and 1 s must be 0 <= tau_min <"),
        ("adaptive", {"delay_bounds": (1,)}, "delay_bounds: has shape (1,), must be a list of 2"),
        ("relay", {"input_gain": 0}, "input_gain: 0 must not be zero"),
        ("relay", {"step_size": 0}, "step_size: 0 must be greater than zero"),
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
        ({"initial_delay": 1.6}, "initial_delay: 1.6 s must be from 0 to 1.5 s"),
        ({"initial_delay": -0.1}, "initial_delay: -0.1 s must be from 0 to 1.5 s"),
        ({"initial_delay": 0.0}, "initial_delay: 0 s must be greater than zero for a relay on"),
        ({"initial_output": np.inf}, "initial_output: inf has an entry that is not finite"),
        ({"past_input": np.zeros((299, 2))}, "past_input: goes back 1.49 s, must go back the "),
        ({"past_input": np.zeros((301, 1))}, "past_input: has shape (301, 1), must have an odd"),
        ({"past_input": np.full((301, 2), np.nan)}, "past_input: sample 0 is [nan, nan], must"),
        ({"past_input_before": np.zeros((303, 2))}, "past_input_before: has 303 rows, must have"),
    ],
)
def test_a_wrong_start_is_refused(arguments: dict[str, object], sentence: str) -> None:
    good = {"initial_delay": 0.3, "initial_output": 0.0, "past_input": np.zeros((301, 2))}
    with pytest.raises(InputError) as caught:
        ALL["inverse"](0.01).init(**{**good, **arguments})  # type: ignore[arg-type]
    assert str(caught.value).startswith(sentence)


def test_wrong_records_are_refused() -> None:
    estimator, other = ALL["relay"](0.01), ALL["adaptive"](0.01)
    output, control = np.zeros((5, 2)), np.zeros((5, 2))
    state = estimator.init(0.3, 0.0, np.zeros((301, 2)))
    holed = control.copy()
    holed[2, 0] = np.nan
    for wrong, sentence in (
        ((output[:, :1], control, state), "output: has shape (5, 1), must have an odd number of"),
        ((output[:4], control, state), "output: has shape (4, 2), must have an odd number of ro"),
        ((output, control[:3], state), "control: has 3 rows, must have 5 like output"),
        ((holed, control, state), "output: sample 2 is [nan, 0.0], must be finite"),
        ((output, holed, state), "control: sample 2 is [nan, 0.0], must be finite"),
        ((output, control, state, control[:3]), "control_before: has 3 rows, must have 5 like c"),
        ((output, control, other.init(0.3, 0.0, np.zeros((301, 2)))), "state: is of an estimato"),
    ):
        with pytest.raises(InputError) as caught:
            estimator.run(*wrong)  # type: ignore[arg-type]
        assert str(caught.value).startswith(sentence)


def test_longer_pasts_do_no_harm_and_shared_docstrings_warn() -> None:
    estimator = ALL["adaptive"](0.05)
    output, control, past = record(estimator, FAST, short_delay, 3.0)
    longer = FAST(0.025 * np.arange(-100, 1))
    assert np.array_equal(
        estimator.run(output, control, estimator.init(0.3, 0.0, past)).delay,
        estimator.run(output, control, estimator.init(0.3, 0.0, longer)).delay,
    )
    for make in ALL.values():
        assert "reconstruction" in (type(make(0.05)).__doc__ or "")


# ---- The comparison of Fig. 3


def rms_in_the_windows(estimator: DelayEstimator) -> list[float]:
    """Over the ends of the three constant pieces, and over the varying one."""
    h = estimator.step_size
    delay = run(estimator, Input(), paper_delay, 120.0).delay
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
    estimator = LeastSquaresDelayEstimator(1.0, 1.0, BOUNDS, 0.005, 1000.0, forgetting)
    assert np.allclose(rms_in_the_windows(estimator), expected, rtol=0, atol=1e-4)


@pytest.mark.parametrize(("fade", "gain", "varying"), [(1.0, 100.0, 0.0863), (5.0, 1000.0, 0.0292)])
def test_the_adaptive_law_has_no_bias_and_tracks_as_it_is_tuned(
    fade: float, gain: float, varying: float
) -> None:
    estimator = AdaptiveDelayEstimator(1.0, 1.0, BOUNDS, 0.005, 0.01, fade, gain)
    *still, moving = rms_in_the_windows(estimator)
    assert max(still) < 1e-5
    assert moving == pytest.approx(varying, abs=1e-4)
