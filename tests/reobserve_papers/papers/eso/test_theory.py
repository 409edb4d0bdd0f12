"""Numbers of the theory stage against closed forms, independent computations, and bounds of
claims."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are, solve_continuous_lyapunov

from reobserve.core.documents import read_yaml
from reobserve.core.errors import InputError
from reobserve.observers.extended_state import ExtendedStateObserver
from reobserve.synthesis.extended_state import pd_pi, pi
from reobserve.synthesis.extended_state.certificate import error_system
from reobserve.synthesis.extended_state.gamma_bound import gamma_lower_bound
from reobserve.synthesis.extended_state.inequality import PdPiVariables
from reobserve.synthesis.extended_state.system import AugmentedSystem, Gains
from reobserve.synthesis.h_infinity_norm import h_infinity_norm
from reobserve_papers.metrics.metrics import Numbers, lookup
from reobserve_papers.papers.eso import keys
from reobserve_papers.papers.eso import plant as plant_stage
from reobserve_papers.papers.eso.design import design, stored_design
from reobserve_papers.papers.eso.observe import run_on
from reobserve_papers.papers.eso.random_gains import Drawn, random_gains
from reobserve_papers.papers.eso.theory_observers import (
    Observers,
    held,
    left_of_jumps,
    missed,
    norms,
)
from reobserve_papers.parameters.job import read_job
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.signals.inputs import Signal
from reobserve_papers.steps.compute import compute_design
from reobserve_papers.steps.evaluation import Evaluator
from tests import ROOT
from tests.published_numbers import golden_metrics
from tests.reobserve.synthesis.plants import dc_motor
from tests.reobserve_papers.papers import fixed_parameters

SEED = read_yaml(ROOT / "config" / "config.yaml")["seed"]
DESIGNS = {
    "pi": "pi_feasible", "pd_pi": "pd_pi", "minimum_gamma": "minimum_gamma",
    "pi_optimal": "pi_optimal",
}  # fmt: skip
OBSERVERS = tuple(DESIGNS)
UNITS = {"actuator": "V", "sensor": "rad/s"}


@cache
def evaluator() -> Evaluator:
    return Evaluator(fixed_parameters("eso", seed=SEED))


@cache
def numbers() -> dict[tuple[str, str], float]:
    return lookup(evaluator().theory())


def typed(stated: dict[str, Any]) -> keys.Job:
    return read_job(keys.Parameters, stated)


def settings(**changed: Any) -> dict[str, Any]:
    found = evaluator().parameters.settings("theory")
    return {**found, "theory": {**found["theory"], **changed}}


@cache
def designs() -> dict[str, Any]:
    return {name: compute_design(evaluator().parameters, name) for name in DESIGNS.values()}


def gains_of(observer: str) -> Gains:
    body = designs()[DESIGNS[observer]]
    return Gains(np.array(body["L"]), np.array(body["Ld"]))


# --- The motor, its outputs and its control ------------------------------------------------------


def test_slowest_motor_pole_agrees_with_closed_form_for_both_signs() -> None:
    # s^2 + 12 s + 20 +- 0.02
    for name, sign in (("motor", -1), ("motor_as_printed", 1)):
        expected = 6 - np.sqrt(16 + sign * 0.02)
        assert numbers()[name, "slowest_pole"] == pytest.approx(expected, rel=1e-12)
        assert numbers()[name, "unobservable_states"] == 0


def test_rosenbrock_rank_reveals_what_observability_does_not() -> None:
    for name, missing in (("two_outputs", 0), ("one_output", 1)):
        assert numbers()[name, "rosenbrock_rank_deficiency"] == missing
    assert numbers()["motor", "unobservable_states"] == 0
    # A sensor fault that looks like an actuator fault, though (A, C) is observable.
    # Exactly: fa = 10.01 holds x at (1, 10), and fs (1, 10) takes both outputs back to zero.
    A = [[Fraction(-10), Fraction(1)], [Fraction(-2, 100), Fraction(-2)]]
    x, fa = [Fraction(1), Fraction(10)], Fraction(1001, 100)
    for row, entry in zip(A, (0, 2), strict=True):
        assert row[0] * x[0] + row[1] * x[1] + entry * fa == 0
    with pytest.raises(InputError, match=r"a zero at the origin: .* rank 3 of 4"):
        dc_motor(Fs=[[-0.1], [-1.0]])
    with pytest.raises(InputError, match="fewer outputs than faults"):
        dc_motor(C=[[1.0, 0.0]], Dw=[[1.0]], Fs=[[1.0]])


def test_step_response_agrees_with_closed_form() -> None:
    """The loop has no zero: the speed is the sum of the residues of its poles -3 +- 2.25j and
    -12."""
    poles = np.array([-3 + 2.25j, -3 - 2.25j, -12])
    others = [np.delete(poles, k) for k in range(3)]
    weights = [np.prod(rest) / np.prod(p - rest) for p, rest in zip(poles, others, strict=True)]
    time = np.linspace(0, 10, 200_001)
    speed = 1 - (np.exp(np.outer(time, poles)) @ np.array(weights)).real
    assert speed[0] == pytest.approx(0.0, abs=1e-12)
    late = time[np.flatnonzero(np.abs(speed - 1) > 0.02)[-1]]
    assert numbers()["controller", "overshoot"] == pytest.approx(speed.max() - 1, abs=1e-6)
    assert numbers()["controller", "settling_time"] == pytest.approx(late, abs=2e-3)


# --- Lower bounds --------------------------------------------------------------------------------


@pytest.mark.parametrize("rate", [0.5, 1.0, 10.0, 50.0])
def test_minimum_gamma_agrees_with_closed_form_for_any_filter(rate: float) -> None:
    """Errors of speed, fa and fs under constant d1, d2 and w."""
    errors = np.array([[0.1, 0, 0], [0.001, -1, 0], [-0.1, 0, -1]])
    assert gamma_lower_bound(dc_motor(Az=rate)) == pytest.approx(
        np.linalg.norm(errors, 2), rel=1e-12
    )


@pytest.mark.parametrize("observer", OBSERVERS)
def test_bound_of_gamma_is_the_gain_at_rest_from_disturbances_and_noise(observer: str) -> None:
    (Ao, Eo), system = error_system(dc_motor(), gains_of(observer)), dc_motor()

    def response(frequency: float) -> Any:
        return np.linalg.solve(1j * frequency * Eo - Ao, system.Bo)

    at_rest = np.linalg.norm(response(0.0)[:, :3], 2)
    assert at_rest == pytest.approx(gamma_lower_bound(system), rel=1e-9)
    assert np.linalg.norm(response(1e6), 2) < 1e-4  # also from the rates of fast faults


# --- Norms by input and output --------------------------------------------------------------------


def swept(system: AugmentedSystem, gains: Gains, inputs: list[int], outputs: list[int]) -> float:
    """The largest gain on a grid of frequencies, refined around its maximum."""
    Ao, Eo = error_system(system, gains)

    def gain(logarithm: float) -> float:
        errors = np.linalg.solve(1j * 10.0**logarithm * Eo - Ao, system.Bo)
        return float(np.linalg.norm(errors[np.ix_(outputs, inputs)], 2))

    poles = np.linalg.eigvals(np.linalg.solve(Eo, Ao)).imag
    grid = [*np.linspace(-6.0, 5.0, 221), *np.log10(poles[poles > 0])]
    for width in (0.05, 2.5e-4, 1.25e-6):  # a resonance is narrow
        best = max(grid, key=gain)
        grid = [best, *np.linspace(best - width, best + width, 201)]
    return max(gain(-9.0), *map(gain, grid))


@pytest.mark.parametrize("observer", ["pi", "pd_pi", "random"])
def test_norms_by_input_and_output_agree_with_a_sweep_of_frequencies(observer: str) -> None:
    gains = random_gains(dc_motor())[0] if observer == "random" else gains_of(observer)
    found = lookup(norms({observer: (dc_motor(), Drawn(gains))}))
    for source, inputs in (("disturbances", 2), ("noise_too", 3), ("all", 5)):
        for to, outputs in (("errors", range(6)), ("faults", (4, 5))):
            norm = found.at(observer, "norm", **{"from": source, "to": to})
            largest = swept(dc_motor(), gains, list(range(inputs)), list(outputs))
            assert norm == pytest.approx(largest, rel=1e-6)
    if observer != "random":
        assert norm < found[observer, "norm from=all to=errors"]
        assert numbers()[observer, "norm"] == pytest.approx(
            found[observer, "norm from=all to=errors"], rel=1e-8
        )


def test_no_norm_from_disturbances_is_below_that_at_rest() -> None:
    at_rest = np.linalg.norm([[0.1, 0], [0.001, -1], [-0.1, 0]], 2)
    assert at_rest == pytest.approx(1.0000005, abs=1e-7)
    ways = {name: numbers()[name, "norm from=disturbances to=errors"] for name in OBSERVERS}
    assert min(ways.values()) == pytest.approx(at_rest, rel=1e-8)
    assert min(ways.values()) > 1.0
    assert ways["pi"] > 1.19


# --- The unit of the current ----------------------------------------------------------------------


def in_milliamperes(rate: float = 1.0) -> AugmentedSystem:
    """The motor with current and its disturbance in mA and mA/s."""
    B = [[0.0], [2000.0]]
    return dc_motor(A=[[-10.0, 1e-3], [-20.0, -2.0]], B=B, Fa=B, Az=rate)


@pytest.mark.parametrize("solution", ["minimum_norm", "positive", "largest_margin"])
def test_solutions_with_currents_in_milliamperes_solve_the_inequality_in_amperes(
    solution: Any,
) -> None:
    body = keys.Feasible("pi_feasible", 10.0, 2.0, solution, "CLARABEL")
    plant, here = typed(settings()).plant, dc_motor(Az=10.0)
    same = pi.design_feasible(here, 2.0, solution=solution).gains.L
    np.testing.assert_array_equal(design(plant, body).gains.L, same)
    found, there = design(plant, replace(body, current_unit="mA")), in_milliamperes(10.0)
    Ao, _ = error_system(here, found.gains)
    P1 = solve_continuous_lyapunov((Ao + 2.0 * np.eye(6)).T, -np.eye(6))
    assert np.linalg.eigvalsh(P1)[0] > 0  # a solution with these gains, and Y = L^T P1
    # The observer is that in mA: faults of both have the same units.
    other = Drawn(pi.design_feasible(there, 2.0, solution=solution).gains)
    both = {"A": (here, found), "mA": (there, other)}
    errors = lookup(missed(both, 1.93))
    for fault in UNITS:
        name = f"missed_fast_{fault}_fault lag=counted"
        assert errors["A", name] == pytest.approx(errors["mA", name], rel=1e-6)


def test_solution_in_milliamperes_without_a_certificate_in_amperes_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    refuted = SimpleNamespace(holds=False, reason="the pole -0.9 is not left of -1")
    monkeypatch.setattr("reobserve_papers.papers.eso.design.certify", lambda *_, **__: refuted)
    body = keys.Feasible("pi_feasible", 1.5, 1.0, "minimum_norm", "CLARABEL", "mA")
    with pytest.raises(InputError, match=r"^current_unit: mA: the pole -0.9 is not left of -1$"):
        design(typed(settings()).plant, body)


def test_observers_in_milliamperes_miss_what_the_parameter_file_says() -> None:
    body = keys.Feasible("pi_feasible", 1.0, 1.0, "minimum_norm", "CLARABEL", "mA")
    found = design(typed(settings()).plant, body)
    assert found.certificate.norm_upper == pytest.approx(13.3, abs=0.05)
    observers = {
        "pi": (dc_motor(), found),
        "pd_pi": (in_milliamperes(), pd_pi.design(in_milliamperes(), 1.05)),
    }
    errors = lookup(missed(observers, 1.93))
    for observer, shares in (("pi", (0.058, 1.21)), ("pd_pi", (0.045, 0.52))):
        for fault, share in zip(UNITS, shares, strict=True):
            name = f"missed_fast_{fault}_fault lag=counted"
            assert errors[observer, name] == pytest.approx(share, abs=0.005)
    in_amperes = numbers()["pd_pi", "missed_fast_actuator_fault lag=counted"]
    assert in_amperes == pytest.approx(0.63, abs=0.005)


# --- Lemma 1 ----------------------------------------------------------------------------


def margin_above_norm(system: AugmentedSystem, gains: Gains, norm: float, excess: float) -> float:
    """How far below zero (19) is at a gamma just above the norm of given gains; 0 if nowhere.

    With S = Eo^T and M = Ao^T it is P2 = S^-1 M P1 and P3 = S^-1 / gamma, and P1 solves the Riccati
    equation of S^-1 M P1 + P1 M^T S^-T + (P1 Bo Bo^T P1 + S^-1 S^-T) / gamma < 0, with slack.
    """
    gamma = (1.0 + excess) * norm
    Ao, Eo = error_system(system, gains)
    inverse = np.linalg.inv(Eo)
    source = (1.0 + excess) * inverse.T @ inverse / gamma
    try:
        P1 = solve_continuous_are(Ao @ inverse, system.Bo, source, -gamma * np.eye(5))
    except np.linalg.LinAlgError:
        return 0.0
    P1, empty = (P1 + P1.T) / 2.0, np.zeros((2, 6))
    variables = PdPiVariables(P1, (Ao @ inverse).T @ P1, inverse.T / gamma, empty, empty)
    side: Any = np.block(variables.with_gains(gains).blocks(system, gamma))
    largest = max(np.linalg.eigvalsh(side)[-1], -np.linalg.eigvalsh(P1)[0])
    return max(0.0, -float(largest))


@pytest.mark.parametrize("observer", OBSERVERS)
def test_lemma_has_a_solution_only_above_the_norm(observer: str) -> None:
    system, gains = dc_motor(), gains_of(observer)
    Ao, Eo = error_system(system, gains)
    norm = h_infinity_norm(Ao, system.Bo, np.eye(6), E=Eo)
    assert numbers()[observer, "norm"] == pytest.approx(norm.upper, rel=1e-9)
    assert margin_above_norm(system, gains, norm.upper, 1e-4) > 0
    assert margin_above_norm(system, gains, 0.99 * norm.lower, 1e-3) == 0


def test_certificate_numbers_agree_with_the_designs() -> None:
    for observer in OBSERVERS:
        body = designs()[DESIGNS[observer]]
        Ao, Eo = error_system(dc_motor(), gains_of(observer))
        poles = np.linalg.eigvals(np.linalg.solve(Eo, Ao))
        assert numbers()[observer, "slowest_pole"] == pytest.approx(-poles.real.max(), rel=1e-9)
        assert np.linalg.matrix_rank(Eo) == len(body["certificate"]["poles"]) == 6
        assert numbers()[observer, "impulsive_modes"] == 0.0
    assert np.isnan(numbers()["pi", "gamma"])
    assert numbers()["minimum_gamma", "gamma"] == pytest.approx(1.00534017676, abs=1e-10)
    for observer in ("pd_pi", "pi_optimal"):
        assert numbers()[observer, "gamma"] == pytest.approx(1.05 * 1.00503781018428, rel=1e-12)
        assert numbers()[observer, "norm"] < numbers()[observer, "gamma"]


# --- Estimates -----------------------------------------------------------------------------------


@pytest.mark.parametrize("observer", ["pi", "pd_pi"])
@pytest.mark.parametrize("fault", UNITS)
def test_error_under_a_sine_agrees_with_simulation(observer: str, fault: str) -> None:
    stated, none = settings(), [{"kind": "constant", "axis": 1, "size": 0.0}]
    frequency = stated["theory"]["fast_frequency"]
    sine = [{"kind": "sine", "axis": 1, "amplitude": 1.0, "frequency": frequency}]
    scenario = {"actuator_fault": none, "sensor_fault": none, "noise_power": 0.0,
                "disturbance": [[0, 0], [0, 0]]}  # fmt: skip
    scenario[f"{fault}_fault"] = sine
    record = plant_stage.simulate(
        typed({"plant": stated["plant"], "scenario": scenario, "seed": 0})
    )
    estimator = ExtendedStateObserver(dc_motor(), gains=gains_of(observer), sampling_period=1e-3)
    found = run_on(estimator, record)[f"{fault}_fault"][:, 0]
    # A sine with free phase fitted to the errors of the last seconds.
    time = record.time[::2][-8001:]
    error = (found - record[f"{fault}_fault"][::2])[-8001:]
    waves = np.column_stack([np.sin(frequency * time), np.cos(frequency * time)])
    amplitude = np.linalg.norm(np.linalg.lstsq(waves, error)[0])
    missing = f"missed_fast_{fault}_fault"
    counted = numbers()[observer, f"{missing} lag=counted"]
    assert counted == pytest.approx(amplitude, rel=1e-4)
    # Without the lag only the amplitudes differ.
    size = np.linalg.norm(np.linalg.lstsq(waves, found[-8001:])[0])
    removed = numbers()[observer, f"{missing} lag=removed"]
    assert removed == pytest.approx(abs(1.0 - size), rel=1e-4)


@pytest.mark.parametrize("observer", ["pd_pi", "minimum_gamma"])
@pytest.mark.parametrize("fault", UNITS)
def test_error_under_a_sine_grows_with_frequency_up_to_all_of_it(observer: str, fault: str) -> None:
    """So the sine at `fast_frequency` bounds all slower ones in the claim on any waveform."""
    share = [
        lookup(missed(of_one(observer), frequency))[
            observer, f"missed_fast_{fault}_fault lag=counted"
        ]
        for frequency in (*np.linspace(0.05, 3.24, 30), 1e7)
    ]
    assert share[:-1] == sorted(share[:-1])
    assert share[-1] == pytest.approx(1.0, abs=1e-3)


def test_motor_response_to_fast_sines_agrees_with_the_stated_reasons() -> None:
    """Voltage to speed, relative to the static gain: -3 dB, one half and 14 %."""
    model = dc_motor()

    def gain(frequency: float) -> float:
        return float(np.abs(np.linalg.solve(1j * frequency * np.eye(2) - model.A, model.B)[0, 0]))

    for frequency, share in ((1.93, np.sqrt(0.5)), (3.24, 0.5), (10.0, 0.14)):
        assert gain(frequency) / gain(0.0) == pytest.approx(share, abs=2e-3)
    stated = Parameters.load(ROOT, "eso").tree["theory"]["fast_frequency"]
    assert (stated["value"], stated["range"]) == (1.93, [1.57, 3.24])


def test_faster_state_alone_delays_the_fault_estimates() -> None:
    """With Lf kept, by the phases of the estimates at the frequencies of the paper's faults."""
    system, slow = dc_motor(), gains_of("pi")
    fast = slow.L.copy()
    fast[2:4] += np.eye(2)
    lags, poles = [], []
    for L in (slow.L, fast):
        Ao, _ = error_system(system, Gains(L, np.zeros((6, 2))))
        assert np.linalg.eigvals(Ao).real.max() < 0
        poles.append(-np.linalg.eigvals(system.Aa - L[:4] @ system.C_tilde[:, :4]).real.max())
        for row, w in ((-2, np.pi / 4), (-1, np.pi / 2)):
            error = 1j * w * np.linalg.solve(1j * w * np.eye(6) - Ao, system.Bo)[row, row]
            lags.append(-np.angle(1 - error) / w)
    assert poles[1] > 1.2 * poles[0]
    assert lags[2] > 1.1 * lags[0]
    assert lags[3] > lags[1]


@pytest.mark.parametrize("observer", ["pi", "pd_pi"])
@pytest.mark.parametrize("fault", UNITS)
def test_error_after_a_jump_agrees_with_simulation(observer: str, fault: str) -> None:
    jump, none = ([{"kind": "constant", "axis": 1, "size": size}] for size in (1.0, 0.0))
    faults = {f"{name}_fault": jump if name == fault else none for name in UNITS}
    quiet = {"noise_power": 0.0, "disturbance": [[0, 0], [0, 0]]}
    record = plant_stage.simulate(
        typed({"plant": settings()["plant"], "scenario": {**faults, **quiet}, "seed": 0})
    )
    estimator = ExtendedStateObserver(dc_motor(), gains=gains_of(observer), sampling_period=1e-3)
    run = run_on(estimator, record, [0.0] * 6)
    error = np.abs(run[f"{fault}_fault"][:, 0] - 1.0)[record.time[::2] > 2.0 - 1e-9]
    assert numbers()[observer, f"left_of_{fault}_jump"] == pytest.approx(error.max(), rel=1e-4)
    late = lookup(left_of_jumps(of_one(observer), 2.5))[observer, f"left_of_{fault}_jump"]
    assert late <= numbers()[observer, f"left_of_{fault}_jump"]


def of_one(observer: str) -> Observers:
    plant = typed(settings()).plant
    return {observer: stored_design(plant, designs()[DESIGNS[observer]])}


@pytest.mark.parametrize("observer", OBSERVERS)
def test_long_hold_equals_a_constant(observer: str) -> None:
    rules = typed(settings()).theory
    found = lookup(held(of_one(observer), rules, 50.0, 0.1))
    for source in ("speed", "current"):
        share = found[observer, f"{source}_disturbance_left at=ends"]
        assert share == pytest.approx(1.0, abs=1e-9)
    assert found[observer, "noise_in_sensor_fault at=ends"] == pytest.approx(0.1, rel=1e-9)
    assert found[observer, "noise_in_actuator_fault at=ends"] < 1e-9


def test_deviations_agree_with_the_study() -> None:
    """d is uniform: both disturbances together, and the noise."""
    sizes = np.array([0.4, 0.2]) / np.sqrt(12)
    study = Numbers(golden_metrics("eso", "fig3_designs"))
    for observer, kind, at in (
        ("pi", "pi_feasible", {"rate": 1, "decay": 1}),
        ("pd_pi", "pd_pi_minimum_norm", {"rate": 1, "factor": 1.05}),
    ):
        for fault in UNITS:
            noise = study.at(kind, f"noise_in_{fault}_fault", **at)
            found = numbers()[observer, f"noise_in_{fault}_fault at=ends"]
            assert found == pytest.approx(noise, rel=1e-3)
            caused = study.at(kind, f"disturbance_in_{fault}_fault", **at)
            found = numbers()[observer, f"disturbance_in_{fault}_fault at=ends"]
            assert found == pytest.approx(caused, rel=1e-3)
        # The other disturbance has a small share in each fault.
        for fault, source, size in (
            ("actuator", "current", sizes[1]), ("sensor", "speed", 0.1 * sizes[0])
        ):  # fmt: skip
            both = numbers()[observer, f"disturbance_in_{fault}_fault at=ends"]
            alone = numbers()[observer, f"{source}_disturbance_left at=ends"] * size
            assert 0.99 * both < alone <= both
    assert numbers()["noise", "deviation"] == pytest.approx(np.sqrt(1e-3), rel=1e-14)


# --- Observers that know nothing ------------------------------------------------------------------


def test_random_gains_are_stable_and_have_every_sign_and_size() -> None:
    system = dc_motor()
    found = random_gains(system)
    assert len(found) == 5
    sizes = np.abs([gains.L for gains in found])
    assert sizes.min() < 1.0
    assert 100.0 < sizes.max() <= 1000.0
    for gains in found:
        assert np.linalg.eigvals(system.A_tilde - gains.L @ system.C_tilde).real.max() < 0
        assert not gains.Ld.any()
        assert (gains.L < 0).any()


def test_median_over_observers_with_random_gains_is_one_of_them() -> None:
    observers = {f"{k}": (dc_motor(), Drawn(one)) for k, one in enumerate(random_gains(dc_motor()))}
    frequency = settings()["theory"]["fast_frequency"]
    each = lookup([*missed(observers, frequency), *norms(observers)])
    for metric in ("norm from=all to=errors", "missed_fast_sensor_fault lag=counted"):
        assert numbers()["random", metric] == np.median([each[name, metric] for name in observers])


def test_constant_estimate_misses_all_of_a_sine_with_and_without_its_lag() -> None:
    """By gains of zero, which the formula allows: f^ stays where it is."""
    nothing = Gains(np.zeros((6, 2)), np.zeros((6, 2)))
    found = lookup(missed({"nothing": (dc_motor(), Drawn(nothing))}, 1.93))
    for fault in UNITS:
        for lag in ("counted", "removed"):
            share = found["nothing", f"missed_fast_{fault}_fault lag={lag}"]
            assert share == pytest.approx(1.0, rel=1e-12)


# --- Bounds of claims ----------------------------------------------------------------------------


def test_errors_are_relative_to_the_faults_and_visible_ones_to_their_constants() -> None:
    scenario = evaluator().parameters.section("scenarios", "noisy")
    rules = evaluator().parameters.section("metrics")
    found = lookup(evaluator().figure("fig5").numbers)
    for fault in UNITS:
        first, last = rules[f"{fault}_varying"]
        values = Signal.parse(fault, scenario[f"{fault}_fault"], 1)(np.arange(first, last, 1e-3))
        size = np.sqrt(np.mean(values**2))
        assert found["plant", f"rms_{fault}_fault_varying"] == pytest.approx(size, rel=1e-3)
        assert scenario[f"{fault}_fault"][-1]["size"] == 0.2
    assert rules["visible"] == pytest.approx(0.01 * 0.2)
    bounds = read_yaml(ROOT / "config/claims/eso.yaml")["claims"]["noise_not_in_actuator_fault"]
    assert bounds["checks"][0]["below"] == rules["visible"]
