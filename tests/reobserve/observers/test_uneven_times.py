"""Samples at uneven times and at several rates, against sampling to 40 digits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from mpmath import mp
from numpy.typing import ArrayLike, NDArray

from reobserve import (
    ExtendedKalmanFilter,
    InputError,
    KalmanFilter,
    LinearModel,
    NonlinearModel,
    UnscentedKalmanFilter,
    rts_smoother,
)
from reobserve.core.discretisation import held_noise
from tests.reobserve.observers.by_row import (
    LENGTHS,
    PENDULUM,
    ROWS,
    SPRING,
    STIFF,
    TIMES,
    differing,
    record,
    spring_bank,
)

Array = NDArray[np.float64]

W = np.array([[0.2, 0.05], [0.05, 0.3]])
SHARED = ("state", "covariance", "innovation", "log_likelihood")


def exponential(matrix: ArrayLike, period: float) -> Array:
    """exp(matrix T), from 40 digits."""
    with mp.workdps(40):
        found = mp.expm(mp.matrix(np.asarray(matrix).tolist()) * mp.mpf(period))
        return np.array(found.tolist(), dtype=np.float64)


def sampled(A: Array, B: Array, density: Array, period: float) -> tuple[Array, Array, Array]:
    """The transition, the effect of a held input, and the noise: Q' = A Q + Q A' + W, Q(0) = 0."""
    n, p = B.shape
    whole = exponential(np.block([[A, B], [np.zeros((p, n + p))]]), period)
    both = np.kron(A, np.eye(n)) + np.kron(np.eye(n), A)
    rates = np.block([[both, density.reshape(-1, 1)], [np.zeros((1, n * n + 1))]])
    return whole[:n, :n], whole[:n, n:], exponential(rates, period)[:-1, -1].reshape(n, n)


def sampled_rows(model: LinearModel, periods: ArrayLike) -> dict[str, Array]:
    ode: Any = model.ode
    found = [sampled(ode.A, ode.B, ode.density, period) for period in np.asarray(periods)]
    return {
        name: np.array(rows) for name, rows in zip("ABQ", zip(*found, strict=True), strict=True)
    }


# --- The noise of a period ------------------------------------------------------------------------


def test_noise_of_an_oscillator_agrees_with_quadrature() -> None:
    """exp(A s) = exp(-s/5) (I cos(1.4 s) + (A + I/5) sin(1.4 s) / 1.4)."""
    with mp.workdps(25):
        A, density = mp.matrix([[0, 1], [-2, -mp.mpf(2) / 5]]), mp.matrix(W.tolist())
        eye, rate = mp.eye(2), mp.mpf(7) / 5

        def entry(i: int, j: int, s: Any) -> Any:
            held = eye * mp.cos(rate * s) + (A + eye / 5) * mp.sin(rate * s) / rate
            held *= mp.exp(-s / 5)
            return (held * density * held.T)[i, j]

        for period in (0.01, 0.7, 6.0):
            edges = mp.linspace(0, period, 1 + max(1, int(period) // 2))
            wanted = [
                [float(mp.quad(lambda s, i=i, j=j: entry(i, j, s), edges)) for j in range(2)]
                for i in range(2)
            ]
            found = held_noise([[0.0, 1.0], [-2.0, -0.4]], W, period)
            np.testing.assert_allclose(found, wanted, rtol=1e-13)


@pytest.mark.parametrize("period", [1e-6, 0.1, 10.0])
def test_noise_of_stiff_states_is_exact(period: float) -> None:
    """Of a diagonal A: Q_ij = W_ij (exp((a_i + a_j) T) - 1) / (a_i + a_j)."""
    rates = np.array([-1e4, -1.0])
    sums = rates[:, None] + rates
    wanted = W * np.expm1(sums * period) / sums
    np.testing.assert_allclose(held_noise(np.diag(rates), W, period), wanted, rtol=1e-12)


@pytest.mark.parametrize("T", [1e-3, 0.5, 200.0])
def test_noise_of_a_double_integrator_is_exact(T: float) -> None:
    wanted = 0.3 * np.array([[T**3 / 3, T**2 / 2], [T**2 / 2, T]])
    found = held_noise([[0.0, 1.0], [0.0, 0.0]], [[0.0, 0.0], [0.0, 0.3]], T)
    np.testing.assert_allclose(found, wanted, rtol=1e-14)


# --- Filters at uneven times ----------------------------------------------------------------------


def test_filter_and_smoother_agree_with_exact_matrices_by_row() -> None:
    one, (y, u) = KalmanFilter(SPRING), record()
    given = sampled_rows(SPRING, [*np.diff(TIMES), 0.1])
    run = one.run(y, u, start=one.init([0.3, -0.2], 0.5), time=TIMES)
    wanted = one.run(y, u, start=one.init([0.3, -0.2], 0.5), **given)
    assert np.array_equal(run.time, TIMES)
    for name in SHARED:
        np.testing.assert_allclose(run[name], wanted[name], rtol=1e-11, atol=1e-12)
    smooth, exact = rts_smoother(run), rts_smoother(wanted)
    for name in ("state", "covariance"):
        np.testing.assert_allclose(smooth[name], exact[name], rtol=1e-11, atol=1e-12)


def test_bank_agrees_with_exact_matrices_of_each_mode_by_row() -> None:
    one, (y, u) = spring_bank(), record()
    modes = [sampled_rows(model, [*np.diff(TIMES), 0.1]) for model in (SPRING, STIFF)]
    given = {name: np.stack([mode[name] for mode in modes], axis=1) for name in modes[0]}
    state = one.init([0.3, -0.2], 0.5)
    run, wanted = one.run(y, u, start=state, time=TIMES), one.run(y, u, start=state, **given)
    for name in wanted:
        np.testing.assert_allclose(run[name], wanted[name], rtol=1e-11, atol=1e-12)


def test_matrices_by_row_stand_for_those_of_uneven_times() -> None:
    """What is given is taken; the rest is sampled over each period."""
    one, (y, u) = KalmanFilter(SPRING), record()
    given, state = sampled_rows(SPRING, [*np.diff(TIMES), 0.1]), one.init([0.3, -0.2], 0.5)
    given["Q"] = np.tile(0.3 * np.eye(2), (ROWS, 1, 1))
    run = one.run(y, u, start=state, time=TIMES, Q=given["Q"])
    wanted = one.run(y, u, start=state, **given)
    for name in SHARED:
        np.testing.assert_allclose(run[name], wanted[name], rtol=1e-11, atol=1e-12)


@pytest.mark.parametrize("kind", [ExtendedKalmanFilter, UnscentedKalmanFilter])
def test_nonlinear_filters_at_uneven_times_agree_with_runge_kutta_by_row(kind: Any) -> None:
    """A step of x' = A x + B u: x + sum of (A T)^i / i! to the fourth power; noise W T."""
    A, B = SPRING.ode.A, SPRING.ode.B  # type: ignore[union-attr]
    options: Any = {"state_names": ["a", "w"], "input_names": ["p", "q"], "sampling_period": 0.1}
    model = NonlinearModel.from_ode(
        ["w", "-2*a - 0.4*w + p + 0.3*q"], ["a + 0.1*q", "w + 0.2*p"], density=W, R=0.05, **options
    )
    given: dict[str, list[Array]] = {"A": [], "B": [], "Q": []}
    for period in [*np.diff(TIMES), 0.1]:
        parts = max(1, int(np.ceil(period / 0.1 - 1e-3)))
        h, terms = period / parts, [np.eye(2)]
        for i in range(1, 5):
            terms.append(terms[-1] @ A * h / i)
        step = sum(terms[1:], terms[0])
        effect = [term * h / (i + 1) for i, term in enumerate(terms[:4])]
        pushed = sum(effect[1:], effect[0]) @ B
        powers = [np.linalg.matrix_power(step, i) for i in range(parts)]
        given["A"].append(powers[-1] @ step)
        given["B"].append(sum(power @ pushed for power in powers))
        given["Q"].append(sum(power @ W @ power.T * h for power in powers))
    (y, u), one, linear = record(), kind(model), KalmanFilter(SPRING)
    wanted = linear.run(y, u, start=linear.init([0.3, -0.2], 0.5), **given)
    run = one.run(y, u, start=one.init([0.3, -0.2], 0.5), time=TIMES)
    for name in SHARED:
        np.testing.assert_allclose(run[name], wanted[name], rtol=1e-10, atol=1e-11)
    smooth, exact = rts_smoother(run), rts_smoother(wanted)
    np.testing.assert_allclose(smooth["covariance"], exact["covariance"], rtol=1e-9, atol=1e-11)
    lengths = [*np.diff(TIMES), 0.1]
    by_lengths = one.run(y, u, start=one.init([0.3, -0.2], 0.5), dt=lengths)
    np.testing.assert_allclose(by_lengths.time, TIMES, rtol=1e-14)
    for name in SHARED:
        np.testing.assert_allclose(by_lengths[name], run[name], rtol=1e-12, atol=1e-13)
    given_lengths = rts_smoother(by_lengths)
    np.testing.assert_allclose(given_lengths["state"], smooth["state"], rtol=1e-11, atol=1e-12)


# --- Gaps -----------------------------------------------------------------------------------------


def driven(**options: Any) -> NonlinearModel:
    """A driven pendulum, of which the angle is measured and a rate."""
    return NonlinearModel.from_ode(
        ["w", "-9.81*sin(a) - 0.1*w + p"], ["a", "w"], state_names=["a", "w"], input_names=["p"],
        density=[0, 0.09], R=[0.0025, 0.01], sampling_period=0.1, **options,
    )  # fmt: skip


@pytest.mark.parametrize("periods", [None, [2 * np.pi, 0.0]])
@pytest.mark.parametrize("kind", [ExtendedKalmanFilter, UnscentedKalmanFilter])
@given(gap=st.integers(0, 200), later=st.integers(1, 60), angle=st.floats(-3.0, 3.0))
@example(gap=50, later=10, angle=0.5)
@settings(max_examples=6)
def test_rows_left_out_are_rows_of_nan(
    kind: Any, periods: Any, gap: int, later: int, angle: float
) -> None:
    """Whatever is missing: state, covariance and likelihood, and what is smoothed."""
    model = driven(state_periods=periods, output_periods=periods)
    one, rng = kind(model), np.random.default_rng(gap)
    kept = np.concatenate([np.arange(8), 8 + gap + np.arange(5), 13 + gap + later + np.arange(4)])
    time, pushed = 0.1 * np.arange(kept[-1] + 1), rng.normal(0, 0.3, len(kept))
    y = np.full((len(time), 2), np.nan)
    y[kept] = angle * np.cos(3.1 * time[kept, None] + [0.0, 1.5]) + rng.normal(0, 0.02, (17, 2))
    held = pushed[np.searchsorted(kept, np.arange(len(time)), side="right") - 1]
    begin = one.init([angle, 0.0], [1e-2, 1.0])
    keep = ["predicted_state", "predicted_covariance"]
    whole = one.run(y, held, start=begin, keep=keep)
    short = one.run(y[kept], pushed, start=begin, time=time[kept], keep=keep)
    by_lengths = np.diff(time[kept], append=time[-1] + 0.1)
    again = one.run(y[kept], pushed, start=begin, dt=by_lengths, keep=keep)
    for name in (*SHARED, *keep):
        for found in (short, again):
            np.testing.assert_allclose(found[name], whole[name][kept], rtol=1e-7, atol=1e-9)
    smooth, exact = rts_smoother(short), rts_smoother(whole)
    if periods is not None:  # a correction by more than half a turn is taken the shorter way round
        straight = kind(driven()).run(y, held, start=begin, keep=keep)
        moved = rts_smoother(straight)["state"] - straight["predicted_state"]
        assume(np.abs(moved[:, 0]).max() < np.pi)
    for name in ("state", "covariance"):
        np.testing.assert_allclose(smooth[name], exact[name][kept], rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize("kind", [ExtendedKalmanFilter, UnscentedKalmanFilter])
def test_noise_given_for_a_gap_is_added_at_its_end(kind: Any) -> None:
    one, Q = kind(driven()), np.diag([0.2, 0.3])
    y = np.array([[0.5, 0.0], [np.nan, np.nan], [np.nan, np.nan], [0.3, -0.4]])
    quiet = np.zeros((4, 2, 2))
    quiet[2] = Q
    begin = one.init([0.4, 0.0], [1e-2, 1.0])
    whole = one.run(y, np.ones(4), start=begin, Q=quiet)
    short = one.run(y[::3], np.ones(2), start=begin, dt=[0.3, 0.1], Q=np.stack([Q, Q]))
    for name in SHARED:
        np.testing.assert_allclose(short[name], whole[name][::3], rtol=1e-9, atol=1e-11)
    first = one.run(y[:1], np.ones(1), start=begin, dt=0.3, Q=Q)
    second = one.run(y[3:], np.ones(1), start=first.end)
    for name in SHARED:
        assert np.array_equal(second[name], short[name][1:])


@pytest.mark.parametrize("kind", [ExtendedKalmanFilter, UnscentedKalmanFilter])
def test_noise_to_the_first_row_is_the_density_unless_it_was_given_before(kind: Any) -> None:
    one, y = kind(driven()), np.array([[0.5, 0.0], [0.3, -0.4]])
    begin = one.init([0.4, 0.0], [1e-2, 1.0])
    whole = one.run(y, np.ones(2), start=begin, dt=[0.25, 0.1])
    first = one.run(y[:1], np.ones(1), start=begin, dt=0.25)
    second = one.run(y[1:], np.ones(1), start=first.end, Q=np.eye(2))
    for name in SHARED:
        assert np.array_equal(second[name], whole[name][1:])


@pytest.mark.parametrize("periods", [0.3, 0.999, 1.0, 1.0005])
def test_rows_a_period_apart_or_less_are_one_step(periods: float) -> None:
    """The bits of a record without gaps: one Runge-Kutta step, and density times its length."""
    model, x = driven(), np.array([0.4, -0.2])
    one, h = UnscentedKalmanFilter(model), 0.1 * periods
    run = one.run(
        [[np.nan] * 2] * 2, [0.0, 0.0], start=one.init(x, np.zeros((2, 2))), dt=[h, h],
        keep=["predicted_state", "predicted_covariance"],
    )  # fmt: skip

    def slope(at: Array) -> Array:
        return np.array([at[1], -9.81 * np.sin(at[0]) - 0.1 * at[1]])

    first = slope(x)
    second = slope(x + h / 2 * first)
    third = slope(x + h / 2 * second)
    wanted = x + h / 6 * (first + 2 * second + 2 * third + slope(x + h * third))
    np.testing.assert_allclose(run["predicted_state"][1], wanted, rtol=1e-14)
    np.testing.assert_allclose(
        run["predicted_covariance"][1], h * np.diag([0, 0.09]), rtol=1e-14, atol=1e-30
    )


def test_a_gap_of_too_many_periods_is_refused() -> None:
    one = ExtendedKalmanFilter(driven())
    state = one.init([0, 0], 1.0)
    with pytest.raises(InputError, match=r"dt: of 1e\+09 s between two rows is 1e\+10 sampling"):
        one.run([[0, 0], [0, 0]], [0, 0], start=state, time=[0.0, 1e9])


# --- Several rates --------------------------------------------------------------------------------


@pytest.mark.parametrize("every", [2, 3])
def test_a_slow_sensor_in_a_fast_record_is_a_filter_of_its_rate(every: int) -> None:
    y, u = record(12)
    y[2], y[4, 1] = 0.3, -0.2
    u = np.repeat(u[::every], every, axis=0)[:12]
    slow = np.full(y.shape, np.nan)
    slow[::every] = y[::every]
    ode: Any = SPRING.ode
    model = LinearModel.from_ode(
        ode.A, ode.B, SPRING.C, SPRING.D, R=SPRING.R, density=ode.density,
        sampling_period=0.1 * every,
    )  # fmt: skip
    fast, one = KalmanFilter(SPRING), KalmanFilter(model)
    state = one.init([0.3, -0.2], 0.5)
    run = fast.run(slow, u, start=state)
    wanted = one.run(y[::every], u[::every], start=state)
    times = 0.1 * np.arange(0, 12, every)
    skipping = fast.run(y[::every], u[::every], start=state, time=times)
    for name in SHARED:
        np.testing.assert_allclose(run[name][::every], wanted[name], rtol=1e-12, atol=1e-13)
        np.testing.assert_allclose(skipping[name], wanted[name], rtol=1e-12, atol=1e-13)
    smooth, slowly = rts_smoother(run), rts_smoother(wanted)
    for name in ("state", "covariance"):
        np.testing.assert_allclose(smooth[name][::every], slowly[name], rtol=1e-11, atol=1e-12)


def test_two_sensors_of_two_rates_correct_one_after_the_other() -> None:
    """A record with a row for each reading, at its time, is that of a row for both at once."""
    both, times = np.array([[0.4, -0.3], [0.1, 0.2]]), [0.0, 0.3]
    one, u = KalmanFilter(SPRING), np.zeros((2, 2))
    wanted = one.run(both, u, start=one.init([0.3, -0.2], 0.5), time=times)
    apart = np.full((3, 2), np.nan)
    apart[0], apart[1, 0], apart[2, 1] = both[0], both[1, 0], both[1, 1]
    close = [0.0, 0.3, 0.3 + 1e-13]
    run = one.run(apart, np.zeros((3, 2)), start=one.init([0.3, -0.2], 0.5), time=close)
    np.testing.assert_allclose(run["state"][-1], wanted["state"][-1], rtol=1e-11)
    total = run["log_likelihood"][1:].sum()
    assert total == pytest.approx(wanted["log_likelihood"][1], rel=1e-11)


# --- Going on -------------------------------------------------------------------------------------


def test_noise_correlated_at_uneven_times_goes_on_over_parts() -> None:
    one, (y, u), S = KalmanFilter(SPRING), record(), np.full((ROWS, 2, 2), 0.006)
    state = one.init([0.3, -0.2], 0.5)
    whole = one.run(y, u, start=state, time=TIMES, S=S)
    exact = one.run(y, u, start=state, S=S, **sampled_rows(SPRING, [*np.diff(TIMES), 0.1]))
    first = one.run(y[:4], u[:4], start=state, time=TIMES[:4], S=S[:4])
    second = one.run(y[4:], u[4:], start=first.end, time=TIMES[4:], S=S[4:])
    for name in SHARED:
        np.testing.assert_allclose(whole[name], exact[name], rtol=1e-11, atol=1e-12)
        joined = np.concatenate([first[name], second[name]])
        np.testing.assert_allclose(joined, whole[name], rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("name", ["A", "B", "Q"])
def test_what_leads_to_the_next_row_is_held_over_to_uneven_times(name: str) -> None:
    one, (y, u), own = KalmanFilter(SPRING), record(), getattr(SPRING, name)
    rows = np.linspace(0.5, 1.5, ROWS)[:, None, None] * own
    state = one.init([0.3, -0.2], 0.5)
    first = one.run(y[:4], u[:4], start=state, time=TIMES[:4], **{name: rows[:4]})
    second = one.run(y[4:], u[4:], start=first.end, time=TIMES[4:])
    given = sampled_rows(SPRING, [*np.diff(TIMES), 0.1])
    given[name][:4] = rows[:4]
    wanted = one.run(y, u, start=state, **given)
    np.testing.assert_allclose(second["state"], wanted["state"][4:], rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(second["covariance"], wanted["covariance"][4:], rtol=1e-11)


@pytest.mark.parametrize("kind", [ExtendedKalmanFilter, UnscentedKalmanFilter])
def test_noise_of_the_last_row_is_held_over_to_periods_that_differ(kind: Any) -> None:
    one, (y, u), noise = kind(PENDULUM), record(), np.array([[4.0, 0.5], [0.5, 2.0]])
    first = one.run(y, u, start=one.init([0.3, -0.2], 0.5), dt=LENGTHS, Q=noise)
    keep = ["predicted_covariance"]
    second = one.run(y[:2], u[:2], start=first.end, dt=[0.09, 0.3], keep=keep)
    given = np.array([0.09 * np.asarray(PENDULUM.density), noise])  # on the second nothing depends
    wanted = one.run(y[:2], u[:2], start=first.end, dt=[0.09, 0.3], Q=given, keep=keep)
    assert not differing(second.estimates, wanted.estimates)
    assert second["predicted_covariance"][0, 0, 0] > 4.0


def test_times_go_on_from_the_last_one_by_the_sampling_period() -> None:
    one, (y, u) = KalmanFilter(SPRING), record()
    first = one.run(y, u, start=one.init([0.3, -0.2], 0.5), time=TIMES)
    second = one.run(y[:2], u[:2], start=first.end)
    np.testing.assert_allclose(second.time, [1.05, 1.15], rtol=1e-14)
    timed = one.run(y[:2], u[:2], start=first.end, time=second.time)
    assert not differing(second.estimates, timed.estimates)
