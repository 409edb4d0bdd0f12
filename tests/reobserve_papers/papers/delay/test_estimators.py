"""Delay estimators against an independent integration and closed forms."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.linalg import expm

from reobserve_papers.papers.delay.estimator import DelayEstimator
from reobserve_papers.papers.delay.estimator_adaptive import AdaptiveDelayEstimator
from reobserve_papers.papers.delay.estimator_least_squares import LeastSquaresDelayEstimator
from reobserve_papers.papers.delay.estimator_variable_structure import (
    VariableStructureDelayEstimator,
)
from tests.reobserve_papers.papers.delay.scalar_plant import (
    ALL,
    BOUNDS,
    FAST,
    SMOOTH,
    A,
    Array,
    B,
    Delay,
    Input,
    adaptive,
    constant,
    half_steps,
    least_squares,
    observed,
    paper_delay,
    plant,
    record,
    relay,
    run,
    short_delay,
)

# ---- The same equations, independently, integrated by DOP853


def slope(estimator: DelayEstimator, u: Input, delay: Delay) -> Callable[[float, Array], Array]:
    """The derivative of the values and x, before projection."""
    a, b = estimator.decay, estimator.input_gain

    def of(t: float, values: Array) -> Array:
        x, theta = values[-1], values[0]
        value, rate = u(t - theta)
        moved = -a * x + b * u(t - delay(np.array(t)))[0]
        if isinstance(estimator, LeastSquaresDelayEstimator):
            _, model, phi, R, _ = values
            return np.array([
                phi / R * (x - model), b * value - a * model, -a * phi - b * rate,
                phi**2 - estimator.forgetting * R, moved,
            ])  # fmt: skip
        assert isinstance(estimator, AdaptiveDelayEstimator)
        k, fade = estimator.filter_time, estimator.forgetting
        _, x_f, g_f, phi_f, P, Q, _ = values
        y_f = (x - x_f) / k + a * x_f - g_f
        return np.array([
            estimator.adaptation_gain * (Q - P * theta), (x - x_f) / k,
            (b * value + b * theta * rate - g_f) / k, (-b * rate - phi_f) / k,
            phi_f**2 - fade * P, phi_f * y_f - fade * Q, moved,
        ])  # fmt: skip

    return of


def reference(
    estimator: DelayEstimator, u: Input, pieces: list[tuple[float, Delay]], first: float, h: float
) -> tuple[Array, int]:
    """Values at the multiples of ``h``, and how often the projection changed its mode.

    ``pieces`` are the ends of the pieces of the delay and the delay in them.
    """
    size, bounds = len(estimator.start(0.0, first)), estimator.delay_bounds
    values = np.append(estimator.start(0.0, first), 0.0)
    rows, t, changes, held = [values[:size]], 0.0, 0, 0
    for end, delay in pieces:
        raw = slope(estimator, u, delay)
        while end - t > 1e-12:
            events = []
            for side, bound in ((-1, bounds[0]), (1, bounds[1])):
                if held == 0:
                    event = lambda t, v, bound=bound: v[0] - bound  # noqa: E731
                    event.direction = side  # type: ignore[attr-defined]
                elif held == side:
                    event = lambda t, v, raw=raw: raw(t, v)[0]  # noqa: E731
                    event.direction = -side  # type: ignore[attr-defined]
                else:
                    continue
                event.terminal = True  # type: ignore[attr-defined]
                events.append((event, side))

            def projected(t: float, v: Array, raw=raw, held=held) -> Array:  # type: ignore[no-untyped-def]
                rate = raw(t, v)
                rate[0] = 0.0 if held else rate[0]
                return rate

            times = h * np.arange(len(rows), round(end / h) + 1)
            done = solve_ivp(
                projected, (t, end), values, method="DOP853", rtol=1e-12, atol=1e-14,
                max_step=0.02, events=[e for e, _ in events], dense_output=True,
            )  # fmt: skip
            rows += [done.sol(s)[:size] for s in times if s <= done.t[-1] + 1e-12]
            t, values = done.t[-1], done.y[:, -1].copy()
            if done.status == 1:
                side = next(
                    s for (_, s), found in zip(events, done.t_events, strict=True) if len(found)
                )
                held, changes = (side if held == 0 else 0), changes + 1
                if held:
                    values[0] = bounds[0] if side < 0 else bounds[1]
    return np.array(rows), changes


PIECES = [
    (3.0, constant(0.6)),
    (6.0, constant(1.2)),
    (10.0, lambda t: 0.8 + 0.4 * np.sin(0.9 * t)),
]
# Bounds that the delay leaves on both sides, so that its estimate reaches them.
NARROW: dict[str, Callable[[float], DelayEstimator]] = {
    kind: lambda h, make=make: replace(make(h), delay_bounds=(0.7, 1.0))  # type: ignore[misc]
    for kind, make in SMOOTH.items()
}


@cache
def known(kind: str, narrow: bool) -> tuple[Array, int]:
    estimator = (NARROW if narrow else SMOOTH)[kind](0.01)
    return reference(estimator, FAST, PIECES, 0.8, 0.1)


def error(kind: str, narrow: bool, h: float) -> float:
    """The largest error of a value after the first jump of the delay."""
    ours = run((NARROW if narrow else SMOOTH)[kind](h), FAST, short_delay, 10.0, 0.8)
    return float(np.max(np.abs(ours[:: round(0.1 / h)] - known(kind, narrow)[0])[31:]))


@pytest.mark.parametrize("kind", SMOOTH)
@pytest.mark.parametrize("narrow", [False, True])
def test_agrees_with_an_independent_integration(kind: str, narrow: bool) -> None:
    delays, changes = known(kind, narrow)[0][:, 0], known(kind, narrow)[1]
    assert changes == (5 if narrow else 0)
    assert (np.ptp(delays) < 0.3 + 1e-9) == narrow
    assert error(kind, narrow, 0.002) < 1e-10


@pytest.mark.parametrize("kind", SMOOTH)
@pytest.mark.parametrize("narrow", [False, True])
def test_order_is_four_with_delay_jumps_and_at_bounds(kind: str, narrow: bool) -> None:
    coarse, fine = error(kind, narrow, 0.02), error(kind, narrow, 0.005)
    assert 3.8 < np.log2(coarse / fine) / 2 < 4.3


@pytest.mark.parametrize("kind", SMOOTH)
def test_estimate_stays_within_its_bounds(kind: str) -> None:
    delay = run(NARROW[kind](0.05), FAST, short_delay, 10.0, 0.8)[:, 0]
    assert np.min(delay) == 0.7
    assert np.max(delay) == 1.0


# ---- Statements of the docstrings, in closed form: on a ramp the linearisation is exact

RAMP = Input(0.4, ramp=True)
STEADY = B * RAMP.frequency / A  # -phi, and the slope of x


def on_a_ramp(estimator: DelayEstimator, first: float, delay: Delay, values: Array) -> Array:
    """The estimates over 20 s from given initial values, with x at its particular solution."""
    t = half_steps(estimator.sampling_period, 20.0)
    rate = float(delay(np.array([1.0]))[0] - delay(np.array([0.0]))[0])
    slope = STEADY * (1 - rate)
    x0 = float((-B * RAMP.frequency * delay(np.array([0.0]))[0] - slope) / A)
    _, control, past = record(estimator, RAMP, delay, 20.0)
    start = estimator.start(x0, first)
    start = np.where(np.isnan(values), start, values)
    return estimator.run((x0 + slope * t)[:, None], past, control, start)[:, 0]


@pytest.mark.parametrize("forgetting", [0.1, A / 4, 2.0])
def test_least_squares_converges_with_the_stated_roots(forgetting: float) -> None:
    """Also for complex roots, so that the error oscillates."""
    values = np.array([np.nan, np.nan, -STEADY, STEADY**2 / forgetting])
    delay = on_a_ramp(least_squares(0.01, 1.0, forgetting), 0.3, constant(0.8), values)
    law = np.array([[-A, A], [-forgetting, 0.0]])
    expected = [0.8 - (expm(law * t) @ [0.0, 0.5])[1] for t in 0.01 * np.arange(2001)]
    assert np.max(np.abs(delay - expected)) < 1e-9
    s = np.linalg.eigvals(law)
    assert np.allclose(s**2 + A * s + A * forgetting, 0)
    assert max(s.real) >= -A / 2 - 1e-7


@pytest.mark.parametrize("x0", [0.0, 0.7])
def test_adaptive_law_converges_with_gamma_p_from_a_cold_start(x0: float) -> None:
    k, fade, gain = 0.2, 0.5, 10.0
    estimator = adaptive(0.005, k, fade, gain)
    time = half_steps(0.005, 10.0)
    x = plant(RAMP, constant(0.8), time, A, B, x0)
    _, control, past = record(estimator, RAMP, constant(0.8), 10.0)
    ours = observed(estimator, (x[:, None], control, past), x0=x0)
    pushed = (B * RAMP.frequency) ** 2

    def information(t: float) -> float:
        return quad(
            lambda s: pushed * np.exp(-fade * (t - s)) * (1 - np.exp(-s / k)) ** 2, 0, t,
            epsabs=1e-13,
        )[0]  # fmt: skip

    for t in (1.0, 4.0, 10.0):
        total = quad(information, 0, t, epsabs=1e-12)[0]
        assert ours[round(t / 0.005), 4] == pytest.approx(information(t), rel=1e-7)
        left = 0.8 - ours[round(t / 0.005), 0]
        assert left == pytest.approx(0.5 * np.exp(-gain * total), rel=1e-6, abs=1e-11)


def test_ramp_delay_is_tracked_with_the_stated_lags() -> None:
    rate = 0.02
    running: Delay = lambda t: 0.5 + rate * t  # noqa: E731
    blank = np.full(4, np.nan)
    first = on_a_ramp(least_squares(0.01, 1e3, 1.0), 0.5, running, blank)
    assert 0.9 - first[-1] == pytest.approx(rate / 1.0, rel=1e-3)
    k, fade, gain = 0.2, 1.5, 60.0
    second = on_a_ramp(adaptive(0.01, k, fade, gain), 0.5, running, np.full(6, np.nan))
    steady = (B * RAMP.frequency) ** 2 / fade
    assert 0.9 - second[-1] == pytest.approx(rate * (k + 1 / fade + 1 / (gain * steady)), rel=1e-3)


def test_wrong_initial_value_affects_least_squares_until_forgotten() -> None:
    estimator = least_squares(0.01, 100.0, 0.0)
    rows = record(estimator, Input(), constant(0.6), 20.0)
    right, wrong = (observed(estimator, rows, x0=x0)[:, 0] for x0 in (0.0, 0.5))
    assert abs(right[-1] - 0.6) < 0.02
    assert np.max(np.abs(wrong[:500] - right[:500])) > 0.4


# ---- The relay


@pytest.mark.parametrize("on", ["delay", "inverse"])
def test_relay_reaches_the_delay_at_the_predicted_time(on: str) -> None:
    time = half_steps(0.001, 2.0)[::2]
    delay = run(relay(0.001, 0.5, on), RAMP, constant(0.8), 2.0)[:, 0]
    straight = 0.3 + 0.5 * time if on == "delay" else 1 / (1 / 0.3 - 0.5 * time)
    arrival = 1.0 if on == "delay" else (1 / 0.3 - 1 / 0.8) / 0.5
    assert np.allclose(delay, np.where(time < arrival, straight, 0.8), atol=7e-4, rtol=0)


def test_chatter_is_constant_for_the_delay_and_quadratic_for_its_inverse() -> None:
    delays, h, gain = (0.6011, 1.2013, 0.3007), 0.01, 0.5
    width = {
        on: [
            np.ptp(run(relay(h, gain, on), Input(), constant(tau), 7.5)[:, 0][600:])
            for tau in delays
        ]
        for on in ("delay", "inverse")
    }
    assert np.allclose(width["delay"], gain * h, rtol=1e-9)
    assert np.allclose(width["inverse"], gain * h * np.square(delays), rtol=0.01)
    assert width["inverse"][1] / width["inverse"][2] == pytest.approx(16, rel=0.02)


@pytest.mark.parametrize("kind", ALL)
def test_constant_input_leaves_the_delay_where_it_is(kind: str) -> None:
    """Where u' = 0 nothing depends on the delay."""
    estimator = ALL[kind](0.01)
    y, control, past = record(estimator, Input(0.0), constant(0.6), 2.0)
    for noise in (0.0, 1e-3):
        noisy = y + noise * np.random.default_rng(1).standard_normal(y.shape)
        delay = observed(estimator, (noisy, control, past))[:, 0]
        assert np.all(np.isfinite(delay))
        assert np.ptp(delay) < 1e-12


@pytest.mark.parametrize(("on", "safe"), [("delay", 0.9), ("inverse", 0.55)])
def test_relay_faster_than_the_safe_rate_can_lose_the_delay(on: str, safe: float) -> None:
    """Safe rates satisfy |tau'| < M < 1 and |tau'| < M theta^2 < 1: theta is 1.25 s at most
    here."""

    def worst(gain: float) -> float:
        estimator = replace(relay(0.01, gain, on), decay=1.0, input_gain=1.0)
        delay = observed(estimator, scenario(on))[:, 0]
        time = 0.01 * np.arange(len(delay))
        return float(np.max(np.abs(delay - paper_delay(time))[6600:]))

    assert max(worst(safe * factor) for factor in np.linspace(0.9, 1, 11)) < 0.05
    assert max(worst(1.05 * factor / safe) for factor in np.linspace(0.9, 1.1, 11)) > 0.25


@cache
def scenario(on: str) -> tuple[Array, Array, Array]:
    estimator = VariableStructureDelayEstimator(1.0, 1.0, BOUNDS, 0.01, 1.0, on)
    return record(estimator, Input(), paper_delay, 120.0)


DIPPING = [
    (3.0, constant(1.2)),
    (6.0, constant(0.5)),
    (10.0, lambda t: 1.0 + 0.4 * np.sin(0.9 * t)),
]


def dipping_delay(t: Array) -> Array:
    return np.where(t < 3, 1.2, np.where(t < 6, 0.5, 1.0 + 0.4 * np.sin(0.9 * t)))


@pytest.mark.parametrize(
    ("pieces", "delay", "first", "h", "instant", "beyond"),
    [
        (PIECES, short_delay, 0.8, 0.04, 6.0607, 8.9e-5),
        (DIPPING, dipping_delay, 1.2, 0.04, 6.301, 3.6e-5),
        # Early in the step, so that it ends farther inside than it started.
        (PIECES, short_delay, 0.8, 0.05, 6.0607, 2e-5),
    ],
)
def test_delay_leaving_the_bounds_within_a_step_is_held(
    pieces: list[tuple[float, Delay]],
    delay: Delay,
    first: float,
    h: float,
    instant: float,
    beyond: float,
) -> None:
    """Its extremum is beyond the bound by that much, within a single step."""
    free, upper = SMOOTH["least squares"](h), pieces is PIECES
    fine = run(SMOOTH["least squares"](0.001), FAST, delay, 10.0, first)[:, 0]
    bounds = (0.0, fine.max() - beyond) if upper else (fine.min() + beyond, 1.5)
    over = 0.001 * np.flatnonzero((fine < bounds[0]) | (fine > bounds[1]))
    step = h * np.floor(instant / h)
    assert step < over[0] <= instant < over[-1] < step + h
    narrow = replace(free, delay_bounds=bounds)
    expected, changes = reference(narrow, FAST, pieces, first, 0.2)
    assert changes == 2, "held and let go once"
    ours, unbounded = (
        np.max(np.abs(found[:: round(0.2 / h)] - expected[:, 0])[31:])
        for found in (run(one, FAST, delay, 10.0, first)[:, 0] for one in (narrow, free))
    )
    assert ours < 2e-7
    assert unbounded > 0.5 * beyond, "what is truncated shows"
