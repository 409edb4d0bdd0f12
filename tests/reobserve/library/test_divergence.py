"""A diverging run is reported, and whether the observer diverged or only its step was too long."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.signal import place_poles

from reobserve.core.errors import DivergenceError, InputError
from reobserve.observers import step_size_check
from reobserve.observers.adaptive import AdaptiveObserver
from reobserve.observers.extended_high_gain import ExtendedHighGainObserver
from reobserve.observers.extended_state import ExtendedStateObserver
from reobserve.observers.fixed_step import Samples, Steps, run_on_halves
from reobserve.observers.high_gain import HighGainObserver
from reobserve.observers.ilo import ILO
from reobserve.observers.ilo_sampled import SampledILO
from reobserve.observers.imm import IMM
from reobserve.observers.kalman import KalmanFilter
from reobserve.observers.levant import LevantDifferentiator
from reobserve.observers.normal_form import normal_form_observer
from reobserve.observers.record import Rows
from reobserve.observers.unchecked_step import unchecked_step
from reobserve.synthesis.extended_state.system import AugmentedSystem, Gains
from reobserve.systems.linear import LinearModel
from reobserve.systems.rigid_body import RigidBody
from tests.reobserve.observers.small_plants import pendulum

Array = NDArray[np.float64]

TOO_LONG = r"; (from t = \S+ s on )?its step of \S+ s is too long: with 1/(\d+) of it the estimates"
ITSELF = r"; (from t = \S+ s on )?the observer itself diverges: with 1/1024 of its step"
BODY = RigidBody(np.eye(3))
MODEL = pendulum(9.81, 0.1, 1.0)


# --- Van der Pol in reversed time: a stable origin, a gain that passes -3e5 on the way to it ------


def backwards(_: float, x: Array) -> Array:
    return np.array([-x[1], x[0] - (1 - x[0] ** 2) * x[1]])


@cache
def reversed_oscillator(step: float, poles: tuple[float, float] = (-1.7, -2.5)) -> Any:
    return normal_form_observer(
        ["-x1_", "x0 - (1 - x0**2)*x1_"], ["x0"], ["x0", "x1_"],
        poles=poles, order=8, sampling_period=step,
    )  # fmt: skip


def its_output(step: float, steps: int) -> Array:
    times = 0.5 * step * np.arange(2 * steps + 1)
    found = solve_ivp(
        backwards, (0, times[-1]), [1.4, 0.3], method="DOP853", rtol=1e-12, atol=1e-13,
        t_eval=times,
    )  # fmt: skip
    return np.asarray(found.y[:1].T)


@cache
def continuous(tolerance: float) -> Any:
    """Plant, estimate and integral of squared error, by an integrator with error control."""
    form = reversed_oscillator(1e-2).normal_form
    gain, linear = form.gain.upto(8), form.problem.injection.matrix[:, 0]
    powers, rows = gain.basis.exponents, gain.coefficients

    def slope(_: float, v: Array) -> Array:
        x, e = v[:2], v[2:4]
        matrix = (rows @ np.prod(e**powers, axis=1)).reshape(2, 2)
        fed = matrix @ (linear * (e[0] - x[0]))
        return np.concatenate([backwards(0, x), backwards(0, e) + fed, [np.sum((e - x) ** 2)]])

    start = [1.4, 0.3, 0.0, 0.0, 0.0]
    return solve_ivp(
        slope, (0, 20), start, method="DOP853", rtol=tolerance, atol=tolerance, dense_output=True
    )


@pytest.mark.parametrize("step", [1e-2, 2e-3, 1e-4])
def test_too_long_step_for_a_series_gain_is_not_reported_as_divergence(step: float) -> None:
    """The continuous observer converges from there: two tolerances agree, and the error
    vanishes."""
    truth = [continuous(tolerance) for tolerance in (1e-8, 1e-10)]
    assert all(one.success for one in truth)
    squares = [one.y[4, -1] for one in truth]
    assert squares[0] == pytest.approx(squares[1], rel=1e-6)
    assert squares[1] == pytest.approx(1.83682, rel=1e-5)
    assert np.abs(truth[1].y[2:4, -1] - truth[1].y[:2, -1]).max() < 1e-8

    observer = reversed_oscillator(step)
    y = its_output(step, round(0.4 / step))
    with pytest.raises(DivergenceError, match=TOO_LONG) as caught:
        run_on_halves(observer, y, state=observer.init([0.0, 0.0]))
    assert caught.value.time == pytest.approx(0.116, abs=0.005)
    begun = max(round(caught.value.time / step) - 128, 0) * step  # steps before the last finite row
    assert (f"; from t = {begun:g} s on its step" in str(caught.value)) == (step == 1e-4)
    assert ("; its step" in str(caught.value)) == (step > 1e-4)


def test_step_named_in_the_message_reproduces_the_continuous_observer() -> None:
    observer = reversed_oscillator(2e-3)
    with pytest.raises(DivergenceError, match="with 1/256 of it"):
        run_on_halves(observer, its_output(2e-3, 200), state=observer.init([0.0, 0.0]))
    step = 2e-3 / 256
    finer = replace(observer, sampling_period=step)
    run = run_on_halves(finer, its_output(step, 51200), state=finer.init([0.0, 0.0]))
    assert run["state"][-1] == pytest.approx(continuous(1e-10).sol(0.4)[2:4], abs=0.02)


def test_diverging_observer_is_reported_as_such() -> None:
    """Order 2 on the paper's oscillator escapes at 9.736 s, also with error control."""
    observer = normal_form_observer(
        ["b", "-a + (1 - a**2)*b"], ["a"], ["a", "b"],
        injection=[[-2.0], [-4.0]], order=2, sampling_period=2e-3,
    )  # fmt: skip

    def forwards(t: float, x: Array) -> Array:
        return -backwards(t, x)

    times = 1e-3 * np.arange(20_001)
    found = solve_ivp(
        forwards, (0, 20), [2.0, 0.5], method="DOP853", rtol=1e-12, atol=1e-12, t_eval=times
    )
    with pytest.raises(DivergenceError, match=ITSELF) as caught:
        run_on_halves(observer, found.y[:1].T, state=observer.init([0.0, 0.0]))
    form = observer.normal_form
    gain, injection = form.gain.upto(2), form.problem.injection

    def slope(t: float, v: Array) -> Array:
        x, e = v[:2], v[2:]
        fed = gain(e).reshape(2, -1) @ (injection(e[:1]) - injection(x[:1]))
        return np.concatenate([forwards(t, x), forwards(t, e) + fed])

    def far(_: float, v: Array) -> float:
        return 1e4 - float(np.max(np.abs(v[2:])))

    far.terminal = True  # type: ignore[attr-defined]
    escape = solve_ivp(
        slope, (0, 20), [2.0, 0.5, 0, 0], method="DOP853", rtol=1e-10, atol=1e-10,
        events=far, max_step=0.1,
    )  # fmt: skip
    assert caught.value.time == pytest.approx(escape.t_events[0][0], abs=0.02)


# --- The other observers: stiff ones with unstable steps, and growing learning laws --------------


def still(columns: int | None, steps: int) -> Array:
    return np.zeros(2 * steps + 1 if columns is None else (2 * steps + 1, columns))


def high_gain(rho: float, step: float) -> Callable[[], Any]:
    observer = HighGainObserver(MODEL, rho, sampling_period=step)
    record = np.zeros(3001)
    return lambda: observer.run(record, record, state=observer.init([1.0, 0.0]))


def extended(rho: float, step: float) -> Callable[[], Any]:
    observer = ExtendedHighGainObserver(MODEL, rho, 1, (0.0, 1.0), sampling_period=step)
    time = 0.5 * step * np.arange(2 * 3000 + 1)
    u = np.column_stack([np.sin(time), np.cos(time)])
    y, start = still(None, 3000), observer.init([1.0, 0.0], 0.5)
    return lambda: run_on_halves(observer, y, u, state=start)


def rigid(observer: Any, steps: int = 4000) -> Callable[[], Any]:
    start = observer.init([0.1, 0.2, -0.1])
    return lambda: run_on_halves(observer, still(3, steps), still(3, steps), state=start)


STIFF: dict[str, Callable[[], Any]] = {
    "high gain": high_gain(400.0, 0.01),
    "extended high gain": extended(400.0, 0.1),
    "adaptive": rigid(AdaptiveObserver(BODY, 300.0, 1.0, 0.0, sampling_period=0.01)),
    "continuous": rigid(ILO(BODY, 0.5, 10.0, 300.0, 0.1, sampling_period=0.01)),
    "sampled": rigid(SampledILO(BODY, 0.5, 10.0, 300.0, 0.1, sampling_period=0.01)),
}
GROWING: dict[str, Callable[[], Any]] = {
    "continuous": rigid(ILO(BODY, 3.0, 1.0, 10.0, 0.05, allow_unstable=True, sampling_period=0.01)),
    "sampled": rigid(
        SampledILO(BODY, 3.0, 1.0, 10.0, 0.05, allow_unstable=True, sampling_period=0.01)
    ),
}


@pytest.mark.parametrize("name", STIFF)
def test_numerically_unstable_step_is_reported(name: str) -> None:
    """Rates of 300 1/s and more with steps of 0.01 s: beyond 2.78, the stability limit of Runge-
    Kutta.
    """
    with pytest.raises(DivergenceError, match=TOO_LONG) as caught:
        STIFF[name]()
    share = int(str(caught.value).partition("with 1/")[2].split()[0])
    assert share in (2, 4, 8, 16, 32)


@pytest.mark.parametrize("name", GROWING)
def test_unstable_learning_law_is_reported(name: str) -> None:
    """K1 = 3 triples v in each interval, for any step."""
    with pytest.raises(DivergenceError, match=ITSELF):
        GROWING[name]()


def test_learning_observer_with_halved_steps_agrees() -> None:
    """A record that is a parabola in each step: halving then loses nothing, to order 4."""
    step, steps, interval = 0.01, 40, 0.1
    observer = ILO(BODY, 0.9, 5.0, 10.0, interval, sampling_period=step)
    time = 0.5 * step * np.arange(2 * steps + 1)
    rate = np.column_stack([np.sin(2 * time), np.cos(time), 0.1 * time])
    torque = np.zeros_like(rate)
    half = steps  # rows up to the middle of the record
    start = observer.init(rate[0])
    state = run_on_halves(observer, rate[: half + 1], torque[: half + 1], state=start).state
    finer, begun = observer._halved(state)
    rest = Steps(*(Samples(samples[half:], samples[half:]) for samples in (rate, torque)))
    rows, whole = finer._integrate(begun, rest.halved()), observer._integrate(state, rest)
    for name, tolerance in (("rate", 2e-7), ("fault", 2e-5)):
        assert rows.estimates[name][::2] == pytest.approx(whole.estimates[name], abs=tolerance)
    assert rows.state.count == 2 * whole.state.count


def test_intermediate_samples_lie_on_the_parabola() -> None:
    time = np.arange(9) / 4.0
    right = 1 + time - 3 * time**2
    left = right.copy()
    left[2] = right[2] + 1.0  # a jump at the end of the first step
    found = Samples(right, left).halved()
    fine = np.arange(17) / 8.0
    wanted = 1 + fine - 3 * fine**2
    assert found.right[4:] == pytest.approx(wanted[4:], abs=1e-14)
    assert found.left[4] == left[2]
    assert found.right[1] == pytest.approx(wanted[1] - 0.125, abs=1e-14)
    assert found.right[3] == pytest.approx(wanted[3] + 0.375, abs=1e-14)
    assert np.array_equal(np.delete(found.left, 4), np.delete(found.right, 4))


@pytest.mark.parametrize(("short", "reached"), [(0, True), (1, False)])
def test_unwritten_last_row_is_not_taken_as_the_end(short: int, reached: bool) -> None:
    """It may contain any number, as the loop did not write it."""

    class Loop:
        def _integrate(self, state: Any, part: Steps) -> Rows:
            rows = np.full((part.y.steps + 1, 1), 3.0)
            return Rows({"state": rows}, len(rows) - short, state)

    record = Samples(still(1, 4), still(1, 4))
    loop: Any = Loop()
    found = step_size_check._end(loop, None, Steps(record, record), 2)
    assert (found is not None) == reached


# --- Every observer and filter: raises by default, and returns partial results on request ---------

UNSEEN = LinearModel(
    [[10.0, 0.0], [0.0, 0.5]], np.empty((2, 0)), [[0.0, 1.0]], Q=0.0, R=1.0, sampling_period=0.5
)
NONE = np.zeros((1, 0))
SYSTEM = AugmentedSystem([[-1.0]], [[1.0]], [[1.0]], NONE, NONE, [[1.0]], NONE)


def of_filter(missing: bool) -> Callable[..., Any]:
    kalman = KalmanFilter(UNSEEN)
    taken = np.full((400, 1), np.nan if missing else 0.3)
    return lambda **how: kalman.run(taken, state=kalman.init([1.0, 1.0], 1.0), **how)


def of_bank(**how: Any) -> Any:
    bank = IMM([KalmanFilter(UNSEEN)] * 2, [[0.9, 0.1], [0.1, 0.9]])
    return bank.run(np.full((400, 1), np.nan), state=bank.init([1.0, 1.0], 1.0), **how)


def of_levant(**how: Any) -> Any:
    differentiator = LevantDifferentiator(1e200, 1, (1.0, 1.0), sampling_period=1e60)
    return differentiator.run(np.zeros(9), state=differentiator.init([1e300, 0.0]), **how)


def of_extended_state(**how: Any) -> Any:
    placed = place_poles(SYSTEM.A_tilde.T, SYSTEM.C_tilde.T, [-30.0, -40.0, -50.0]).gain_matrix.T
    observer = ExtendedStateObserver(SYSTEM, Gains(placed, np.zeros((3, 1))), sampling_period=0.1)
    y = np.zeros((9, 1))
    y[4:6, 0] = 1.7e308, -1.7e308
    return observer.run(y, y, **how)


def of_adaptive(**how: Any) -> Any:
    observer = AdaptiveObserver(BODY, 300.0, 1.0, 0.0, sampling_period=0.01)
    start = observer.init([0.1, 0.2, -0.1])
    return run_on_halves(observer, still(3, 4000), still(3, 4000), state=start, **how)


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
    observer = SampledILO(BODY, 0.9, 10.0, 10.0, 0.1, sampling_period=0.01)
    rate = np.full((5, 3), 1e308)
    with pytest.raises(DivergenceError, match=r"^SampledILO diverged"):
        observer.run(rate, np.zeros((5, 3)), state=observer.init(np.zeros(3)))
    run = observer.run(
        rate, np.zeros((5, 3)), state=observer.init(np.zeros(3)), on_divergence="return"
    )
    assert np.isfinite(run["fault"]).all()
    assert run.diverged_at == 0.0


def test_step_and_run_report_the_same_divergence() -> None:
    observer = AdaptiveObserver(BODY, 300.0, 1.0, 0.0, sampling_period=0.01)
    start, rest = observer.init([0.1, 0.2, -0.1]), np.zeros((4001, 3))
    quiet = observer.run(rest, rest, state=start, on_divergence="return")
    rows = len(quiet)
    state = observer.run(rest[:rows], rest[:rows], state=start).state
    said = rf"^AdaptiveObserver diverged: its state is finite up to t = {quiet.diverged_at:g} s"
    for call in (
        lambda: observer.run(rest, rest, state=start),
        lambda: observer.step(state, rest[0], rest[0]),
        lambda: observer.run(rest[:9], rest[:9], state=state),
    ):
        with pytest.raises(DivergenceError, match=said):
            call()
    bad = replace(state, rate=np.array([np.nan, 0, 0]))
    for call in (
        lambda: observer.run(rest[:1], rest[:1], state=bad),
        lambda: observer.step(bad, rest[0], rest[0]),
    ):
        with pytest.raises(InputError, match=r"^state.rate: .* has an entry that is not finite$"):
            call()


def test_divergence_is_reported_in_record_time() -> None:
    observer = AdaptiveObserver(BODY, 300.0, 1.0, 0.0, sampling_period=0.01)
    start, rest = observer.init([0.1, 0.2, -0.1]), np.zeros((4001, 3))
    time = 20.0 + 0.01 * np.arange(4001)
    quiet = observer.run(rest, rest, state=start, time=time, on_divergence="return")
    assert quiet.diverged_at == time[len(quiet) - 1] == quiet.time[-1]
    begun = time[max(len(quiet) - 1 - 128, 0)]
    said = rf"up to t = {quiet.diverged_at:g} s and not after; from t = {begun:g} s on its step"
    with pytest.raises(DivergenceError, match=said):
        observer.run(rest, rest, state=start, time=time)
