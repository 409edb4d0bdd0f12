"""A diverging run is reported, with the step if a shorter one might not diverge."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import place_poles

from reobserve.core.errors import DivergenceError, InputError
from reobserve.estimation.row_by_row import unchecked_step
from reobserve.observers.adaptive import AdaptiveObserver
from reobserve.observers.extended_high_gain import ExtendedHighGainObserver
from reobserve.observers.extended_state import ExtendedStateObserver
from reobserve.observers.fixed_step import run_on_halves
from reobserve.observers.high_gain import HighGainObserver
from reobserve.observers.ilo import ILO, SampledILO
from reobserve.observers.imm import IMM
from reobserve.observers.kalman import KalmanFilter
from reobserve.observers.levant import LevantDifferentiator
from reobserve.observers.normal_form import normal_form_observer
from reobserve.synthesis.extended_state.system import AugmentedSystem, Gains
from reobserve.systems.linear import LinearModel
from reobserve.systems.rigid_body import RigidBody
from tests.reobserve.observers.small_plants import pendulum

Array = NDArray[np.float64]

BODY = RigidBody(np.eye(3))
MODEL = pendulum(9.81, 0.1, 1.0)


# --- Stiff observers with unstable steps, and growing learning laws -----------------------------


def still(columns: int | None, steps: int) -> Array:
    return np.zeros(2 * steps + 1 if columns is None else (2 * steps + 1, columns))


def high_gain(rho: float, step: float) -> Callable[[], Any]:
    observer = HighGainObserver(MODEL, rho=rho, sampling_period=step)
    record = np.zeros(3001)
    return lambda: observer.run(record, record, start=observer.init([1.0, 0.0]))


def extended(rho: float, step: float) -> Callable[[], Any]:
    observer = ExtendedHighGainObserver(
        MODEL, rho=rho, order=1, delay_bounds=(0.0, 1.0), sampling_period=step
    )
    time = 0.5 * step * np.arange(2 * 3000 + 1)
    u = np.column_stack([np.sin(time), np.cos(time)])
    y, start = still(None, 3000), observer.init([1.0, 0.0], delay=0.5)
    return lambda: run_on_halves(observer, y, u, start=start)


def rigid(observer: Any, steps: int = 4000) -> Callable[[], Any]:
    start = observer.init([0.1, 0.2, -0.1])
    return lambda: run_on_halves(observer, still(3, steps), still(3, steps), start=start)


def series_gain(step: float) -> Callable[[], Any]:
    observer = normal_form_observer(
        ["-x1_", "x0 - (1 - x0**2)*x1_"], ["x0"], ["x0", "x1_"],
        poles=(-1.7, -2.5), order=8, sampling_period=step,
    )  # fmt: skip
    return lambda: observer.run(np.full(400, 1.4), start=observer.init([0.0, 0.0]))


STIFF: dict[str, Callable[[], Any]] = {
    "normal form": series_gain(0.01),
    "high gain": high_gain(400.0, 0.01),
    "extended high gain": extended(400.0, 0.1),
    "adaptive": rigid(
        AdaptiveObserver(
            BODY,
            observer_gain=300.0,
            integral_gain=1.0,
            proportional_gain=0.0,
            sampling_period=0.01,
        )
    ),
    "continuous": rigid(
        ILO(BODY, K1=0.5, K2=10.0, observer_gain=300.0, update_interval=0.1, sampling_period=0.01)
    ),
    "sampled": rigid(
        SampledILO(
            BODY, K1=0.5, K2=10.0, observer_gain=300.0, update_interval=0.1, sampling_period=0.01
        )
    ),
}
GROWING: dict[str, Callable[[], Any]] = {
    "continuous": rigid(
        ILO(
            BODY,
            K1=3.0,
            K2=1.0,
            observer_gain=10.0,
            update_interval=0.05,
            allow_unstable=True,
            sampling_period=0.01,
        )
    ),
    "sampled": rigid(
        SampledILO(
            BODY,
            K1=3.0,
            K2=1.0,
            observer_gain=10.0,
            update_interval=0.05,
            allow_unstable=True,
            sampling_period=0.01,
        )
    ),
}


@pytest.mark.parametrize("name", [*STIFF, *(f"growing {name}" for name in GROWING)])
def test_step_that_may_be_too_long_is_reported(name: str) -> None:
    """Rates of 300 1/s and more with steps of 0.01 s: beyond 2.78, the limit of Runge-Kutta."""
    call = STIFF.get(name) or GROWING[name.removeprefix("growing ")]
    step = 0.1 if name == "extended high gain" else 0.01
    said = rf" and not after; a step of {step:g} s may be too long for it$"
    with pytest.raises(DivergenceError, match=said):
        call()


# --- Every observer and filter: raises by default, and returns partial results on request ---------

UNSEEN = LinearModel(
    [[10.0, 0.0], [0.0, 0.5]], np.empty((2, 0)), [[0.0, 1.0]], Q=0.0, R=1.0, sampling_period=0.5
)
NONE = np.zeros((1, 0))
SYSTEM = AugmentedSystem([[-1.0]], [[1.0]], [[1.0]], NONE, NONE, [[1.0]], NONE)


def of_filter(missing: bool) -> Callable[..., Any]:
    kalman = KalmanFilter(UNSEEN)
    taken = np.full((400, 1), np.nan if missing else 0.3)
    return lambda **how: kalman.run(taken, start=kalman.init([1.0, 1.0], 1.0), **how)


def of_bank(**how: Any) -> Any:
    bank = IMM([KalmanFilter(UNSEEN)] * 2, [[0.9, 0.1], [0.1, 0.9]])
    return bank.run(np.full((400, 1), np.nan), start=bank.init([1.0, 1.0], 1.0), **how)


def of_levant(**how: Any) -> Any:
    differentiator = LevantDifferentiator(
        L=1e200, order=1, lambdas=(1.0, 1.0), sampling_period=1e60
    )
    return differentiator.run(np.zeros(9), start=differentiator.init([1e300, 0.0]), **how)


def of_extended_state(**how: Any) -> Any:
    placed = place_poles(SYSTEM.A_tilde.T, SYSTEM.C_tilde.T, [-30.0, -40.0, -50.0]).gain_matrix.T
    observer = ExtendedStateObserver(
        SYSTEM, gains=Gains(placed, np.zeros((3, 1))), sampling_period=0.1
    )
    y = np.zeros((9, 1))
    y[4:6, 0] = 1.7e308, -1.7e308
    return observer.run(y, y, **how)


def of_adaptive(**how: Any) -> Any:
    observer = AdaptiveObserver(
        BODY, observer_gain=300.0, integral_gain=1.0, proportional_gain=0.0, sampling_period=0.01
    )
    start = observer.init([0.1, 0.2, -0.1])
    return run_on_halves(observer, still(3, 4000), still(3, 4000), start=start, **how)


RUNS: dict[str, Callable[..., Any]] = {
    "filter": of_filter(False),
    "filter without measurements": of_filter(True),
    "bank": of_bank,
    "differentiator": of_levant,
    "extended state": of_extended_state,
    "rigid body": of_adaptive,
}


@pytest.mark.parametrize("name", RUNS)
def test_diverging_run_raises_unless_partial_results_are_requested(name: str) -> None:
    run = RUNS[name](on_divergence="return")
    assert run.diverged_at is not None
    with pytest.raises(DivergenceError, match="diverged") as caught:
        RUNS[name]()
    assert caught.value.time == pytest.approx(run.diverged_at)
    with pytest.raises(InputError, match=r"^on_divergence: 'ignore' must be one of raise, return$"):
        RUNS[name](on_divergence="ignore")


@pytest.mark.parametrize("taken", [0.3, np.nan])
def test_stepped_filter_stops_at_the_same_sample_as_its_run(taken: float) -> None:
    kalman = KalmanFilter(UNSEEN)
    state = kalman.init([1.0, 1.0], 1.0)
    run = of_filter(bool(np.isnan(taken)))(on_divergence="return")
    for _ in range(len(run)):
        state, estimate = kalman.step(state, [taken])
    assert np.isfinite(state.posterior.mean).all()
    assert estimate.time == run.diverged_at
    said = rf"^KalmanFilter diverged: its state is finite up to t = {run.diverged_at:g} s and not"
    with pytest.raises(DivergenceError, match=said):
        kalman.step(state, [taken])
    with pytest.raises(DivergenceError, match=said):
        unchecked_step(kalman, state, np.array([[taken]]), np.empty((1, 0)))


def test_rate_near_overflow_gives_finite_fault() -> None:
    observer = SampledILO(
        BODY, K1=0.9, K2=10.0, observer_gain=10.0, update_interval=0.1, sampling_period=0.01
    )
    rate = np.full((5, 3), 1e308)
    with pytest.raises(DivergenceError, match=r"^SampledILO diverged"):
        observer.run(rate, np.zeros((5, 3)), start=observer.init(np.zeros(3)))
    run = observer.run(
        rate, np.zeros((5, 3)), start=observer.init(np.zeros(3)), on_divergence="return"
    )
    assert np.isfinite(run["fault"]).all()
    assert run.diverged_at == 0.0


def test_step_and_run_report_the_same_divergence() -> None:
    observer = AdaptiveObserver(
        BODY, observer_gain=300.0, integral_gain=1.0, proportional_gain=0.0, sampling_period=0.01
    )
    start, rest = observer.init([0.1, 0.2, -0.1]), np.zeros((4001, 3))
    quiet = observer.run(rest, rest, start=start, on_divergence="return")
    rows = len(quiet)
    state = observer.run(rest[:rows], rest[:rows], start=start).end
    said = (
        rf"^AdaptiveObserver diverged: its state is finite up to t = {quiet.diverged_at:g} s "
        r"and not after; a step of 0\.01 s may be too long for it$"
    )
    for call in (
        lambda: observer.run(rest, rest, start=start),
        lambda: observer.step(state, rest[0], rest[0]),
        lambda: observer.run(rest[:9], rest[:9], start=state),
    ):
        with pytest.raises(DivergenceError, match=said):
            call()
    bad = replace(state, rate=np.array([np.nan, 0, 0]))
    for call in (
        lambda: observer.run(rest[:1], rest[:1], start=bad),
        lambda: observer.step(bad, rest[0], rest[0]),
    ):
        with pytest.raises(InputError, match=r"^start.rate: .* has an entry that is not finite$"):
            call()


@pytest.mark.parametrize("name", sorted(set(RUNS) - {"rigid body"}))
def test_step_is_not_blamed_where_no_step_is_integrated(name: str) -> None:
    with pytest.raises(DivergenceError, match="diverged") as caught:
        RUNS[name]()
    assert "a step of" not in str(caught.value)


def test_step_is_not_blamed_for_the_first_row() -> None:
    observer = SampledILO(
        BODY,
        K1=0.9,
        K2=1e10,
        observer_gain=10.0,
        update_interval=0.1,
        allow_unstable=True,
        sampling_period=0.01,
    )
    start, rate = observer.init(np.zeros(3)), np.full((1, 3), 1e308)
    for rows in (1, 2):
        y = np.repeat(rate, rows, axis=0)
        with pytest.raises(DivergenceError, match=r"not after$"):
            observer.run(y, np.zeros((rows, 3)), start=start)


def test_divergence_is_reported_in_record_time() -> None:
    observer = AdaptiveObserver(
        BODY, observer_gain=300.0, integral_gain=1.0, proportional_gain=0.0, sampling_period=0.01
    )
    start, rest = observer.init([0.1, 0.2, -0.1]), np.zeros((4001, 3))
    time = 20.0 + 0.01 * np.arange(4001)
    quiet = observer.run(rest, rest, start=start, time=time, on_divergence="return")
    assert quiet.diverged_at == time[len(quiet) - 1] == quiet.time[-1]
    said = rf"up to t = {quiet.diverged_at:g} s and not after; a step of 0.01 s may be too long"
    with pytest.raises(DivergenceError, match=said):
        observer.run(rest, rest, start=start, time=time)
