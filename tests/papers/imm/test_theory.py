"""The numbers of the theory: closed forms, second ways, and what is refused."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from reobserve.core.documents import read_yaml
from reobserve.core.errors import InputError
from reobserve.papers.imm.theory import (
    corrected_radius,
)
from reobserve.plants.hydraulic_actuator import REALISATIONS, ActuatorModel, simulate
from reobserve.replication.evaluation import Evaluator
from reobserve.replication.metrics.metrics import lookup
from reobserve.signals.inputs import Signal
from reobserve.systems.linear import LinearModel
from tests.observers.actuator_models import ACTUATOR, motion_model, velocity_model
from tests.papers import fixed_ledger

Array = NDArray[np.float64]

ROOT = Path(__file__).parents[3]
SEED = read_yaml(ROOT / "config" / "config.yaml")["seed"]


def found(changes: dict[str, Any] | None = None, seed: int = SEED) -> dict[tuple[str, str], float]:
    return lookup(Evaluator(fixed_ledger("imm", changes, seed)).theory())


@cache
def stated() -> dict[tuple[str, str], float]:
    return found()


def scalar(A: float, Q: float, R: float) -> LinearModel:
    return LinearModel([[A]], np.empty((1, 0)), [[1.0]], Q=Q, R=R)


# --- The full correction ------------------------------------------------------------------------


def test_what_no_output_sees_moves_by_its_own_block() -> None:
    A = np.array([[0.5, 0.3], [-0.2, 0.7]])
    assert corrected_radius(A, np.array([[1.0, 0.0]])) == pytest.approx(0.7)
    assert corrected_radius(A, np.array([[0.0, 3.0]])) == pytest.approx(0.5)
    # In the direction (1, 1) / sqrt(2), what is left is along d = (1, -1) / sqrt(2): d' A d.
    assert corrected_radius(A, np.array([[1.0, 1.0]])) == pytest.approx((0.5 - 0.3 + 0.2 + 0.7) / 2)
    assert corrected_radius(A, np.eye(2)) == 0.0


@pytest.mark.parametrize("mode", ACTUATOR)
def test_radii_of_the_actuator_are_those_of_blocks(mode: str) -> None:
    A, _, H = velocity_model(mode).arrays[:3]
    block = np.abs(np.linalg.eigvals(A[1:, 1:])).max()
    assert corrected_radius(A, H) == pytest.approx(block, rel=1e-9)
    A, _, H = motion_model(mode).arrays[:3]
    block = np.abs(np.linalg.eigvals(A[3:, 3:])).max()
    assert corrected_radius(A, H) == pytest.approx(block, rel=1e-9)


def test_the_radius_is_that_of_the_slowest_mode() -> None:
    largest = max(
        np.abs(np.linalg.eigvals(velocity_model(mode).arrays.A[1:, 1:])).max() for mode in ACTUATOR
    )
    assert stated()["svsf_law", "corrected_radius_velocity"] == pytest.approx(largest, rel=1e-9)


# --- A wrong model ------------------------------------------------------------------------------


def test_within_an_endless_layer_the_single_filter_errs_as_much_as_its_model() -> None:
    rules = fixed_ledger("imm").section("theory")
    steps, begin = (round(rules[name] / rules["period"]) for name in ("horizon", "onset"))
    control = Signal.parse("input", rules["input"], 1)(np.arange(steps) * rules["period"])[:, 0]
    normal, leakage = (ActuatorModel(*ACTUATOR[mode]) for mode in ("normal", "leakage"))
    leaks = np.arange(steps) >= begin
    velocities = [
        simulate([normal, leakage], mode.astype(np.int64), control, rules["period"])[1:, 1]
        for mode in (leaks, np.zeros(steps))
    ]
    apart = np.sqrt(np.mean((velocities[0] - velocities[1])[begin:] ** 2))
    assert apart > 0.1
    wide = found({"observers": {"svsf": {"layer_factor": 1e12}}})
    assert wide["svsf", "single_velocity_error"] == pytest.approx(apart, rel=1e-6)


def test_without_a_fault_there_is_no_error() -> None:
    numerator, denominator = ACTUATOR["normal"]
    same = {"leakage_numerator": numerator, "leakage_denominator": denominator}
    values = found({"plant": same})
    for name in ("kalman", "svsf", "svsf_thin"):
        assert values[name, "single_velocity_error"] < 1e-9


def test_a_filter_that_trusts_its_measurements_needs_no_right_model() -> None:
    values = found({"observers": {"kalman": {"measurement_noise": [1e-12] * 3}}})
    assert values["kalman", "single_velocity_error"] < 1e-6
    assert stated()["kalman", "single_velocity_error"] > 1e-4


def test_a_bank_that_never_leaves_its_first_mode_is_its_filter() -> None:
    """All modes alike: the bank is the single filter, whatever it makes of their probabilities."""
    numerator, denominator = ACTUATOR["normal"]
    alike = {
        f"{mode}_{part}": value
        for mode in ("friction", "leakage")
        for part, value in (("numerator", numerator), ("denominator", denominator))
    }
    values = found({"plant": alike})
    for name in ("kalman", "svsf", "svsf_thin"):
        assert values[name, "bank_velocity_error"] < 1e-9


# --- The layers ---------------------------------------------------------------------------------


def test_thinner_layers_are_a_larger_part_of_the_error_and_left_by_none() -> None:
    values = stated()
    assert 0 < values["svsf", "layer_share"] < values["svsf_thin", "layer_share"] < 1
    # Far inside the layer the errors are the model's own, and the share is as the width.
    ten = found({"observers": {"svsf": {"layer_factor": 10.0}}})
    assert ten["svsf", "layer_share"] == pytest.approx(values["svsf", "layer_share"] / 10, rel=0.05)


def test_a_layer_as_wide_as_the_model_is_wrong_corrects_it() -> None:
    values = stated()
    wide = found({"observers": {"svsf": {"layer_factor": 1e12}}})
    opened = values["model", "open_velocity_error"]
    assert wide["svsf", "single_velocity_error"] == pytest.approx(opened, rel=1e-6)
    # What the ledger has for the layer does not enter.
    assert wide["svsf", "informed_velocity_error"] == values["svsf", "informed_velocity_error"]
    assert values["svsf", "informed_velocity_error"] < opened


def test_the_own_radius_is_that_of_the_realisation() -> None:
    for realisation in REALISATIONS:
        one = found({"observers": {"svsf": {"realisation": realisation}}})
        assert one["svsf", "corrected_radius"] == one["svsf_law", f"corrected_radius_{realisation}"]
    assert stated()["svsf_law", "corrected_radius_observer_canonical"] == pytest.approx(
        1.0038, abs=1e-4
    )


# --- The stage ----------------------------------------------------------------------------------


def test_the_same_numbers_whatever_the_seed_of_the_run() -> None:
    assert found(seed=SEED + 1) == stated()


@pytest.mark.parametrize(
    ("rules", "key", "said"),
    [
        (
            {"observers": ["kalman", "svfs"]},
            "observers",
            "there is no 'svfs'; did you mean 'svsf'?",
        ),
        ({"observers": []}, "observers", "has 0 items, must have 1"),
        ({"period": -1}, "period", "must be greater than zero"),
        ({"period": 3e-3}, "horizon", "must be a whole multiple of theory.period"),
        ({"onset": 4.0}, "onset", "4 s must be before the end of the horizon"),
        ({"input": 3}, "input", "list of terms"),
    ],
)
def test_bad_rules_are_told_in_one_sentence(rules: dict[str, Any], key: str, said: str) -> None:
    with pytest.raises(InputError) as caught:
        found({"theory": rules})
    assert caught.value.parameter == f"imm.theory.{key}"
    assert said in caught.value.problem
