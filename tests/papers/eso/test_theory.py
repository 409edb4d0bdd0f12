"""Numbers of the theory stage against closed forms and second ways, and the bounds of claims."""

from __future__ import annotations

from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reobserve.core.documents import read_yaml
from reobserve.core.errors import InputError
from reobserve.observers.extended_state import ExtendedStateObserver
from reobserve.papers.eso import keys, theory
from reobserve.papers.eso import plant as plant_stage
from reobserve.papers.eso.observe import run_on
from reobserve.papers.eso.stored_design import stored_design
from reobserve.papers.eso.theory_inequality import agreement, margin_above_norm
from reobserve.papers.eso.theory_observers import (
    Observers,
    held,
    missed,
    records_of_two_controllers,
)
from reobserve.replication.evaluation import Evaluator
from reobserve.replication.metrics.metrics import Numbers, lookup
from reobserve.replication.parameters.job import read_job
from reobserve.replication.steps import compute_design
from reobserve.signals.inputs import Signal
from reobserve.synthesis.extended_state.certificate import error_system
from reobserve.synthesis.extended_state.inequality import PdPiVariables
from reobserve.synthesis.extended_state.system import Gains
from reobserve.synthesis.h_infinity_norm import h_infinity_norm
from tests.found import golden_metrics
from tests.papers import fixed_ledger
from tests.papers.eso.plants import dc_motor

ROOT = Path(__file__).parents[3]
SEED = read_yaml(ROOT / "config" / "config.yaml")["seed"]
DESIGNS = {
    "pi": "pi_feasible", "pd_pi": "pd_pi", "least_gamma": "least_gamma", "pi_optimal": "pi_optimal",
}  # fmt: skip
OBSERVERS = tuple(DESIGNS)
UNITS = {"actuator": "V", "sensor": "rad/s"}


@cache
def evaluator() -> Evaluator:
    return Evaluator(fixed_ledger("eso", seed=SEED))


@cache
def numbers() -> dict[tuple[str, str], float]:
    return lookup(evaluator().theory())


def settings(**changed: Any) -> dict[str, Any]:
    found = evaluator().ledger.settings("theory")
    return {**found, "theory": {**found["theory"], **changed}}


@cache
def designs() -> dict[str, Any]:
    return {name: compute_design(evaluator().ledger, name) for name in DESIGNS.values()}


def gains_of(observer: str) -> Gains:
    body = designs()[DESIGNS[observer]]
    return Gains(np.array(body["L"]), np.array(body["Ld"]))


# --- The motor, its outputs and its control ------------------------------------------------------


def test_the_slowest_pole_of_the_motor_with_both_signs() -> None:
    # s^2 + 12 s + 20 +- 0.02
    for name, sign in (("motor", -1), ("motor_as_printed", 1)):
        expected = 6 - np.sqrt(16 + sign * 0.02)
        assert numbers()[name, "slowest_pole"] == pytest.approx(expected, rel=1e-12)
        assert numbers()[name, "unobservable_states"] == 0


def test_ranks_tell_what_observability_does_not() -> None:
    for name, missing in (("two_outputs", 0), ("one_output", 1), ("look_alike", 1)):
        assert numbers()[name, "unobservable_states"] == 0
        assert numbers()[name, "undetermined_faults"] == missing
    # Exactly: fa = 10.01 holds x at (1, 10), and fs (1, 10) takes both outputs back to zero.
    A = [[Fraction(-10), Fraction(1)], [Fraction(-2, 100), Fraction(-2)]]
    x, fa = [Fraction(1), Fraction(10)], Fraction(1001, 100)
    for row, entry in zip(A, (0, 2), strict=True):
        assert row[0] * x[0] + row[1] * x[1] + entry * fa == 0
    with pytest.raises(InputError, match=r"a zero at the origin: .* rank 3 of 4"):
        dc_motor(Fs=[[-0.1], [-1.0]])
    with pytest.raises(InputError, match="fewer outputs than faults"):
        dc_motor(C=[[1.0, 0.0]], Dw=[[1.0]], Fs=[[1.0]])


def test_the_step_response_in_closed_form() -> None:
    """The loop has no zero: the speed is the sum of the residues of its poles -3 +- 2.25j, -12."""
    poles = np.array([-3 + 2.25j, -3 - 2.25j, -12])
    others = [np.delete(poles, k) for k in range(3)]
    weights = [np.prod(rest) / np.prod(p - rest) for p, rest in zip(poles, others, strict=True)]
    time = np.linspace(0, 10, 200_001)
    speed = 1 - (np.exp(np.outer(time, poles)) @ np.array(weights)).real
    assert speed[0] == pytest.approx(0.0, abs=1e-12)
    late = time[np.flatnonzero(np.abs(speed - 1) > 0.02)[-1]]
    assert numbers()["controller", "overshoot"] == pytest.approx(speed.max() - 1, abs=1e-6)
    assert numbers()["controller", "settling_time"] == pytest.approx(late, abs=2e-3)


# --- Floors --------------------------------------------------------------------------------------


def test_floors_in_closed_form() -> None:
    """Errors of speed, fa and fs by constant d1, d2 and w."""
    errors = np.array([[0.1, 0, 0], [0.001, -1, 0], [-0.1, 0, -1]])
    for name, columns in (("gamma_floor", 3), ("disturbance_floor", 2)):
        expected = np.linalg.norm(errors[:, :columns], 2)
        assert numbers()["any_observer", name] == pytest.approx(expected, rel=1e-13)
    assert numbers()["any_observer", "disturbance_floor"] > 1
    assert numbers()["any_observer", "filter_rate_effect"] < 1e-12
    # -0.02 e1 + 2 efa + 2 d2 = 0 with e1 = 0: the estimate has all of d2, in exact numbers.
    found = numbers()["any_observer", "actuator_fault_by_constant_current_disturbance"]
    assert found == pytest.approx(1.0, abs=1e-14)
    other = theory.measure(changed_plant(disturbance_matrix=[[1.0, 0.0], [0.0, 1.99]]), designs())
    found = lookup(other)["any_observer", "actuator_fault_by_constant_current_disturbance"]
    assert found == pytest.approx(0.995, abs=1e-14)


# --- (19) and Lemma 1 ----------------------------------------------------------------------------


def test_19_agrees_with_the_lemma() -> None:
    assert numbers()["inequality_19", "lemma_difference"] < 1e-14
    assert numbers()["inequality_19", "gain_difference"] < 1e-10


def test_a_wrong_term_of_19_would_be_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    right = PdPiVariables._side
    # Without the P3 of the side block.
    monkeypatch.setattr(PdPiVariables, "_side", lambda self, system: right(self, system) - self.P3)
    found = lookup(agreement(dc_motor(), 3))
    assert found["inequality_19", "lemma_difference"] > 0.01


@pytest.mark.parametrize("observer", OBSERVERS)
def test_the_lemma_finds_a_solution_above_the_norm_and_none_below(observer: str) -> None:
    system, gains = dc_motor(), gains_of(observer)
    Ao, Eo = error_system(system, gains)
    norm = h_infinity_norm(Ao, system.Bo, np.eye(6), E=Eo)
    assert numbers()[observer, "norm"] == pytest.approx(norm.upper, rel=1e-9)
    assert numbers()[observer, "margin_above_norm"] > 0
    assert margin_above_norm(system, gains, norm.upper, 1e-4) > 0
    assert margin_above_norm(system, gains, 0.99 * norm.lower, 1e-3) == 0
    with pytest.raises(InputError, match=r"^excess: 0 must be greater than zero"):
        margin_above_norm(system, gains, norm.upper, 0.0)


def test_what_certificates_say_is_told() -> None:
    for observer in OBSERVERS:
        body = designs()[DESIGNS[observer]]
        Ao, Eo = error_system(dc_motor(), gains_of(observer))
        poles = np.linalg.eigvals(np.linalg.solve(Eo, Ao))
        assert numbers()[observer, "slowest_pole"] == pytest.approx(-poles.real.max(), rel=1e-9)
        assert numbers()[observer, "infinite_poles"] == 6 - len(body["certificate"]["poles"]) == 0
    assert np.isnan(numbers()["pi", "gamma"])
    assert numbers()["least_gamma", "gamma"] == pytest.approx(1.00534017676, abs=1e-10)
    for observer in ("pd_pi", "pi_optimal"):
        assert numbers()[observer, "gamma"] == pytest.approx(1.05 * 1.00503781018428, rel=1e-12)
        assert numbers()[observer, "norm"] < numbers()[observer, "gamma"]


# --- Estimates -----------------------------------------------------------------------------------


@pytest.mark.parametrize("observer", ["pi", "pd_pi"])
@pytest.mark.parametrize(("fault", "frequency"), [("actuator", np.pi / 4), ("sensor", np.pi / 2)])
def test_what_is_missed_of_a_sine_is_what_a_simulation_misses(
    observer: str, fault: str, frequency: float
) -> None:
    stated, none = settings(), [{"kind": "constant", "axis": 1, "size": 0.0}]
    sine = [{"kind": "sine", "axis": 1, "amplitude": 1.0, "frequency": frequency}]
    scenario = {"actuator_fault": none, "sensor_fault": none, "noise_power": 0.0,
                "disturbance": [[0, 0], [0, 0]]}  # fmt: skip
    record = plant_stage.simulate(
        {"plant": stated["plant"], "scenario": {**scenario, f"{fault}_fault": sine}, "seed": 0}
    )
    estimator = ExtendedStateObserver(dc_motor(), gains_of(observer), sampling_period=1e-3)
    found = run_on(estimator, record)[f"{fault}_fault"][:, 0]
    # A sine with free phase through the errors of the last period.
    time = record.time[::2][-8001:]
    error = (found - record[f"{fault}_fault"][::2])[-8001:]
    waves = np.column_stack([np.sin(frequency * time), np.cos(frequency * time)])
    amplitude = np.linalg.norm(np.linalg.lstsq(waves, error)[0])
    assert numbers()[observer, f"missed_{fault}_fault"] == pytest.approx(amplitude, rel=1e-4)


def test_a_faster_state_alone_makes_the_faults_come_later() -> None:
    """With Lf kept, by the phases of the estimates at the frequencies of the paper's faults."""
    system, slow = dc_motor(), gains_of("pi")
    fast = slow.L.copy()
    fast[2:4] += np.eye(2)
    lags, poles = [], []
    for L in (slow.L, fast):
        Ao, _ = error_system(system, Gains(L, np.zeros((6, 2))))
        assert np.linalg.eigvals(Ao).real.max() < 0
        poles.append(-np.linalg.eigvals(system.Aa - L[:4] @ system.Ca).real.max())
        for row, w in ((-2, np.pi / 4), (-1, np.pi / 2)):
            error = 1j * w * np.linalg.solve(1j * w * np.eye(6) - Ao, system.Bo)[row, row]
            lags.append(-np.angle(1 - error) / w)
    assert poles[1] > 1.2 * poles[0]
    assert lags[2] > 1.1 * lags[0]
    assert lags[3] > lags[1]


@pytest.mark.parametrize("observer", OBSERVERS)
def test_no_observer_follows_what_is_fast_enough(observer: str) -> None:
    found = lookup(missed(of_one(observer), [1e7, 1e7]))
    for fault in UNITS:
        limit = numbers()[observer, f"missed_{fault}_fault_in_the_limit"]
        assert limit == pytest.approx(1.0, abs=1e-14), "for any gains"
        assert found[observer, f"missed_{fault}_fault"] == pytest.approx(limit, abs=1e-2)


def of_one(observer: str) -> Observers:
    plant = read_job(keys.Ledger, settings()).plant
    return {observer: stored_design(plant, designs()[DESIGNS[observer]])}


def changed_plant(**values: Any) -> dict[str, Any]:
    found = settings()
    return {**found, "plant": {**found["plant"], **values}}


@pytest.mark.parametrize("observer", OBSERVERS)
def test_what_is_held_for_long_is_a_constant(observer: str) -> None:
    found = lookup(held(of_one(observer), 50.0, 0.1))
    for source in ("speed", "current"):
        assert found[observer, f"{source}_disturbance_left"] == pytest.approx(1.0, abs=1e-9)
    assert found[observer, "noise_in_sensor_fault"] == pytest.approx(0.1, rel=1e-9)
    assert found[observer, "noise_in_actuator_fault"] < 1e-9


def test_deviations_are_those_of_the_study() -> None:
    """d of the ledger is uniform: both disturbances together, and the noise."""
    sizes = np.array([0.4, 0.2]) / np.sqrt(12)
    study = Numbers(golden_metrics("eso", "fig3_designs"))
    for observer, kind, at in (
        ("pi", "pi_feasible", {"rate": 1, "decay": 1}),
        ("pd_pi", "pd_pi_least_norm", {"rate": 1, "factor": 1.05}),
    ):
        for fault in UNITS:
            noise = study.at(kind, f"noise_in_{fault}_fault", **at)
            assert numbers()[observer, f"noise_in_{fault}_fault"] == pytest.approx(noise, rel=1e-3)
        # The other disturbance has a share of its own in each fault, which is small.
        for fault, source, size in (
            ("actuator", "current", sizes[1]), ("sensor", "speed", 0.1 * sizes[0])
        ):  # fmt: skip
            both = study.at(kind, f"disturbance_in_{fault}_fault", **at)
            alone = numbers()[observer, f"{source}_disturbance_left"] * size
            assert 0.99 * both < alone <= both
    assert numbers()["noise", "deviation"] == pytest.approx(np.sqrt(1e-3), rel=1e-14)


@pytest.mark.parametrize("observer", OBSERVERS)
def test_biases_by_the_printed_ranges_in_exact_numbers(observer: str) -> None:
    """The error e leaves nothing to be seen: fa of d1 / 1000 - d2, fs of -d1 / 10; f^ = f - e."""
    readings = ((Fraction(-1, 5), Fraction(0)), (Fraction(-3, 20), Fraction(-1, 20)))
    for number, (d1, d2) in enumerate(readings, start=1):
        for fault, bias in (("actuator", d2 - d1 / 1000), ("sensor", d1 / 10)):
            found = numbers()[observer, f"bias_of_{fault}_fault_reading_{number}"]
            assert found == pytest.approx(float(bias), abs=1e-9)


def test_control_is_not_in_the_error_unless_the_model_is_wrong() -> None:
    for observer in OBSERVERS:
        for fault in UNITS:
            assert numbers()[observer, f"controller_effect_on_{fault}_fault"] < 1e-8
    records = records_of_two_controllers(
        read_job(keys.Ledger, settings()).plant, [-5.0, 1.0, -20.0]
    )
    assert np.abs(records[0]["state"] - records[1]["state"]).max() > 0.1
    wrong = dc_motor(B=[[0.0], [1.0]])
    observer = ExtendedStateObserver(wrong, gains_of("pd_pi"), sampling_period=1e-3)
    one, two = (run_on(observer, record)["actuator_fault"] for record in records)
    assert np.abs(one - two).max() > 0.1


# --- The bounds that claims set ------------------------------------------------------------------


def test_errors_are_seen_against_the_faults_and_what_shows_against_their_constants() -> None:
    scenario = evaluator().ledger.section("scenarios", "noisy")
    rules = evaluator().ledger.section("metrics")
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


def test_what_is_said_of_noise_and_reconstruction_are_the_numbers() -> None:
    """Errors of the sensor fault over its size: noise counted as an error, or with the fault."""
    found = lookup(evaluator().figure("fig5").numbers)
    size = found["plant", "rms_sensor_fault_varying"]
    for observer, alone, both in (("pd_pi", 0.47, 0.71), ("least_gamma", 0.59, 0.37)):
        errors = [found[observer, f"rms_{name}_error_varying"] / size
                  for name in ("sensor", "corrected_speed")]  # fmt: skip
        assert errors == pytest.approx([alone, both], abs=0.006)


# --- Bad values ----------------------------------------------------------------------------------

BAD: dict[str, tuple[Any, str]] = {
    "cases": (0, "0 must be 1 or more"),
    "excess": (-1.0, "-1 must be greater than zero"),
    "fault_frequencies": ([1.0], "has shape (1,), must be a list of 2 numbers"),
    "noise_power": (0.0, "0 must be greater than zero"),
    "readings": ([[0.1, 0.2]], "has shape (1, 2), must be (k, 2, 2): ranges of d1 and d2"),
    "other_poles": ([3.0, 0.0, -1.0], "must be 3, stable, complex ones in pairs"),
}


@pytest.mark.parametrize("key", BAD)
def test_a_bad_value_is_told_with_its_key(key: str) -> None:
    value, said = BAD[key]
    with pytest.raises(InputError) as caught:
        theory.measure(settings(**{key: value}), designs())
    assert caught.value.parameter == key
    assert said in caught.value.problem


def test_one_of_many_is_told_with_its_place() -> None:
    with pytest.raises(InputError, match=r"^filter_rates\.0: 0 must be greater than zero$"):
        theory.measure(settings(filter_rates=[0.0, 1.0]), designs())
