"""The numbers of the theory: closed forms, second ways, and what is refused."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from reobserve.errors import InputError
from reobserve.ledger.config import read_yaml
from reobserve.ledger.ledger import Ledger
from reobserve.models.linear import LinearModel
from reobserve.observers.kalman import KalmanFilter
from reobserve.papers.imm.theory import (
    corrected_radius,
    error_variance,
    printed_weights,
)
from reobserve.pipeline.evaluation import Evaluator
from reobserve.plants.hydraulic_actuator import ActuatorModel, simulate
from reobserve.scoring.metrics import lookup
from reobserve.synthesis.linear import steady_kalman_gain
from reobserve.timeseries.signals import Signal
from tests.observers.actuator_models import ACTUATOR, motion_model, velocity_model

Array = NDArray[np.float64]

ROOT = Path(__file__).parents[3]
SEED = read_yaml(ROOT / "config" / "config.yaml")["seed"]


def found(changes: dict[str, Any] | None = None, seed: int = SEED) -> dict[tuple[str, str], float]:
    return lookup(Evaluator(Ledger.load(ROOT, "imm", changes, seed)).theory())


@cache
def stated() -> dict[tuple[str, str], float]:
    return found()


def scalar(A: float, Q: float, R: float) -> LinearModel:
    return LinearModel([[A]], np.empty((1, 0)), [[1.0]], Q, R)


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
    rules = Ledger.load(ROOT, "imm").section("theory")
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


# --- Kalman's gain ------------------------------------------------------------------------------


def test_variance_of_a_scalar_under_any_gain() -> None:
    a, q, r = 0.9, 0.25, 2.0
    model = scalar(a, q, r)
    for k in (0.0, 0.3, 1.0, 1.5):
        left = 1 - k
        wanted = (left**2 * q + k**2 * r) / (1 - left**2 * a**2)
        assert error_variance(model, np.array([[k]])) == pytest.approx(wanted, rel=1e-12)
    assert error_variance(scalar(1.0, q, r), np.zeros((1, 1))) == np.inf
    assert error_variance(model, np.array([[2.5]])) == np.inf


@pytest.mark.parametrize("mode", ACTUATOR)
def test_the_variance_is_what_the_filter_comes_to(mode: str) -> None:
    model = motion_model(mode)
    kalman = KalmanFilter(model)
    # R of the acceleration leaves slow modes: some seconds until the covariance is at rest.
    still = np.zeros((4000, 3)), np.zeros((4000, 1))
    run = kalman.run(*still, state=kalman.init(np.zeros(5), 1.0))
    best = error_variance(model, steady_kalman_gain(model))
    assert best == pytest.approx(run["variance"][-1].sum(), rel=1e-8)


def test_no_gain_that_is_tried_is_better() -> None:
    assert stated()["kalman", "least_variance_rise"] > 0
    further = found({"theory": {"spread": 0.3}})
    closer = found({"theory": {"spread": 0.01}})
    # The variance is quadratic about its minimum: a thirtieth of the change, a 900th of the loss.
    ratio = closer["kalman", "least_variance_rise"] / further["kalman", "least_variance_rise"]
    assert ratio == pytest.approx(1 / 900, rel=0.5)


# --- (8) and (15) by the letter -----------------------------------------------------------------


def test_sums_of_printed_weights() -> None:
    sticky, thirds = 0.023 * np.ones((3, 3)) + 0.931 * np.eye(3), np.full(3, 1 / 3)
    sums = printed_weights(sticky, thirds).sum(axis=0)
    # Column j is divided by what comes from modes 1 to j alone.
    assert sums == pytest.approx([1 / 0.954, 1 / 0.977, 1.0], rel=1e-12)
    assert printed_weights(np.eye(3), thirds) == pytest.approx(np.eye(3))


def test_printed_equations_of_the_ledger() -> None:
    stay = Ledger.load(ROOT, "imm").section("observers", "kalman")["stay"]
    assert stated()["equation_8", "largest_weight_excess"] == pytest.approx(1 / stay - 1, rel=1e-9)
    assert stated()["equation_15", "states_without_gain"] == 4 - 3


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
        ({"gains": 0}, "gains", "0 must be from 1 to 100000"),
        ({"spread": 0}, "spread", "must be greater than zero"),
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
