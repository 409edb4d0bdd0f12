"""Delay estimators in use, and the numbers of the comparison."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from reobserve.core.errors import DivergenceError, InputError
from reobserve_papers.papers.delay.estimator import DelayEstimator
from reobserve_papers.papers.delay.estimator_adaptive import AdaptiveDelayEstimator
from reobserve_papers.papers.delay.estimator_least_squares import LeastSquaresDelayEstimator
from tests.reobserve_papers.papers.delay.scalar_plant import (
    ALL,
    BOUNDS,
    Input,
    half_steps,
    paper_delay,
    run,
)


def test_least_squares_wind_up_at_rest_is_reported_with_the_time() -> None:
    estimator = LeastSquaresDelayEstimator(1.0, 1.0, BOUNDS, 0.01, 1.0, 100.0)
    still, past = np.tile([1.0, 0.0], (2001, 1)), np.tile([1.0, 0.0], (301, 1))
    output = 1 - np.exp(-half_steps(0.01, 10.0)[:, None]) * 0.5
    with pytest.raises(DivergenceError) as caught:
        estimator.run(output, past, still, estimator.start(0.4, 0.3))
    assert 0 < caught.value.time < 10
    last = 2 * round(caught.value.time / 0.01) + 1
    before = estimator.run(output[:last], past, still[:last], estimator.start(0.4, 0.3))
    assert np.isfinite(before).all()


@pytest.mark.parametrize(
    ("kind", "change", "sentence"),
    [
        ("adaptive", {"filter_time": 1e-3}, "filter_time: makes a rate of 1000 1/s, which with "),
        ("adaptive", {"forgetting": 300}, "forgetting: makes a rate of 300 1/s, which with step"),
        ("least squares", {"forgetting": 300}, "forgetting: makes a rate of 300 1/s, which with"),
        ("least squares", {"decay": 300}, "decay: makes a rate of 300 1/s, which with steps of "),
    ],
)
def test_rates_too_fast_for_the_step_are_refused(
    kind: str, change: dict[str, float], sentence: str
) -> None:
    with pytest.raises(InputError) as caught:
        replace(ALL[kind](0.01), **change)
    assert str(caught.value).startswith(sentence)


def test_inverse_delay_relay_cannot_start_at_zero() -> None:
    with pytest.raises(InputError, match=r"^initial_delay: 0 s must be greater than zero for a"):
        ALL["inverse"](0.01).start(0.0, 0.0)


# ---- The comparison of Fig. 3


def rms_in_the_windows(estimator: DelayEstimator) -> list[float]:
    """At the ends of the three constant pieces, and over the varying one."""
    h = estimator.sampling_period
    delay = run(estimator, Input(), paper_delay, 120.0)[:, 0]
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
def test_least_squares_stops_adapting_without_forgetting(
    forgetting: float, expected: list[float]
) -> None:
    estimator = LeastSquaresDelayEstimator(1.0, 1.0, BOUNDS, 0.005, 1000.0, forgetting)
    assert np.allclose(rms_in_the_windows(estimator), expected, rtol=0, atol=1e-4)


@pytest.mark.parametrize(("fade", "gain", "varying"), [(1.0, 100.0, 0.0863), (5.0, 1000.0, 0.0292)])
def test_adaptive_law_is_unbiased_and_tracks_as_tuned(
    fade: float, gain: float, varying: float
) -> None:
    estimator = AdaptiveDelayEstimator(1.0, 1.0, BOUNDS, 0.005, 0.01, fade, gain)
    *still, moving = rms_in_the_windows(estimator)
    assert max(still) < 1e-5
    assert moving == pytest.approx(varying, abs=1e-4)
