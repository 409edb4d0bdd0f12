"""The theory stage against closed forms, brute force and independent computations."""

from __future__ import annotations

import copy
import itertools
from typing import Any

import numpy as np
import pytest

from reobserve.synthesis.ilo_accuracy import error_transfer
from reobserve.synthesis.ilo_error_system import LearningLaw as Law
from reobserve.synthesis.ilo_sampled_stability import sampled_stability
from reobserve_papers.metrics.metrics import Numbers, lookup
from reobserve_papers.papers.ilo import keys, theory, theory_linear
from reobserve_papers.papers.ilo.metrics import LEARNING
from reobserve_papers.papers.ilo.scoring import NORMS, Errors
from reobserve_papers.parameters.parameters import Parameters
from tests.reobserve_papers.papers import ROOT
from tests.reobserve_papers.papers.ilo.conftest import INERTIA, MOMENTS, Measure, typed


def limits(settings: dict[str, Any], variant: str = "sampled") -> Numbers:
    mine = copy.deepcopy(settings)
    mine["metrics"]["variant"] = variant
    return lookup(theory_linear.measure(typed(mine)))


def scalar_limit(observer_gain: float, K1: float, interval: float) -> float:
    """The largest stable scalar K2 [N m s] of the sampled-and-held observer with B_f = I.

    k2 < (1 + a)(1 + k1) lambda / (1 - a), a = exp(-lambda tau / j), where an eigenvalue passes -1;
    the lightest axis decides.
    """
    return (1 + K1) * observer_gain / float(np.tanh(observer_gain * interval / (2 * MOMENTS[0])))


def test_numbers_do_not_depend_on_earlier_calls(settings: dict[str, Any], found: Numbers) -> None:
    other = copy.deepcopy(settings)
    other["plant"]["fault_matrix"] = 0.6
    numbers = lookup(theory.measure(typed(other), {}))
    # The lower bound of certified designs is the same with any B_f that is a multiple of I.
    assert numbers["theorem_1", "minimum_constant_error"] == pytest.approx(0.5, abs=1e-9)
    assert numbers["theorem_1", "unstable_share"] == 0
    again = lookup(theory.measure(typed(settings), {}))
    assert {k: repr(v) for k, v in again.items()} == {k: repr(v) for k, v in found.items()}


def test_designs_certified_by_theorem_1(found: Numbers) -> None:
    assert found["lemma_1", "violations"] == 0
    assert found["lemma_1", "violations_without_mismatch"] == 0
    assert found["theorem_1", "minimum_constant_error"] == pytest.approx(0.5, abs=1e-9)
    assert found["theorem_1", "unstable_share"] == 0
    assert np.isnan(found["theorem_1", "required_observer_gain_at_identity"])
    assert found["theorem_1", "bound_18_ratio"] > 1


@pytest.mark.parametrize("multiple", [1, 2, 5, 10])
def test_gain_margin_agrees_with_the_scalar_limit(
    settings: dict[str, Any], found: Numbers, multiple: int
) -> None:
    mine = settings["observers"]["sampled"]
    limit = scalar_limit(mine["observer_gain"], mine["K1"], multiple * mine["update_interval"])
    margin = found.at("sampled", "gain_margin", multiple=multiple)
    assert margin == pytest.approx(limit / mine["K2"])


def test_sampled_gains_follow_their_rule() -> None:
    # z^2 - (1 + a - K2 (1 - a) / Lambda) z + a = 0 on principal axes, a = exp(-Lambda tau / J).
    def slowest(K2: float, observer_gain: float, interval: float) -> float:
        a = np.exp(-observer_gain * interval / np.array([*MOMENTS, 26.0]))
        trace = 1 + a - K2 * (1 - a) / observer_gain
        root = np.sqrt((trace**2 - 4 * a).astype(complex))
        factor = np.abs([trace + root, trace - root]).max() / 2
        return float(-np.log(factor) / interval)

    defaults = Parameters.load(ROOT, "ilo").tree["observers"]["sampled"]
    entries = [defaults[key] for key in ("K2", "observer_gain", "update_interval")]
    K2, observer_gain, interval = values = [entry["value"] for entry in entries]
    chosen = slowest(*values)
    law = Law(INERTIA, observer_gain, 1.0, 1.0, K2, interval)
    assert -np.log(sampled_stability(law).spectral_radius) / interval == pytest.approx(chosen)
    for gains in itertools.product(*(np.geomspace(*entry["range"], 25) for entry in entries)):
        assert slowest(*gains) <= chosen * (1 + 1e-9)
    assert (
        chosen
        == pytest.approx(slowest(4160, observer_gain, interval))
        == pytest.approx(277, abs=0.5)
    )
    assert slowest(4150, observer_gain, interval) < chosen * (1 - 1e-4)


def test_noise_gain_agrees_with_a_long_run(settings: dict[str, Any]) -> None:
    # A body with equal moments, so that axes decouple: w' = -(lambda (w + n) + v) / j.
    scalar = copy.deepcopy(settings)
    j, lam, k2, tau = 20.0, 400.0, 1500.0, 0.01
    scalar["plant"]["inertia"] = np.diag([j] * 3).tolist()
    scalar["observers"]["sampled"] |= {"observer_gain": lam, "K2": k2, "update_interval": tau}
    scalar["theory"]["multiples"] = [1]
    noise = np.random.default_rng(5).standard_normal(200_000)
    decay = np.exp(-lam * tau / j)
    w, v, seen = 0.0, 0.0, []
    for n in noise:
        v += k2 * (w + n)
        seen.append(v)
        w = decay * w - (1 - decay) * (v / lam + n)
    gain = limits(scalar).at("sampled", "noise_gain", multiple=1)
    assert gain == pytest.approx(np.std(seen), rel=0.01)


def test_unstable_multiple_has_no_noise_gain(settings: dict[str, Any]) -> None:
    wild = copy.deepcopy(settings)
    wild["observers"]["sampled"] |= {"observer_gain": 100.0, "update_interval": 0.01, "K2": 5000.0}
    numbers = limits(wild)
    assert numbers.at("sampled", "gain_margin", multiple=10) < 1
    assert np.isnan(numbers.at("sampled", "noise_gain", multiple=10))
    assert numbers.at("sampled", "gain_margin", multiple=1) > 1


def test_errors_grow_with_unstable_gains(settings: dict[str, Any]) -> None:
    """The constructor refuses such gains; the number shows why."""
    wild = copy.deepcopy(settings)
    for factor, stable in ((0.99, True), (1.01, False)):
        mine = {"observer_gain": 100.0, "update_interval": 0.05}
        mine["K2"] = factor * scalar_limit(mine["observer_gain"], 1.0, mine["update_interval"])
        wild["observers"]["sampled"] |= mine
        assert (limits(wild)[LEARNING, "worst_round_gain"] < 1) == stable
    for name in ("continuous", "forgetting"):
        gain = limits(settings, name)[LEARNING, "worst_round_gain"]
        assert gain == pytest.approx(settings["observers"][name]["K1"])


def test_no_error_bound_exists_with_a_factor_of_one() -> None:
    # J s + Lambda + K2 / (1 - exp(-s tau)) is smallest just above omega = 2 pi n / tau, where the
    # phase of exp(-s tau) is -K2 / (J omega), and E = J omega / (Lambda + K2 / 2).
    J, observer_gain, K2, interval = 20.0, 100.0, 2000.0, 0.01

    def largest(K1: float, rounds: int) -> float:
        omega = 2 * np.pi * rounds / interval
        near = omega + K2 / (J * omega * interval) * np.linspace(0.9, 1.1, 20001)
        law = Law(J * np.eye(3), observer_gain, 1.0, K1, K2, interval)
        return float(np.abs(error_transfer(near, law)[:, 0, 0]).max())

    for rounds in (10, 100, 1000):
        expected = J * 2 * np.pi * rounds / interval / (observer_gain + K2 / 2)
        assert largest(1.0, rounds) == pytest.approx(expected, rel=0.05)
        # Below one a bound exists, since the real part of the denominator is above 1 - K1.
        assert largest(0.9, rounds) < (1 + 0.9) / (1 - 0.9)


def test_error_scales_with_the_interval(settings: dict[str, Any], found: Numbers) -> None:
    # For a small interval e = s tau (J s + Lambda) / K2 u_f.
    mine = settings["observers"]["continuous"]
    response = np.linalg.norm((10j * INERTIA + mine["observer_gain"] * np.eye(3))[0, 0])
    error = found.at("continuous", "sine_error", interval=0.001)
    assert error == pytest.approx(0.001 * 10 * response / mine["K2"], rel=0.01)
    for omega in (3.0, 10.0, 30.0):
        longest = found.at("continuous", "largest_interval", frequency=omega)
        law = (INERTIA, mine["observer_gain"], 1.0, 1.0, mine["K2"], longest)
        assert abs(error_transfer(omega, Law(*law))[0, 0, 0]) == pytest.approx(0.05, rel=1e-6)


def test_largest_interval_is_limited_by_the_period_of_the_fault(
    settings: dict[str, Any],
) -> None:
    slow = copy.deepcopy(settings)
    slow["theory"]["frequencies"] = [0.1]  # 2 |3.6 j + 100| / 5000 is below 5 %
    slow["observers"]["continuous"]["K2"] = 5000.0
    longest = limits(slow).at("continuous", "largest_interval", frequency=0.1)
    assert longest == pytest.approx(np.pi / 0.1)


def test_difference_to_the_integrator_is_quadratic_in_the_phase(settings: dict[str, Any]) -> None:
    # 1 / (1 - exp(-x)) = 1 / x + 1 / 2 + x / 12: relative to the error the difference to a
    # proportional-integral observer is (omega tau)^2 / 12. A held v lags by half a step more, and
    # without the proportional part little more than omega tau = 0.01 remains; K1 below I does not
    # integrate.
    distance = {
        name: limits(settings, name)[LEARNING, "distance_from_integrator"] for name in keys.VARIANTS
    }
    phase = settings["theory"]["frequency"] * settings["observers"]["continuous"]["update_interval"]
    assert distance["continuous"] == pytest.approx(phase**2 / 12, rel=0.05)
    assert distance["sampled"] < 0.015
    assert distance["forgetting"] > 0.5


def test_disturbance_at_the_update_frequency_appears_as_its_mean(
    settings: dict[str, Any],
) -> None:
    # Updates see a sine at a multiple of 2 pi / tau as a constant, and with K1 = I v compensates
    # the rest: w of j w' = -lambda w + sin(omega t) against v / lambda.
    quick = copy.deepcopy(settings)
    quick["plant"]["inertia"] = np.diag([20.0] * 3).tolist()
    mine = quick["observers"]["sampled"]
    omega = 2 * np.pi / mine["update_interval"]
    quick["theory"]["disturbance_frequency"] = omega
    shown = limits(quick)["sampled", "disturbance_gain"]
    assert shown == pytest.approx(
        mine["observer_gain"] / abs(20j * omega + mine["observer_gain"]), rel=0.01
    )


def test_wrong_initial_state_persists_only_with_identity_learning(measure: Measure) -> None:
    # The first rate error enters v as K2 w~(0) = (100, -60, 80) N m, and K1^k of it remains:
    # one limit of a jump of 100 is 50 or more.
    found = {
        name: measure("_other_start", {"metrics": {"variant": name}}) for name in keys.VARIANTS
    }
    residual = {name: one[LEARNING, "residual_after_other_start"] for name, one in found.items()}
    assert residual["continuous"] > 50
    assert residual["forgetting"] < 1e-9
    # For the sampled variant the step of the method remains, at Lambda / J of 1200 1/s.
    assert residual["sampled"] < 1e-7
    assert found["sampled"][LEARNING, "late_relative_error_after_other_start"] < 1e-8
    # Lambda (1 - K1) / (Lambda (1 - K1) + K2), but for the coupling of the axes.
    floor = found["forgetting"][LEARNING, "late_relative_error_after_other_start"]
    assert floor == pytest.approx(1 / 2001, rel=0.05)
    for name in ("sampled", "continuous"):
        late = measure("_from_other_start_with_identity", {"theory": {"identity_variant": name}})
        same = found[name][LEARNING, "late_relative_error_after_other_start"]
        assert late["identity", "late_relative_error_after_other_start"] == same


def test_correct_initial_state_leaves_no_residual(
    measure: Measure, changed: dict[str, Any]
) -> None:
    # The step of the method remains, at Lambda / J of up to 1200 1/s.
    start = {"start_rate": changed["plant"]["initial_rate"]}
    for name in keys.VARIANTS:
        over = {"metrics": {"variant": name}, "theory": start}
        numbers = measure("_other_start", over, changed)
        assert numbers[LEARNING, "residual_after_other_start"] < 1e-7


def test_slowdown_is_harmless_up_to_the_stability_limit(
    measure: Measure, changed: dict[str, Any]
) -> None:
    limit = scalar_limit(1000.0, 1.0, 0.01)  # of ten times the interval
    for factor, stable in ((0.94, True), (1.08, False)):
        mine = {"observer_gain": 1000.0, "K2": factor * limit}
        numbers = measure("_slower", {"observers": {"sampled": mine}}, changed)
        error = numbers.at("sampled", "relative_error", slowdown=10)
        assert (error < 1e-6) == stable, error


def test_operation_counts_agree_with_hand_counts(settings: dict[str, Any]) -> None:
    def counted(variant: str, **given: Any) -> tuple[float, float]:
        mine = copy.deepcopy(settings)
        mine["theory"] |= given
        mine["metrics"]["variant"] = variant
        numbers = lookup(theory.operations(typed(mine)))
        return numbers[LEARNING, "operations"], numbers["adaptive", "operations"]

    # Three axes: a product and a sum, and with K1 = 0.9 another product.
    euler = {"sampled": 6, "continuous": 6, "forgetting": 9}
    for name, count in euler.items():
        assert counted(name, integration="euler") == (count, 6)
    assert counted("sampled", integration="euler", periods_per_update=2) == (3, 6)
    # Four slopes, three times z + h l, then l2 + l3, twice that, two sums, h / 6 and z + it.
    for name, count in {"sampled": 6, "continuous": 24, "forgetting": 33}.items():
        assert counted(name) == (count, 3 * (4 + 6 + 6))


def test_norms_of_errors_agree_with_closed_forms() -> None:
    # A fault that is 2 for half of the time, then -1, and an estimate that is 1: e = 1, then -2.
    # From there the fault also runs from -1 to 1 in a step, where e runs from -2 to 0.
    fault_start, fault_end = np.array([2.0, -1.0, -1.0]), np.array([2.0, -1.0, 1.0])
    fault = Errors(np.arange(3.0), fault_start, fault_end, fault_start, fault_end)
    errors = fault.guessed(1.0)
    assert errors.relative("rms") == pytest.approx(np.sqrt((1 + 4 + 4 / 3) / (4 + 1 + 1 / 3)))
    assert errors.relative("absolute") == pytest.approx((1 + 2 + 1) / (2 + 1 + 1))
    assert errors.relative("largest") == 2 / 2
    assert errors.relative_root_mean_square == errors.relative("rms")
    assert fault.mean_fault == pytest.approx((2 - 1 + 0) / 3)
    for norm in NORMS:
        assert fault.guessed(0.0).relative(norm) == 1


def test_window_includes_its_start_and_excludes_its_end() -> None:
    time = np.arange(5) * 0.1
    errors = Errors(time, time + 1, time + 2, time + 3, time + 4)
    window = errors.window(0.1, 0.3)
    assert window.time.tolist() == time[1:3].tolist()
    assert window.start.tolist() == (time + 1)[1:3].tolist()
    assert window.fault_end.tolist() == (time + 4)[1:3].tolist()
    assert errors.window(0.1).time.tolist() == time[1:].tolist()


def test_rivals_of_learning_agree_with_scalar_transfers(settings: dict[str, Any]) -> None:
    # With equal moments axes decouple, and e / u_f = (j s + lambda) / (j s + lambda + k(s)) with
    # k = K2, Gamma / s, Gamma / s + K2 / 2 or K2 / (1 - exp(-s tau)); Gamma = K2 / tau.
    scalar = copy.deepcopy(settings)
    j, lam, k2, tau, zeta, s = 20.0, 100.0, 2000.0, 0.01, 0.8, 10j
    scalar["plant"]["inertia"] = np.diag([j] * 3).tolist()
    scalar["theory"]["damping_ratio"] = zeta
    scalar["observers"]["continuous"] |= {"observer_gain": lam, "K2": k2, "update_interval": tau}

    def error(gain: complex, damping: float = lam) -> float:
        return abs((j * s + damping) / (j * s + damping + gain))

    gamma = k2 / tau
    rivals = {
        "none": error(k2),
        "integrator": error(gamma / s, 2 * zeta * np.sqrt(gamma * j)),
        "proportional_integral": error(gamma / s + k2 / 2),
    }
    mine = error(k2 / (1 - np.exp(-s * tau)))
    found = limits(scalar, "continuous")
    for rival, size in rivals.items():
        assert found[LEARNING, f"sine_error_over rival={rival}"] == pytest.approx(mine / size)
        assert found["zero", f"sine_error_over rival={rival}"] == pytest.approx(1 / size)


def test_unstable_gains_estimate_no_sine(settings: dict[str, Any]) -> None:
    wild = copy.deepcopy(settings)
    for factor, stable in ((0.99, True), (1.01, False)):
        mine = {"observer_gain": 100.0, "update_interval": 0.05}
        mine["K2"] = factor * scalar_limit(mine["observer_gain"], 1.0, mine["update_interval"])
        wild["observers"]["sampled"] |= mine
        ratio = limits(wild)[LEARNING, "sine_error_over rival=none"]
        assert np.isfinite(ratio) == stable


def test_theorem_1_certifies_no_gains_of_the_figures(settings: dict[str, Any]) -> None:
    for name in keys.VARIANTS:
        assert limits(settings, name)[LEARNING, "certified"] == 0
    # 2 lambda (1 - k1^2) > k1^2 + 2 k2 + k2^2, for B_f = I
    small = copy.deepcopy(settings)
    for lam, certified in ((2.17, 1), (2.16, 0)):
        small["observers"]["forgetting"] |= {"K1": 0.5, "K2": 1.0, "observer_gain": lam}
        assert limits(small, "forgetting")[LEARNING, "certified"] == certified


def test_printed_proof_has_two_gaps(found: Numbers) -> None:
    # The torque is quadratic in the error, its component along the error linear.
    assert found["assumption_2", "growth_of_the_constant side=two"] == pytest.approx(10, rel=0.01)
    assert found["assumption_2", "growth_of_the_constant side=one"] == pytest.approx(1)
    assert found["theorem_1", "gaps"] == 2
