"""Printed forms and claims of the paper that fail, and their corrections."""

from __future__ import annotations

import warnings
from functools import cache
from math import factorial

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq

from reobserve.core.vector_field import vector_field
from reobserve.observers.extended_high_gain import ExtendedHighGainObserver, SwitchedOffWarning
from reobserve.observers.fixed_step import run_on_halves
from reobserve.observers.high_gain import HighGainObserver
from reobserve.observers.levant import LevantDifferentiator
from reobserve.synthesis.high_gain_design import high_gain, lyapunov_matrix
from reobserve.systems.triangular import TriangularModel
from reobserve_papers.plants.delayed_input import DelayedInputPlant
from reobserve_papers.plants.first_order_lag import first_order_lag
from reobserve_papers.signals.inputs import Signal
from tests.reobserve.observers.small_plants import G_OVER_L, A
from tests.reobserve.observers.test_extended_high_gain import (
    FIRST_DELAY,
    Case,
    observed,
    observer,
    record,
)
from tests.reobserve_papers.plants.test_delayed_plants import (
    LAG,
    PENDULUM,
    PROFILE,
    SINE,
    constant,
    signal,
    sine,
)

Array = NDArray[np.float64]

STEP = 5e-3


def with_derivatives(control: Signal, order: int, time: Array) -> Array:
    """u to u^(m) at times, shape (k, m + 1)."""
    found = []
    for _ in range(order + 1):
        found.append(control(time)[:, 0])
        control = control.derivative("control")
    return np.stack(found, axis=1)


@cache
def delay_error(applied: str, rho: float, order: int, threshold: float, end: float) -> Array:
    """tau^ - tau at the ends of steps."""
    delay = observed(Case(applied, rho, order, threshold), STEP, end)["delay"]
    return delay - PROFILE(STEP * np.arange(len(delay)))[:, 0]


def rms_of(error: Array) -> float:
    return float(np.sqrt(np.mean(error**2)))


def seconds(error: Array, begin: float, end: float) -> Array:
    return error[round(begin / STEP) : round(end / STEP)]


# --- (34) and (36) lack C^T ---------------------------------------------------------------------

# A matrix times the number x^1 - y is a matrix. Possible ways to get a vector from it:
READINGS = {
    "its diagonal": np.diag,
    "sums of its rows": lambda S: S.sum(axis=1),  # or of columns: it is symmetric
    "its second column": lambda S: S[:, 1],
    "its last column": lambda S: S[:, -1],
}


def error_matrix(gain: Array) -> Array:
    matrix = np.eye(len(gain), k=1)
    matrix[:, 0] -= gain
    return matrix


@pytest.mark.parametrize("size", [2, 3])
def test_gain_with_c_transposed_is_a_vector_and_places_all_poles_at_minus_rho(size: int) -> None:
    for rho in (2.5, 5.0):
        inverse = np.linalg.inv(lyapunov_matrix(size, rho))
        assert (inverse * 0.1).shape == (size, size), "as printed: no summand of a vector"
        gain = inverse @ np.eye(size)[:, 0]
        assert gain == pytest.approx(high_gain(size, rho), rel=1e-9)
        polynomial = np.poly(error_matrix(gain))
        assert polynomial == pytest.approx(np.poly(np.full(size, -rho)), rel=1e-9)
    assert HighGainObserver(PENDULUM.model, rho=5.0, sampling_period=STEP).gain == pytest.approx(
        [10, 25]
    )
    assert observer(Case("ramp", 5.0, 2), STEP)._gains(np.zeros(1))[0].tolist() == [15, 75, 125]


@pytest.mark.parametrize("reading", READINGS)
@pytest.mark.parametrize("size", [2, 3])
def test_no_other_vector_from_the_printed_matrix_places_the_poles(reading: str, size: int) -> None:
    """The poles must grow in proportion to rho and be stable."""
    read = READINGS[reading]
    poles = {
        rho: np.linalg.eigvals(error_matrix(read(np.linalg.inv(lyapunov_matrix(size, rho)))))
        for rho in (0.5, 5.0, 20.0)
    }
    for rho, found in poles.items():
        assert np.max(np.abs(found / rho + 1)) > 0.3
    fastest = [np.max(np.abs(found)) / rho for rho, found in poles.items()]
    assert max(fastest) > 2 * min(fastest)
    if size == 3 and reading in ("its diagonal", "its last column"):
        assert max(np.max(found.real) for found in poles.values()) > 0


# --- (37) lacks L -------------------------------------------------------------------------------


def test_printed_differentiator_fails_in_the_observer_even_without_noise() -> None:
    """Tests of the differentiator check it alone; here it is used by the observer."""
    built = observer(Case("sine", 2.5, 2, 0.7), STEP)
    y, exact = record("sine", STEP, 60.0)
    found = {}
    for printed in (False, True):
        law = LevantDifferentiator(
            L=0.11, order=2, lambdas=(3.0, 1.5, 1.0), printed=printed, sampling_period=0.5 * STEP
        )
        rates = law.run(exact[:, 0], start=law.init(np.zeros(3)))["derivatives"][:, 1:]
        inputs, start = (
            np.column_stack([exact[:, 0], rates]),
            built.init([0.0, 0.0], delay=FIRST_DELAY),
        )
        delay = run_on_halves(built, y, inputs, start=start)["delay"]
        error = delay - PROFILE(STEP * np.arange(len(delay)))[:, 0]
        found[printed] = rms_of(seconds(error, 5, 60))
    known = rms_of(seconds(delay_error("sine", 2.5, 2, 0.7, 60.0), 5, 60))
    assert found[False] == pytest.approx(known, rel=0.02)
    assert found[False] < 0.25
    assert found[True] > 0.5


# --- Remark 3.6: the radius falls with rho ------------------------------------------------------


def test_error_radius_on_the_ramp_falls_with_rho() -> None:
    largest = [
        np.max(np.abs(seconds(delay_error("ramp", rho, 2, 0.0, 106.0), 80, 105)))
        for rho in (2.0, 2.5, 5.0, 10.0, 20.0)
    ]
    assert np.all(np.diff(largest) < 0)
    assert largest[2:] == pytest.approx([0.0784, 0.0319, 0.0146], abs=1e-4)


def away_from_singular_instants(rho: float, order: int) -> float:
    """Rms of the error after 66 s, from 4 s after a singular instant to 2 s before the next."""
    error, time = delay_error("sine", rho, order, 0.7, 120.0), STEP * np.arange(24001)
    since = (time - np.pi / 2 / 0.2) % (np.pi / 0.2)
    chosen = (time > 66) & (since > 4) & (since < np.pi / 0.2 - 2)
    return rms_of(error[chosen])


def test_error_radius_on_the_sine_does_not_fall_for_m_1() -> None:
    """It falls to the error of the Taylor expansion, which no gain removes, and approaches it from
    below.
    """
    rhos = (1.5, 2.5, 5.0, 7.0, 10.0, 20.0)
    first, second = ([away_from_singular_instants(rho, m) for rho in rhos] for m in (1, 2))
    assert first == pytest.approx([0.261, 0.148, 0.073, 0.068, 0.070, 0.076], abs=6e-4)
    assert int(np.argmin(first)) == 3
    assert np.all(np.diff(first[3:]) > 0)
    assert second == pytest.approx([0.277, 0.162, 0.062, 0.040, 0.026, 0.0126], abs=6e-4)
    assert np.all(np.diff(second) < 0)
    # Where the lag dominates, the higher order is no better.
    assert second[1] > first[1]


# --- Correct statements -------------------------------------------------------------------------


def test_both_orders_are_bitwise_identical_on_a_ramp() -> None:
    for dynamic in (False, True):
        first, second = (observed(Case("ramp", 5.0, m, dynamic=dynamic), STEP, 120) for m in (1, 2))
        assert np.array_equal(first["delay"], second["delay"])
        assert np.array_equal(first["state"], second["state"])


def test_constant_delay_is_found_with_the_slow_pole() -> None:
    error = delay_error("ramp", 5.0, 2, 0.0, 106.0)
    for end in (20, 40, 60):
        assert np.max(np.abs(seconds(error, end - 5, end))) < 1e-8
    linear = error_matrix(high_gain(3, 5.0))
    linear[1, :2] -= G_OVER_L, A
    slow = np.max(np.linalg.eigvals(linear).real)
    assert slow == pytest.approx(-1.28, abs=0.005)
    decay = np.log(abs(error[round(10 / STEP)] / error[round(5 / STEP)])) / 5
    assert decay == pytest.approx(slow, rel=2e-3)


@pytest.mark.parametrize(("rho", "share"), [(5.0, 0.03), (10.0, 0.01), (20.0, 0.003)])
def test_varying_delay_is_followed_with_the_lag_of_the_linear_error(
    rho: float, share: float
) -> None:
    """The largest error is that of e = -tau' (3 rho a + 3 rho^2 + b) / rho^3, b = g/l cos x1."""
    time = STEP * np.arange(round(106 / STEP) + 1)
    angle = record("ramp", STEP, 106.0)[0][::2]
    slope = PROFILE.derivative("delay")(time)[:, 0]
    lag = -slope * (3 * rho * A + 3 * rho**2 + G_OVER_L * np.cos(angle)) / rho**3
    found, predicted = (seconds(e, 80, 105) for e in (delay_error("ramp", rho, 2, 0.0, 106.0), lag))
    assert np.max(np.abs(found)) == pytest.approx(np.max(np.abs(predicted)), rel=share)


@vector_field
def _lower_drift(x: Array, p: Array, f: Array) -> None:
    f[0] = -x[0]
    f[1] = p[0] * np.sin(x[0]) - x[1]
    f[2] = -p[0] * x[0] - x[1] * np.cos(x[0]) - 2.0 * x[2]


@vector_field
def _swinging_gain(y: Array, p: Array, G: Array) -> None:
    G[0] = 1.0 + 0.2 * np.sin(y[0])


MODELS = {
    1: first_order_lag(1.3, -0.8),
    2: PENDULUM.model,
    3: TriangularModel(3, _lower_drift, _swinging_gain, np.array([0.5])),
}
# u' = 0.5 + 0.3 cos t is never zero, and u to u^(m) are bounded by 0.3 around their mean.
EARLY = {"from": -1.5}
TERMS = [constant(-0.75, **EARLY), {"kind": "ramp", "slope": 0.5, **EARLY}, sine(0.3, 1.0, **EARLY)]
STRAIGHT, RISING = signal(*TERMS[:2]), signal(*TERMS)
TRUE_DELAY = 0.6


def late_delays(states: int, order: int, rho: float, control: Signal) -> tuple[Array, Array]:
    """Times and estimates of the last 10 s of 25 s, for a constant delay."""
    time = 0.5 * STEP * np.arange(round(50 / STEP) + 1)
    x = DelayedInputPlant(MODELS[states]).simulate(
        np.full(states, 0.1), control, signal(constant(TRUE_DELAY)), 0.5 * STEP, len(time) - 1
    )
    built = ExtendedHighGainObserver(
        MODELS[states], rho=rho, order=order, delay_bounds=(0.0, 1.5), sampling_period=STEP
    )
    start = built.init(np.zeros(states), delay=FIRST_DELAY)
    run = run_on_halves(built, x[:, 0], with_derivatives(control, order, time), start=start)
    return time[::2][-2000:], run["delay"][-2000:]


@pytest.mark.nightly_cases("2-2", "3-1")
@pytest.mark.parametrize("states", MODELS)
@pytest.mark.parametrize("order", [1, 2, 3])
def test_constant_delay_error_stays_within_the_taylor_bound(states: int, order: int) -> None:
    """The remainder (7) over the smallest slope of the Taylor polynomial; with a high gain the
    estimate is the root of the polynomial.
    """
    exact = late_delays(states, order, 5.0, STRAIGHT)[1]
    assert np.max(np.abs(exact - TRUE_DELAY)) < 1e-6
    time, delay = late_delays(states, order, 20.0, RISING)
    u = with_derivatives(RISING, order, time)
    signs = [(-1) ** i / factorial(i) for i in range(order + 1)]
    taylor = [np.polynomial.Polynomial(signs * row) for row in u]
    slopes = [abs(p.deriv()(guess)) for p in taylor for guess in (0.5, 0.6, 0.7, 0.8)]
    bound = 0.3 * TRUE_DELAY ** (order + 1) / factorial(order + 1) / min(slopes)
    assert 0.5 * bound < np.max(np.abs(delay - TRUE_DELAY)) < bound
    late = zip(taylor, RISING(time - TRUE_DELAY)[:, 0], strict=True)
    roots = [brentq(lambda d, p=p, w=w: p(d) - w, 0, 1.5) for p, w in late]
    # The root moves within about 1 s; the observer follows it with (n + 1) / rho.
    lag = 2.2 * (states + 1) / 20.0
    assert np.max(np.abs(delay - roots)) < lag * np.max(np.abs(delay - TRUE_DELAY))


# --- Singular instants, triangular form, threshold ----------------------------------------------


def test_observer_is_switched_off_at_the_corrected_singular_instants() -> None:
    """0.2 t = pi/2 [pi]; printed is 0.15 t = pi/2 [2 pi]."""
    off = observed(Case("sine", 2.5, 1, 0.7), STEP, 120.0)["switched_off"][1:]
    at = STEP * (np.arange(len(off)) + 0.5)
    edges = np.flatnonzero(np.abs(np.diff(off > 0.5)))
    centres = at[edges].reshape(-1, 2).mean(axis=1)
    assert centres == pytest.approx(np.pi / 2 / 0.2 + np.pi / 0.2 * np.arange(8), abs=STEP)
    printed = np.pi / 2 / 0.15 + 2 * np.pi / 0.15 * np.arange(3)
    assert np.all(off[(printed / STEP).astype(int)] == 0)


@vector_field
def _upper_drift(x: Array, p: Array, f: Array) -> None:
    f[0] = p[0] * x[1]
    f[1] = -x[1]


def test_form_called_upper_triangular_must_be_lower_triangular() -> None:
    """An upper-triangular f_1 may contain x2; here it reverses the sign of x2 in x1'."""
    time = 0.5 * STEP * np.arange(4001)
    known = np.sin(time)
    found = []
    for factor in (0.0, -2.0):
        model = TriangularModel(2, _upper_drift, _swinging_gain, np.array([factor]))
        plant = DelayedInputPlant(model)
        x = plant.simulate([0, 1], signal(sine(1, 1)), signal(constant(0)), 0.5 * STEP, 4000)
        built = HighGainObserver(model, rho=5.0, sampling_period=STEP)
        estimate = run_on_halves(built, x[:, 0], known, start=built.init([0, 0]))["state"]
        found.append(np.max(np.abs(estimate[-1] - x[-1])))
    assert found[0] < 1e-8
    assert found[1] > 1e3


def test_threshold_of_example_1_switches_off_the_observer_of_example_2() -> None:
    """|xi| <= 0.2 + 1.5 / 2 * 0.04 there, 20 times less than for the pendulum."""
    time = 0.5 * STEP * np.arange(round(240 / STEP) + 1)
    x = LAG.simulate([0.0], SINE, PROFILE, 0.5 * STEP, len(time) - 1)[:, 0].copy()
    u, at = with_derivatives(SINE, 2, time), time[::2]
    for order in (1, 2):
        built = ExtendedHighGainObserver(
            LAG.model,
            rho=5.0,
            order=order,
            delay_bounds=(0.0, 1.5),
            threshold=0.7,
            sampling_period=STEP,
        )
        start = built.init([0.0], delay=FIRST_DELAY)
        with pytest.warns(SwitchedOffWarning, match="100 %"):
            run = run_on_halves(built, x, u[:, : order + 1], start=start)
        assert np.all(run["delay"] == FIRST_DELAY)
    scaled = ExtendedHighGainObserver(
        LAG.model,
        rho=5.0,
        order=2,
        delay_bounds=(0.0, 1.5),
        threshold=0.7 / 20,
        sampling_period=STEP,
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error", SwitchedOffWarning)
        delay = run_on_halves(scaled, x, u, start=scaled.init([0.0], delay=FIRST_DELAY))["delay"]
    error = delay - PROFILE(at)[:, 0]
    spans = ((12, 20), (32, 40), (52, 60), (66, 120))
    rms = [rms_of(seconds(error, *span)) for span in spans]
    assert rms == pytest.approx([0.0015, 0.0093, 0.0002, 0.0263], abs=1e-4)
