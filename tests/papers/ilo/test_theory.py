"""The theory stage against closed forms, brute force and other ways to the same numbers."""

from __future__ import annotations

import copy
import itertools
from typing import Any

import numpy as np
import pytest

from reobserve.papers.ilo import (
    keys,
    theory,
    theory_cost,
    theory_limits,
    theory_runs,
)
from reobserve.papers.ilo.reading import LEARNING, READINGS
from reobserve.papers.ilo.scoring import Errors
from reobserve.papers.ilo.theory_bench import Bench
from reobserve.replication.metrics.metrics import Numbers, lookup
from reobserve.replication.parameters.job import read_job
from reobserve.replication.parameters.ledger import Ledger
from reobserve.synthesis.ilo_accuracy import error_transfer
from reobserve.synthesis.ilo_error_system import LearningLaw as Law
from tests.papers import ROOT
from tests.papers.ilo.limits import scalar_sampled_limit

INERTIA = np.array([[36, 1.5, 0], [1.5, 17, 0], [0, 0, 26.0]])
MOMENTS = 26.5 + np.array([-1, 1]) * np.sqrt(9.5**2 + 1.5**2)  # by hand: least and greatest


def limits(settings: dict[str, Any]) -> Numbers:
    return lookup(theory_limits.measure(read_job(keys.Ledger, settings)))


def runs(settings: dict[str, Any]) -> Numbers:
    return lookup(theory_runs.measure(Bench.of(read_job(keys.Ledger, settings))))


def test_numbers_do_not_depend_on_what_was_asked_before(
    settings: dict[str, Any], found: Numbers
) -> None:
    other = copy.deepcopy(settings)
    other["plant"]["fault_matrix"] = 0.7
    theory.measure(other, {})
    again = lookup(theory.measure(settings, {}))
    assert {k: repr(v) for k, v in again.items()} == {k: repr(v) for k, v in found.items()}


def test_lemma_1_is_neither_violated_nor_far_from_it(found: Numbers) -> None:
    assert found["lemma_1", "violations"] == 0
    assert found["lemma_1", "violations_without_mismatch"] == 0
    assert 1 <= found["lemma_1", "closest_ratio"] < 1.1


def test_torque_difference_grows_at_half_the_spread_of_the_moments(
    settings: dict[str, Any], found: Numbers
) -> None:
    # |x x J x| over unit vectors is at most (J_max - J_min) / 2; the rest is linear.
    slope = np.ptp(MOMENTS) / 2
    ratio = found.at("assumption_2", "torque_ratio", size=100)
    assert ratio == pytest.approx(100 * slope, rel=0.01)
    rate = float(np.linalg.norm(settings["plant"]["initial_rate"]))
    assert found["assumption_2", "one_sided_constant"] == pytest.approx(slope * rate)


def test_what_theorem_1_certifies(found: Numbers) -> None:
    assert found["theorem_1", "least_constant_error"] == pytest.approx(0.5, abs=1e-9)
    assert 1 < found["theorem_1", "least_promised_error"] < 1.01
    assert found["theorem_1", "unstable_share"] == 0
    assert np.isnan(found["theorem_1", "required_damping_at_identity"])
    assert found["theorem_1", "bound_18_ratio"] > 1
    # 2 lambda (1 - k1^2) = k1^2 + 2 k2 + k2^2
    needed = (0.81 + 4000 + 4e6) / (2 * 0.19)
    assert found["forgetting", "required_damping"] == pytest.approx(needed)
    for name in ("sampled", "continuous", "forgetting"):
        assert found[name, "certified"] == 0


def test_the_floor_of_certified_designs_does_not_depend_on_the_fault_matrix(
    settings: dict[str, Any],
) -> None:
    scaled = copy.deepcopy(settings)
    scaled["plant"]["fault_matrix"] = 0.6
    numbers = lookup(theory.measure(scaled, {}))
    assert numbers["theorem_1", "least_constant_error"] == pytest.approx(0.5, abs=1e-9)


def test_a_certified_observer_is_called_so(settings: dict[str, Any]) -> None:
    small = copy.deepcopy(settings)
    small["observers"]["forgetting"] |= {"K1": 0.5, "K2": 0.5}  # 1.5 lambda > 1.5
    for damping, expected in ((1.01, 1.0), (0.99, 0.0)):
        small["observers"]["forgetting"]["damping"] = damping
        numbers = lookup(theory._certificates(read_job(keys.Ledger, small)))
        assert numbers["forgetting", "certified"] == expected


@pytest.mark.parametrize("multiple", [1, 2, 5, 10])
def test_gain_margin_against_the_scalar_limit(found: Numbers, multiple: int) -> None:
    limit = scalar_sampled_limit(float(MOMENTS[0]), 20000.0, 1.0, multiple * 0.001)
    assert found.at("sampled", "gain_margin", multiple=multiple) == pytest.approx(limit / 5000)


def test_the_sampled_gains_follow_their_rule(settings: dict[str, Any], found: Numbers) -> None:
    # z^2 - (1 + a - K2 (1 - a) / Lambda) z + a = 0 on principal axes, a = exp(-Lambda tau / J).
    def slowest(K2: float, damping: float, interval: float) -> float:
        a = np.exp(-damping * interval / np.array([*MOMENTS, 26.0]))
        trace = 1 + a - K2 * (1 - a) / damping
        root = np.sqrt((trace**2 - 4 * a).astype(complex))
        factor = np.abs([trace + root, trace - root]).max() / 2
        return float(-np.log(factor) / interval)

    keys = ("K2", "damping", "update_interval")
    mine = settings["observers"]["sampled"]
    assert found["sampled", "slowest_decay"] == pytest.approx(slowest(*map(mine.get, keys)))
    # The defaults themselves are chosen by the rule.
    defaults = Ledger.load(ROOT, "ilo").tree["observers"]["sampled"]
    chosen = slowest(*(defaults[key]["value"] for key in keys))
    ranges = [defaults[key]["range"] for key in keys]
    for gains in itertools.product(*(np.geomspace(*one, 25) for one in ranges)):
        assert slowest(*gains) <= chosen * (1 + 1e-9)
    # J s^2 + Lambda s + K2 / tau = 0 on the heaviest axis, but for the hold of a millisecond.
    ratio = 20000 / (2 * np.sqrt(MOMENTS[1] * 5e6))
    assert found["sampled", "damping_ratio"] == pytest.approx(ratio, rel=0.01)


def test_noise_gain_against_a_long_run(settings: dict[str, Any]) -> None:
    # A body of equal moments, so that axes do not couple: w' = -(lambda (w + n) + v) / j.
    scalar = copy.deepcopy(settings)
    j, lam, k2, tau = 20.0, 400.0, 1500.0, 0.01
    scalar["plant"]["inertia"] = np.diag([j] * 3).tolist()
    scalar["observers"]["sampled"] |= {"damping": lam, "K2": k2, "update_interval": tau}
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


def test_an_unstable_multiple_has_no_noise_gain(settings: dict[str, Any]) -> None:
    wild = copy.deepcopy(settings)
    wild["observers"]["sampled"] |= {"damping": 100.0, "update_interval": 0.01, "K2": 5000.0}
    numbers = limits(wild)
    assert numbers.at("sampled", "gain_margin", multiple=10) < 1
    assert np.isnan(numbers.at("sampled", "noise_gain", multiple=10))
    assert numbers.at("sampled", "gain_margin", multiple=1) > 1


def test_growth_and_decay_in_closed_form(found: Numbers) -> None:
    assert found.at("continuous", "growth_rate", K1=1.05) == pytest.approx(np.log(1.05) / 0.01)
    assert found["continuous", "unstable_roots"] == found["forgetting", "unstable_roots"] == 0
    assert found["continuous", "worst_round_gain"] == pytest.approx(1)
    assert found["forgetting", "worst_round_gain"] == pytest.approx(0.9)
    # j s^2 + 100 s + 100 = 0 on each principal axis.
    roots = [np.roots([j, 100.0, 100.0]).real.max() for j in (*MOMENTS, 26.0)]
    assert found["adaptive", "decay_rate_at_rest"] == pytest.approx(-max(roots))


def test_accuracy_follows_the_interval(found: Numbers) -> None:
    # For a small interval e = s tau (J s + Lambda) / K2 u_f.
    response = 10 * np.linalg.norm((10j * INERTIA + 100 * np.eye(3))[0, 0]) / 2000
    error = found.at("continuous", "sine_error", interval=0.001)
    assert error == pytest.approx(0.001 * response, rel=0.01)
    assert found["continuous", "sine_error_slope"] == pytest.approx(1, abs=0.02)
    for omega in (3.0, 10.0, 30.0):
        longest = found.at("continuous", "largest_interval", frequency=omega)
        law = (INERTIA, 100.0, 1.0, 1.0, 2000.0, longest)
        assert abs(error_transfer(omega, Law(*law))[0, 0, 0]) == pytest.approx(0.05, rel=1e-6)


def test_a_fault_that_every_interval_follows_is_limited_by_its_period(
    settings: dict[str, Any],
) -> None:
    slow = copy.deepcopy(settings)
    slow["theory"]["frequencies"] = [0.1]  # 2 |3.6 j + 100| / 5000 is below 5 %
    slow["observers"]["continuous"]["K2"] = 5000.0
    longest = limits(slow).at("continuous", "largest_interval", frequency=0.1)
    assert longest == pytest.approx(np.pi / 0.1)


def test_the_integrator_is_near_by_the_square_of_the_phase(found: Numbers) -> None:
    # 1 / (1 - exp(-x)) = 1 / x + 1 / 2 + x / 12: relative to the error this is (omega tau)^2 / 12.
    # Without the half it is omega tau / 2. A v that is held lags by that half again, and little
    # more than omega tau = 0.01 is left; K1 below I is no integrator.
    distance = found["continuous", "distance_from_matched"]
    assert distance == pytest.approx(0.1**2 / 12, rel=0.05)
    assert found["continuous", "distance_from_integrator"] == pytest.approx(0.1 / 2, rel=0.05)
    assert found["sampled", "distance_from_integrator"] < 0.015
    assert found["forgetting", "distance_from_integrator"] > 0.5


def test_a_wrong_start_stays_only_with_identity_learning(found: Numbers) -> None:
    # The first rate error jumps into v as K2 w~(0) = (100, -60, 80) N m, and K1^k of it remains:
    # one limit of a jump of 100 is 50 or more.
    assert found["continuous", "residual_after_other_start"] > 50
    assert found["forgetting", "residual_after_other_start"] < 1e-9
    # Of the sampled reading the step of the method is left, at Lambda / J of 1200 1/s.
    assert found["sampled", "residual_after_other_start"] < 1e-7
    assert found["sampled", "late_relative_error_after_other_start"] < 1e-8
    # Lambda (1 - K1) / (Lambda (1 - K1) + K2), but for the coupling of the axes.
    floor = found["forgetting", "late_relative_error_after_other_start"]
    assert floor == pytest.approx(1 / 2001, rel=0.05)


def test_a_right_start_leaves_no_residual(changed: dict[str, Any]) -> None:
    changed["theory"]["start_rate"] = changed["plant"]["initial_rate"]
    numbers = runs(changed)
    assert numbers["continuous", "residual_after_other_start"] < 1e-9


def test_slowing_down_is_harmless_up_to_the_limit_of_stability(changed: dict[str, Any]) -> None:
    # At tau = 0.01 s and Lambda = 1000 the limit of K2 is 2 Lambda / tanh(Lambda tau / 2 J_min).
    assert 2000 / np.tanh(10 / (2 * MOMENTS[0])) == pytest.approx(6949, abs=1)
    changed["observers"]["sampled"]["damping"] = 1000.0
    for K2, stable in ((6500.0, True), (7500.0, False)):
        changed["observers"]["sampled"]["K2"] = K2
        numbers = runs(changed)
        margin = limits(changed).at("sampled", "gain_margin", multiple=10)
        assert (margin > 1) == stable
        error = numbers.at("sampled", "relative_error", slowdown=10)
        assert (error < 1e-6) == stable, error


def test_only_the_repaired_function_falls(found: Numbers) -> None:
    assert found["lyapunov_repaired", "rising_share"] == 0
    assert -1 < found["lyapunov_repaired", "largest_rise"] < 0
    assert found["lyapunov_13", "rising_share"] > 0
    assert found["lyapunov_13", "largest_rise"] > 0


def test_a_disturbance_shows_whole_at_the_rounds_of_identity_learning(
    settings: dict[str, Any],
) -> None:
    quick = copy.deepcopy(settings)
    quick["plant"]["inertia"] = np.diag([20.0] * 3).tolist()
    omega = 2 * np.pi * 100 / 0.01  # so high that 2000 / (20 omega) is little
    quick["theory"]["disturbance_frequency"] = omega
    numbers = limits(quick)
    assert numbers["continuous", "disturbance_gain"] == pytest.approx(1.0, abs=0.05)
    assert numbers["forgetting", "disturbance_gain"] == pytest.approx(0.014, abs=0.002)


def test_what_every_reading_has_is_had_by_the_one_that_is_named(
    settings: dict[str, Any], found: Numbers
) -> None:
    other = copy.deepcopy(settings)
    other["metrics"]["reading"] = "forgetting"
    again = lookup(theory.measure(other, {}))
    names = {metric for observer, metric in found if observer == LEARNING}
    assert "relative_error_under_noise" in names
    assert "slowest_decay" not in names  # only v that is held has so few poles
    for metric in names:
        assert repr(found[LEARNING, metric]) == repr(found["sampled", metric])
        assert repr(again[LEARNING, metric]) == repr(again["forgetting", metric])


def test_operations_counted_by_hand(settings: dict[str, Any]) -> None:
    def counted(**given: Any) -> dict[str, float]:
        mine = copy.deepcopy(settings)
        mine["theory"] |= given
        numbers = lookup(theory_cost.measure(read_job(keys.Ledger, mine)))
        return {name: numbers[name, "operations"] for name in (*READINGS, "adaptive")}

    # Three axes: a product and a sum, and with K1 = 0.9 a product more.
    euler = {"sampled": 6, "continuous": 6, "forgetting": 9, "adaptive": 6}
    assert counted(integration="euler") == euler
    assert counted(integration="euler", periods_per_update=2) == euler | {"sampled": 3}
    # Four slopes, three times z + h l, then l2 + l3, twice that, two sums, h / 6 and z + it.
    kutta = {"sampled": 6, "continuous": 24, "forgetting": 33, "adaptive": 3 * (4 + 6 + 6)}
    assert counted() == kutta


def test_a_window_begins_with_its_first_instant_and_ends_before_its_last() -> None:
    time = np.arange(5) * 0.1
    errors = Errors(time, time + 1, time + 2, time + 3, time + 4)
    window = errors.window(0.1, 0.3)
    assert window.time.tolist() == time[1:3].tolist()
    assert window.start.tolist() == (time + 1)[1:3].tolist()
    assert window.fault_end.tolist() == (time + 4)[1:3].tolist()
    assert errors.window(0.1).time.tolist() == time[1:].tolist()
