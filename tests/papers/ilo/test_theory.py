"""The theory stage against closed forms, brute force and other ways to the same numbers."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reobserve.ledger.ledger import Ledger
from reobserve.ledger.types import read_job
from reobserve.papers.ilo import keys, theory, theory_limits, theory_runs
from reobserve.papers.ilo.observe import estimate
from reobserve.papers.ilo.plant import simulate
from reobserve.papers.ilo.scoring import Errors
from reobserve.scoring.metrics import Numbers, lookup
from reobserve.synthesis.ilo_accuracy import error_transfer
from reobserve.synthesis.ilo_error_system import LearningLaw as Law
from reobserve.synthesis.ilo_sampled_stability import scalar_sampled_limit

INERTIA = np.array([[36, 1.5, 0], [1.5, 17, 0], [0, 0, 26.0]])
MOMENTS = 26.5 + np.array([-1, 1]) * np.sqrt(9.5**2 + 1.5**2)  # by hand: least and greatest


@pytest.fixture(scope="module")
def settings() -> dict[str, Any]:
    ledger = Ledger.load(Path(__file__).parents[3], "ilo")
    return copy.deepcopy(ledger.settings("theory"))


@pytest.fixture(scope="module")
def found(settings: dict[str, Any]) -> Numbers:
    return lookup(theory.measure(settings, {}))


def limits(settings: dict[str, Any]) -> Numbers:
    return lookup(theory_limits.measure(read_job(keys.Ledger, settings)))


def runs(settings: dict[str, Any]) -> Numbers:
    return lookup(theory_runs.measure(read_job(keys.Ledger, settings)))


@pytest.fixture
def changed(settings: dict[str, Any]) -> dict[str, Any]:
    """A copy that a test may change, with a run of 4 s to keep it short."""
    mine = copy.deepcopy(settings)
    mine["plant"]["horizon"] = 4.0
    mine["theory"]["stuck"][0]["from"] = 2.0
    return mine


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
    limit = scalar_sampled_limit(float(MOMENTS[0]), 1000.0, 1.0, multiple * 0.001)
    assert found.at("sampled", "gain_margin", multiple=multiple) == pytest.approx(limit / 2000)


def test_noise_gain_against_a_long_run(settings: dict[str, Any]) -> None:
    # A body of equal moments, so that axes do not couple: w' = -(lambda w + v) / j, exactly.
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
        w = decay * w - (1 - decay) / lam * v
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
    distance = found["continuous", "distance_from_integrator"]
    assert distance == pytest.approx(0.1**2 / 12, rel=0.05)


def test_a_wrong_start_stays_only_with_identity_learning(found: Numbers) -> None:
    # The first rate error jumps into v as K2 w~(0) = (100, -60, 80) N m, and K1^k of it remains:
    # one limit of a jump of 100 is 50 or more.
    assert found["continuous", "residual_after_other_start"] > 50
    assert found["forgetting", "residual_after_other_start"] < 1e-9
    assert found["sampled", "residual_after_other_start"] < 1e-9
    assert found["sampled", "late_relative_error_after_other_start"] < 1e-9
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


def test_error_under_jumps_is_a_sum_of_step_responses(
    settings: dict[str, Any], found: Numbers
) -> None:
    # The error after a jump is its size times that after a unit step, long over before the next.
    observer = settings["observers"]["sampled"]
    plant = settings["plant"] | {"horizon": 3.0}
    step = {"kind": "constant", "axis": 1, "from": 1.0, "size": 1.0}
    record = simulate({"plant": plant, "scenario": {"fault": [step]}, "seed": 0})
    run = estimate({"plant": plant, "observer": observer}, record)
    after = Errors.of(record, run, 0).window(1.0, 1.5)
    energy = float(np.sum(after.start**2 + after.start * after.end + after.end**2)) / 3 * run.step
    terms = theory_runs._jumps(keys.Theory(**settings["theory"]), 10.0, 1)
    assert [term["from"] for term in terms] == pytest.approx(0.5 * np.arange(1, 20))
    assert all(term["until"] == term["from"] + 0.5 for term in terms)
    sizes = np.array([term["size"] for term in terms])
    # Scores start a second after the first jump, which is the third one.
    jumps, held = np.diff(sizes)[1:], sizes[2:]
    expected = np.sqrt(np.sum(jumps**2) * energy / (0.5 * np.sum(held**2)))
    assert found["sampled", "relative_error_under_jumps"] == pytest.approx(expected, rel=0.01)


def test_the_rate_is_known_as_well_as_the_fault_lets_it(found: Numbers) -> None:
    for name in ("sampled", "continuous", "forgetting"):
        assert 0 < found[name, "relative_rate_error_under_jumps"] < 1e-3


def test_rates_under_jumps_are_scored_from_the_first_row_of_the_window_on(
    settings: dict[str, Any], found: Numbers
) -> None:
    """A second after the first jump at 0.5 s, that instant included."""
    plant = settings["plant"] | {"noise": 0.0}
    fault = theory_runs._jumps(keys.Theory(**settings["theory"]), plant["horizon"], 1)
    record = simulate({"plant": plant, "scenario": {"fault": fault}, "seed": 0})
    for name in ("sampled", "continuous", "forgetting"):
        run = estimate({"plant": plant, "observer": settings["observers"][name]}, record)
        first = round(1.5 / run.step)
        assert run.time[first] == pytest.approx(1.5, rel=1e-12)
        true = record["rate"][:: round(run.step / record.step)][first:]
        ratio = np.sqrt(np.sum((true - run["rate"][first:]) ** 2) / np.sum(true**2))
        expected = found[name, "relative_rate_error_under_jumps"]
        assert ratio == pytest.approx(expected, rel=1e-12), name


def test_a_window_begins_with_its_first_instant_and_ends_before_its_last() -> None:
    time = np.arange(5) * 0.1
    errors = Errors(time, time + 1, time + 2, time + 3, time + 4)
    window = errors.window(0.1, 0.3)
    assert window.time.tolist() == time[1:3].tolist()
    assert window.start.tolist() == (time + 1)[1:3].tolist()
    assert window.fault_end.tolist() == (time + 4)[1:3].tolist()
    assert errors.window(0.1).time.tolist() == time[1:].tolist()
