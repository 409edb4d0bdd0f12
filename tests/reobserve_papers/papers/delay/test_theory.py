"""The numbers of the theory against closed forms and independent computations."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.linalg import eigh

from reobserve.observers.fixed_step import run_on_halves
from reobserve.observers.levant import LevantDifferentiator
from reobserve_papers.metrics.metrics import Numbers, lookup
from reobserve_papers.papers.delay import (
    keys,
    theory_gains,
    theory_orders,
    theory_runs,
    theory_state_gain,
    without_threshold,
)
from reobserve_papers.papers.delay.theory_gains import error_matrix
from reobserve_papers.parameters.job import read_job
from reobserve_papers.signals.random_streams import random_stream
from reobserve_papers.steps.chain import reads
from reobserve_papers.steps.evaluation import Evaluator
from tests.published_numbers import golden_metrics
from tests.reobserve.observers.small_plants import G_OVER_L, GAIN, A
from tests.reobserve.observers.test_extended_high_gain import Case, observed, observer, record
from tests.reobserve_papers.papers import fixed_parameters

Array = NDArray[np.float64]


def evaluated(overrides: dict[str, object] | None = None) -> Numbers:
    return lookup(Evaluator(fixed_parameters("delay", overrides)).theory())


@cache
def numbers() -> Numbers:
    return evaluated()


# --- Conditions ---------------------------------------------------------------------------------


def test_delay_has_the_bounds_of_the_paper() -> None:
    found = numbers()
    assert found["delay", "minimum_delay"] == pytest.approx(0.3)
    assert found["delay", "maximum_delay"] == pytest.approx(1.25, abs=1e-6)


def test_rank_is_lost_where_the_input_rate_vanishes() -> None:
    assert numbers()["pendulum", "determinant_error"] < 1e-8


def test_one_more_derivative_restores_the_rank_at_turning_points() -> None:
    """There u'' has its maximum, so that the determinant is 1 - tau' of its size, tau' <= 0.09."""
    name = "determinant_at_turning_points"
    assert numbers().at("pendulum", name, derivatives=2) < 1e-6
    found = numbers().at("pendulum", name, derivatives=3)
    assert 1 - 0.09 - 1e-3 < found < 1.0


def test_delay_jumps_three_times() -> None:
    assert numbers()["delay", "jumps"] == 3


def test_xi_vanishes_as_often_with_higher_orders() -> None:
    """u' is zero at 7.85 s and every 15.7 s, four times from 60 to 120 s."""
    for order in (1, 2, 3):
        assert numbers()[f"order_{order}", "zeros_of_xi"] == 4


def test_smoothness_and_singular_instants_of_the_inputs_agree_with_theory() -> None:
    found = numbers()
    # 0.2 t = pi/2 [pi] up to 120 s: 7.85 s and seven more.
    assert found["sine", "singular_instants"] == 1 + (120 - np.pi / 0.4) // (np.pi / 0.2)
    assert found["sine", "minimum_rate"] == found["ramp", "singular_instants"] == 0
    assert found["ramp", "minimum_rate"] == 0.009
    assert found["ramp", "breaks"] == found["sine", "breaks"] == 0


def test_input_starting_at_zero_is_not_smooth() -> None:
    kinked = [{"kind": "ramp", "axis": 1, "from": 0, "slope": 0.009}]
    assert evaluated({"theory": {"ramp": kinked}})["ramp", "breaks"] == 1


def test_remainders_of_the_sine_agree_with_closed_form() -> None:
    """The maximum of |sin(a - b) - sin a + b cos a| over a is the amplitude of a sine."""
    found, b = numbers(), 0.2 * 1.5
    first = np.hypot(np.cos(b) - 1, b - np.sin(b))
    second = np.hypot(np.cos(b) - 1 + b**2 / 2, b - np.sin(b))
    assert found.at("sine", "remainder", order=1) == pytest.approx(first, rel=1e-3)
    assert found.at("sine", "remainder", order=2) == pytest.approx(second, rel=1e-3)


# --- Gains --------------------------------------------------------------------------------------


def test_poles_are_the_roots_of_the_polynomial() -> None:
    for name, rho in (("order2", 5.0), ("order2_noise", 2.5)):
        for when, b in (("", G_OVER_L), ("_upright", -G_OVER_L)):
            polynomial = [1, 3 * rho + A, 3 * rho**2 + 3 * rho * A + b, rho**3]
            slow = np.max(np.roots(polynomial).real)
            assert numbers()[name, f"slow_pole{when}"] == pytest.approx(slow)


def test_lag_is_the_steady_error_under_a_constant_rate() -> None:
    """0 = M e + (0, 0, -xi tau'): the last error over xi is the lag."""
    matrix = error_matrix(5.0, G_OVER_L, A)
    error = np.linalg.solve(matrix, [0, 0, 1.0])
    assert theory_gains.steady_ramp_error(5.0, G_OVER_L, A) == pytest.approx(error[2])


def test_predicted_lag_agrees_with_the_run() -> None:
    found = numbers()
    for rho, share in ((5, 0.03), (10, 0.01), (20, 0.003), (40, 0.003)):
        expected = found.at("order2", "predicted_delay_radius", rho=rho)
        run = found.at("order2", "delay_radius", rho=rho)
        assert run == pytest.approx(expected, rel=share)


def test_peak_gains_of_a_chain_agree_with_closed_form() -> None:
    """For three poles at -rho the gains are integrals of impulse responses.

    The responses of the last state to the last two inputs have one sign, so that their integrals
    are transfer functions at zero; that of the first state to the second input, (t - rho t^2 / 2)
    exp(-rho t), changes its sign where t^2 exp(-rho t) / 2 peaks.
    """
    for rho in (1.0, 5.0):
        found = theory_gains.peak_gains(error_matrix(rho, 0.0, 0.0))
        assert found[2, 1:] == pytest.approx([1, 3 / rho], rel=1e-5)
        assert found[0, 1] == pytest.approx(4 * np.exp(-2) / rho**2, rel=1e-5)
    assert np.all(np.isinf(theory_gains.peak_gains(error_matrix(1.25, -G_OVER_L, A))))


def test_minimum_radius_tends_to_the_expansion_remainder() -> None:
    """G gamma / xi and c_0 / xi, errors of the delay alone; the rest falls as 1 / rho."""
    found = numbers()
    floors = {
        1: GAIN * 1.5**2 / 2 * 0.04 / 0.7,
        2: GAIN * (1.5**3 / 6 * 0.008 + 1.5**2 / 2 * 0.04) / 0.7,
    }
    for order, floor in floors.items():
        above = [found.at(f"order_{order}", "ultimate_bound", rho=r) - floor for r in (20, 40)]
        assert 0 < above[1] < 0.55 * above[0] < 0.02 * floor


def test_radius_of_the_proof_by_hand_grows_with_the_gain() -> None:
    """S_1 has the eigenvalues 1 and 4 +- sqrt(15), as x^3 - 9 x^2 + 9 x - 1 has."""
    low, high = 4 - np.sqrt(15), 4 + np.sqrt(15)
    nu = GAIN * (0.04 + 0.75 * 0.008 + 0.045 * 0.04)
    driven = GAIN * (1.5**3 / 6 * 0.008), 0.45 * 0.2  # the remainder, and tau'
    found, radii = numbers(), []
    for rho in (1600, 3200, 6400):
        decay = rho * low - 2 * high * (np.hypot(G_OVER_L / rho, A) + nu / 0.7)
        push = GAIN * 1.5**2 / 2 * 0.04 / rho + sum(driven)
        radii.append(rho**2 / 0.7 * 2 * high**2 / low * push / decay)
        assert found.at("order_2", "proof_radius", rho=rho) == pytest.approx(radii[-1], rel=1e-3)
    assert radii == sorted(radii)


def test_function_of_lyapunov_grows_where_the_projection_holds_the_delay() -> None:
    """At (-1, 1, 0.1) by hand; no state has more than the largest eigenvalue with a zero row."""
    S = np.array([[1, -1, 1], [-1, 2, -3], [1, -3, 6.0]])
    free = np.eye(3, k=1) - np.outer([3, 3, 1], [1, 0, 0])
    assert S @ free + free.T @ S == pytest.approx(-S - np.outer([1, 0, 0], [1, 0, 0]))
    held = free * [[1], [1], [0]]
    e = np.array([-1, 1, 0.1])
    assert (free @ e)[2] > 0
    assert 2 * e @ S @ held @ e == pytest.approx(1.54)
    most = eigh(S @ held + held.T @ S, S, eigvals_only=True)[-1]
    found = numbers()["projection", "lyapunov_rate"]
    assert 0.99 * 1.54 / (e @ S @ e) < found <= most


# --- Derivatives --------------------------------------------------------------------------------


def test_differentiator_errors_agree_with_its_unit_tests() -> None:
    """There the errors are 0.1166 T^2 and 0.0842 T."""
    found, size, period = numbers(), 0.2 / np.sqrt(2), 2.5e-3
    expected = (0.1166 * period**2 / size, 0.0842 * period / (0.2 * size))
    for i, share in enumerate(expected, start=1):
        assert found["levant", f"relative_rms_error_{i}"] == pytest.approx(share, rel=0.05)
    assert found["levant", "bound_share"] == pytest.approx(0.008 / 0.11)


def test_errors_of_derivatives_grow_with_powers_of_the_noise_below_one() -> None:
    """Levant's Theorem 6: to the powers 2/3 and 1/3 at most, so less than in proportion."""
    for i in (1, 2):
        found = numbers()["levant", f"noise_exponent_{i}"]
        assert found == pytest.approx((3 - i) / 3, abs=0.06)


# --- Runs ---------------------------------------------------------------------------------------


def test_wrong_derivatives_scale_the_delay_on_a_ramp() -> None:
    """tau^ u'(1 + e) = tau u' in steady state; the first delay is 0.6 s."""
    built = observer(Case("ramp", 5.0, 2), 5e-3)
    y, u = record("ramp", 5e-3, 19.0)
    for share in (0.01, 0.03, 0.1):
        wrong = np.ascontiguousarray(u * [1, 1 + share, 1 + share])
        run = run_on_halves(built, y, wrong, start=built.init([0.0, 0.0], delay=0.3))
        assert run["delay"][-1] == pytest.approx(0.6 / (1 + share), rel=1e-7)


def test_runs_at_the_rho_of_the_figures_reproduce_the_figures() -> None:
    fig1 = lookup(Evaluator(fixed_parameters("delay")).figure("fig1").numbers)
    found = numbers().at("order2", "delay_radius", rho=5)
    assert found == pytest.approx(fig1["order2", "delay_radius"], rel=1e-6)


def test_singular_peaks_grow_without_switching_off() -> None:
    """For m = 1, where the expansion is wrong at xi = 0; hardly for m = 2."""
    found = numbers()
    ratio = [
        found[f"order_{order}", "peak_delay_error_small_threshold"]
        / found[f"order_{order}", "peak_delay_error"]
        for order in (1, 2)
    ]
    assert ratio[0] > 1.5
    assert ratio[1] == pytest.approx(1, abs=0.05)


@pytest.mark.parametrize("step", [2.5e-3, 5e-3])
def test_law_for_m_2_without_threshold_has_no_solution_past_zero_xi(step: float) -> None:
    """tau^' = -rho^3 e / xi moves xi itself: (xi^2)' = -G u'' rho^3 e and terms that go with xi.

    Where u'' e > 0 both signs of xi lead to zero in finite time, and (9) has no solution after it.
    """
    case = Case("sine", 2.5, 2, dynamic=True)
    run = observed(case, step, 10.0)
    assert run.diverged_at == pytest.approx(8.53, abs=0.05)
    time = step * np.arange(len(run))
    second = -0.04 * np.sin(0.2 * time)
    xi = GAIN * (-0.2 * np.cos(0.2 * time) + 0.5 * second * run["delay"])
    error = run["state"][:, 0] - record("sine", step, 10.0)[0][::2][: len(time)]
    third = -0.008 * np.cos(0.2 * time)
    slope = -GAIN * second * 2.5**3 * error + 2 * xi * GAIN * (0.5 * third * run["delay"] - second)
    before = slice(round(8.3 / step), round(8.48 / step))
    assert np.gradient(xi**2, step)[before] == pytest.approx(slope[before], rel=0.01)
    assert np.all(xi[before] < 0)
    assert np.all(slope[before] < 0)
    assert np.all(second[before] * error[before] > 0)
    kept = observed(Case("sine", 2.5, 2, 0.05, dynamic=True), step, 10.0)
    assert kept.diverged_at is None


def test_constant_mean_delay_errs_by_its_distance() -> None:
    """Squares over 5 to 120 s: 0.2, 0.4 and 0.5 s off, then half of 0.45 s squared and the rest."""
    swing = quad(lambda t: (0.45 * np.sin(0.2 * t)) ** 2, 60, 120)[0]
    expected = np.sqrt((15 * 0.04 + 20 * 0.16 + 20 * 0.25 + swing) / 115)
    assert numbers()["mean_delay", "rms_delay_error"] == pytest.approx(expected, rel=1e-4)
    found = numbers()["mean_delay", "varying_rms_delay_error"]
    assert found == pytest.approx(np.sqrt(swing / 60), rel=1e-3)
    largest = numbers()["mean_delay", "varying_largest_delay_error"]
    assert largest == pytest.approx(0.45, abs=1e-6)


def test_runs_reaching_a_bound_converge() -> None:
    """Over the 20 s before the first jump with the slow pole of Fig. 1, -1.28: by e^-25."""
    found = numbers()
    assert 0 < found["projection", "late_delay_error"] <= found["starts", "late_delay_error"] < 1e-9
    assert found["starts", "late_rate_error"] < 1e-9
    assert found["starts", "spread_on_the_sine"] < 1e-9
    # Of the starts themselves, from 0 to 1.5 s with the delay at 0.6 s.
    assert 0.8 < found["guess", "late_delay_error"] <= 0.9
    assert found["guess", "spread_on_the_sine"] > 1.2


def test_faster_input_with_a_factor_of_one_changes_nothing() -> None:
    same = evaluated({"theory": {"faster": 1.0}})
    for rho in (2.5, 5):
        for accuracy in ("absolute", "relative"):
            name = "rms_delay_error_faster"
            assert same.at("order_2", name, accuracy=accuracy, rho=rho) == 1


def test_shorter_delay_has_smaller_absolute_and_larger_relative_error() -> None:
    """The lag is proportional to the rate, so half the delay has half the lag, the same relative
    lag.

    There are twice as many singular instants, which add to both.
    """
    name = "rms_delay_error_faster"
    for rho in (2.5, 5):
        assert 0.5 < numbers().at("order_2", name, accuracy="absolute", rho=rho) < 0.75
        assert 1.1 < numbers().at("order_2", name, accuracy="relative", rho=rho) < 1.4


def test_constant_estimate_errs_in_proportion_to_the_delay() -> None:
    """So its error halves with the delay, and neither measure shows that it is no estimate."""
    for rho in (2.5, 5):
        for accuracy, ratio in (("absolute", 0.5), ("relative", 1.0)):
            found = numbers().at("mean_delay", "rms_delay_error_faster", accuracy=accuracy, rho=rho)
            assert found == pytest.approx(ratio, rel=1e-9)
        assert numbers().at("mean_delay", "share_of_constant_faster", rho=rho) == 1.0
        assert numbers().at("order_2", "share_of_constant_faster", rho=rho) < 0.6


def test_errors_of_derivatives_agree_with_runs_by_hand() -> None:
    """u = sin 0.2 t and noise of 5 %, held for 10 ms, over the second half of 120 s."""
    T, rate = 2.5e-3, 0.2
    time = T * np.arange(48_001)
    truth = np.column_stack([rate**i * np.sin(rate * time + i * np.pi / 2) for i in range(4)])
    late = time >= 60.0
    noise = 0.05 * random_stream(0, "delay", "theory", "derivatives").standard_normal(12_001)
    noisy = truth[:, 0] + np.repeat(noise, 4)[: len(time)]
    for name, order, y in (("", 2, truth[:, 0]), ("_in_noise", 3, noisy)):
        lambdas = [3.0, 1.5, 1.0] if order == 2 else None
        law = LevantDifferentiator(L=0.11, order=order, lambdas=lambdas, sampling_period=T)
        run = law.run(y, start=law.init(np.zeros(order + 1)))["derivatives"]
        off = np.linalg.norm((run - truth[:, : order + 1])[late], axis=0)
        shares = off / np.linalg.norm(truth[late, : order + 1], axis=0)
        for i in range(1, order + 1):
            found = numbers()["levant", f"relative_rms_error_{i}{name}"]
            assert found == pytest.approx(shares[i], rel=1e-3), (name, i)


def test_each_higher_derivative_has_more_noise_error() -> None:
    shares = [numbers()["levant", f"relative_rms_error_{i}_in_noise"] for i in (1, 2, 3)]
    assert np.all(np.diff(shares) > 0)
    quiet = evaluated({"theory": {"noise_share": 0.0}})
    third = quiet["levant", "relative_rms_error_3_in_noise"]
    assert third < 0.1 * shares[2]


def test_constant_gain_function_reproduces_the_library_observer() -> None:
    """From the true state, so that the delay stays off its bounds, which only the library
    enforces."""
    parameters = fixed_parameters("delay")
    job = read_job(keys.Parameters, parameters.settings("theory"))
    start = [*job.theory.initial_state, 0.3]
    found = theory_state_gain.simulate(job, 0.0, start, 0.6, 10.0)
    built = observer(Case("ramp", 5.0, 1), 5e-3)
    y, u = record("ramp", 5e-3, 10.0)
    begin = built.init(start[:2], delay=0.3)
    run = run_on_halves(built, y, np.ascontiguousarray(u[:, :2]), start=begin)
    assert found[:, 4] == pytest.approx(run["delay"][::2], abs=1e-5)
    assert found[:, 2:4] == pytest.approx(run["state"][::2], abs=1e-5)


def test_gain_oscillating_with_the_rate_still_converges() -> None:
    for share in (0.2, 0.9):
        found = evaluated({"theory": {"gain_of_rate": share}})
        assert 0 < found["state_gain", "late_delay_error"] < 1e-5
        assert found["state_gain", "late_rate_error"] < 1e-5


def test_constant_gain_function_reproduces_the_library_observer_on_the_sine() -> None:
    """Both switch the gain of the delay off, at instants that differ by less than a step."""
    job = read_job(keys.Parameters, fixed_parameters("delay").settings("theory"))
    found = theory_state_gain.simulate_on_sine(job, 0.0, [0.0, 0.0, 0.3], 5.0)
    sine = theory_runs.record(job, job.theory.sine)
    y, u = theory_orders.rows_of(job, sine, 2)
    built = theory_orders.built(job, 5.0, 2)
    run = run_on_halves(built, y, u, start=built.init([0.0, 0.0], delay=0.3))
    late = round(60 / job.theory.sampling_period)
    theirs = run["delay"][:: round(job.theory.sampling_period / built.sampling_period)]
    off = found[late:, 4] - theirs[late:]
    assert np.sqrt(np.mean(off**2)) < 2e-3


def test_two_orders_on_the_sine_agree_with_the_study() -> None:
    study = Numbers(golden_metrics("delay", "fig2_tradeoff"))
    for rho in (2.5, 5, 10, 20):
        found = numbers().at("order_2", "varying_rms_delay_error", rho=rho)
        expected = study.at("order2_noise", "varying_rms_delay_error", rho=rho)
        assert found == pytest.approx(expected, rel=0.01)  # with half its step
        third = numbers().at("order_3", "varying_rms_delay_error", rho=rho)
        assert third == pytest.approx(found, rel=0.03)


def test_radius_of_the_first_order_tends_to_the_error_of_the_expansion() -> None:
    """Where u(t - tau) = u - tau^ u', for the delays and times at which the error is taken."""
    time = np.arange(80.0, 120.0, 1e-3)
    singular = np.pi / 0.4 + np.pi / 0.2 * np.arange(8)
    away = np.abs(time[:, np.newaxis] - singular).min(axis=1) >= 4.0
    delay = 0.8 + 0.45 * np.sin(0.2 * time)
    found = (np.sin(0.2 * time) - np.sin(0.2 * (time - delay))) / (0.2 * np.cos(0.2 * time))
    error = np.abs(found - delay)[away].max()
    radii = [numbers().at("order_1", "radius_away", rho=rho) for rho in (2.5, 5, 10, 20, 40)]
    assert radii[-1] == pytest.approx(error, rel=0.02)
    assert radii == sorted(radii, reverse=True)


def test_rate_of_xi_grows_with_the_gain_if_the_estimate_is_part_of_it() -> None:
    """For m = 1 it is G |u''|; for m = 2 a jump by 0.9 s at 40 s moves it, with poles -rho."""
    for rho in (20, 40):
        assert numbers().at("order_1", "rate_of_xi", rho=rho) == pytest.approx(GAIN * 0.04)
        moved = 0.9 * rho * 2 * np.exp(-2)
        expected = GAIN * 0.04 * np.sin(8.0) * (1 + moved / 2)
        assert numbers().at("order_2", "rate_of_xi", rho=rho) == pytest.approx(expected, rel=0.12)


def test_observer_without_threshold_agrees_with_the_library_on_a_ramp() -> None:
    """There xi is constant, and nothing is switched off."""
    ramp = [
        {"kind": "constant", "axis": 1, "from": -1.5, "size": -0.15},
        {"kind": "ramp", "axis": 1, "from": -1.5, "slope": 0.1},
    ]
    parameters = fixed_parameters(
        "delay",
        {"scenarios": {"lag": {"input": ramp}}, "observers": {"extended_lag": {"threshold": 0.0}}},
    )
    evaluator = Evaluator(parameters)
    plant = evaluator.result("plant", "lag")
    name = next(step for step in reads(parameters, "metrics", "fig3") if "extended_lag" in step)
    expected = evaluator.result(*name)
    job = read_job(keys.Parameters, parameters.settings("metrics", "fig3"))
    found = without_threshold.estimate(job, job.observers["extended_lag"], plant)
    away = np.abs(found["delay"] - expected["delay"])
    assert away[expected.time > 5].max() < 1e-6


def test_guess_keeps_its_delay_and_passes_the_measurement_through() -> None:
    fig1 = lookup(Evaluator(fixed_parameters("delay")).figure("fig1").numbers)
    squares = quad(lambda t: (0.5 + 0.45 * np.sin(0.2 * t)) ** 2, 60, 120)[0]
    found = fig1["guess", "varying_rms_delay_error"]
    assert found == pytest.approx(np.sqrt(squares / 60), rel=1e-3)
    assert fig1["guess", "varying_rms_error_1"] == 0
    assert fig1["guess", "varying_largest_delay_error"] == pytest.approx(0.95, abs=1e-6)
