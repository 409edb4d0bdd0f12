"""The package of the paper builds, runs and scores as the parameter file states."""

from __future__ import annotations

import re
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from reobserve.core.documents import read_yaml
from reobserve.core.errors import InputError
from reobserve.observers.imm import IMM, ImmState
from reobserve.observers.kalman import KalmanFilter
from reobserve.observers.run import Run
from reobserve.observers.smooth_variable_structure import SmoothVariableStructureFilter
from reobserve.systems.linear import LinearModel
from reobserve_papers.metrics.responses import window
from reobserve_papers.papers.imm import keys, observe, plant
from reobserve_papers.papers.imm.keys import MODES
from reobserve_papers.papers.imm.scoring import probabilities, quoted_distance
from reobserve_papers.parameters.job import read_job
from reobserve_papers.parameters.parameter_checks import check_parameters
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.plants.hydraulic_actuator import MOTION, REALISATIONS, ActuatorModel
from reobserve_papers.signals.series import Series
from reobserve_papers.steps.evaluation import Evaluator
from tests import ROOT
from tests.reobserve.observers.actuator_models import ACTUATOR
from tests.reobserve_papers.papers import fixed_parameters, job_of

Array = NDArray[np.float64]
Tree = dict[str, Any]

SEED = read_yaml(ROOT / "config" / "config.yaml")["seed"]


def parameters(changes: Tree | None = None, seed: int = SEED) -> Parameters:
    return fixed_parameters("imm", changes, seed)


@cache
def evaluator() -> Evaluator:
    return Evaluator(parameters())


@cache
def measured(figure: str) -> dict[tuple[str, str], float]:
    return {(m.observer, m.metric): m.value for m in evaluator().figure(figure).numbers}


@cache
def record(scenario: str) -> Series:
    return plant.simulate(job_of(parameters(), "plant", scenario))


def changed_record(scenario: str, seed: int = SEED, **values: Any) -> Series:
    changed = parameters({"scenarios": {scenario: values}} if values else None, seed)
    return plant.simulate(job_of(changed, "plant", scenario))


# --- The plant's record -------------------------------------------------------------------------


@pytest.mark.parametrize("scenario", ["plain", "step"])
def test_samples_and_fault_agree_with_the_parameters(scenario: str) -> None:
    found, stated = record(scenario), parameters().section("scenarios", scenario)
    horizon = parameters().section("plant", "horizon")
    np.testing.assert_allclose(found.time, np.arange(len(found.time)) * stated["period"])
    assert found.time[-1] == pytest.approx(horizon, rel=1e-12)
    assert found.events["fault"] == (stated["onset"],)
    np.testing.assert_array_equal(found["mode"], found.time > stated["onset"] - 1e-9)


@pytest.mark.parametrize("scenario", ["plain", "step"])
def test_noise_is_as_large_as_stated_and_white(scenario: str) -> None:
    found = record(scenario)
    stated = np.array(parameters().section("scenarios", scenario, "noise"))
    noise = found["measured"] - found["motion"]
    if not stated.any():
        assert not noise.any()
        return
    # Five deviations of the estimate, for n normal numbers.
    n = len(noise)
    assert np.all(np.abs(noise.std(axis=0) / stated - 1) < 5 / np.sqrt(2 * n))
    assert np.all(np.abs(noise.mean(axis=0) / stated) < 5 / np.sqrt(n))
    unit = noise / stated
    for product in (unit[1:].T @ unit[:-1], unit.T @ unit - np.diag((unit**2).sum(axis=0))):
        assert np.max(np.abs(product)) < 5 * np.sqrt(n)


def test_plain_noise_is_one_per_cent_of_each_output() -> None:
    size = np.sqrt(np.mean(record("plain")["motion"] ** 2, axis=0))
    stated = np.array(parameters().section("scenarios", "plain", "noise"))
    np.testing.assert_allclose(stated / size, 0.01, rtol=0.15)
    matched = parameters().section("observers", "kalman", "measurement_noise")
    np.testing.assert_allclose(matched, stated**2, rtol=0.05)


def test_noise_does_not_affect_the_plant() -> None:
    plain = record("plain")
    quiet = changed_record("plain", noise=[0, 0, 0, 0])
    np.testing.assert_array_equal(quiet["motion"], plain["motion"])
    np.testing.assert_array_equal(quiet["measured"], plain["motion"])
    other = changed_record("plain", seed=SEED + 1)
    np.testing.assert_array_equal(other["motion"], plain["motion"])
    np.testing.assert_array_equal(other["input"], plain["input"])
    assert not np.any(other["measured"][1:] == plain["measured"][1:])


def test_noise_of_one_output_does_not_change_that_of_others() -> None:
    noise = parameters().section("scenarios", "plain", "noise")
    more = changed_record("plain", noise=[*noise[:3], 2 * noise[3]])
    plain = record("plain")
    np.testing.assert_array_equal(more["measured"][:, :3], plain["measured"][:, :3])
    parts = [one["measured"][:, 3] - one["motion"][:, 3] for one in (more, plain)]
    np.testing.assert_allclose(parts[0], 2 * parts[1], rtol=0, atol=1e-9)


def test_pseudo_random_input_is_a_maximum_length_sequence() -> None:
    found = record("plain")
    volts, period = found["input"], found.step
    begin, bit, length = round(0.5 / period), round(0.01 / period), 127
    assert not volts[:begin].any()
    np.testing.assert_array_equal(np.unique(volts[begin:-1]), [-1.5, 1.5])
    # Held over each bit, repeated after 127 of them, with one more of one sign than of the other.
    bits = volts[begin:-1:bit]
    np.testing.assert_array_equal(np.repeat(bits, bit)[: len(volts) - 1 - begin], volts[begin:-1])
    np.testing.assert_array_equal(bits[length : 6 * length], bits[: 5 * length])
    assert abs(bits[:length].sum()) == 1.5
    # The autocorrelation of a maximum-length sequence: -1/127 away from the peak.
    sequence = bits[:length] / 1.5
    for shift in range(1, length):
        assert sequence @ np.roll(sequence, shift) == -1


def test_step_record_settles_at_the_static_gains() -> None:
    found = record("step")
    np.testing.assert_array_equal(found["input"], 1.5 * (found.time > 0.5 - 1e-9))
    gain = [ActuatorModel(*ACTUATOR[name]).gain for name in ("normal", "leakage")]
    before = found["motion"][found.time < found.events["fault"][0] - 1e-9]
    assert before[-1, 1] == pytest.approx(1.5 * gain[0], rel=1e-6)
    assert found["motion"][-1, 1] == pytest.approx(1.5 * gain[1], rel=1e-6)


def test_partial_leak_interpolates_the_coefficients() -> None:
    found = changed_record("step", share=0.5)
    numerator, denominator = (
        (ACTUATOR["normal"][k][-1] + ACTUATOR["leakage"][k][-1]) / 2 for k in (0, 1)
    )
    assert found["motion"][-1, 1] == pytest.approx(1.5 * numerator / denominator, rel=1e-6)


# --- Results of the banks -----------------------------------------------------------------------


def test_plain_kalman_bank_diagnoses_the_leak() -> None:
    """The paper reports 85 % normal and 10 % leakage; this bank is certain and correct."""
    found = measured("fig5_plain")
    assert found["kalman", "normal_before"] > 0.999
    assert found["kalman", "leakage_after"] > 0.999
    assert found["kalman", "normal_after"] < 1e-3
    assert found["kalman", "diagnosed_share"] == 1.0


@pytest.mark.parametrize("figure", ["fig5", "fig6", "fig7", "fig8"])
def test_calibrated_banks_reproduce_the_quoted_values_within_the_band(figure: str) -> None:
    found, band = measured(figure), parameters().section("metrics", "band")
    for name in parameters().section("figures", figure, "observers"):
        stated = parameters().section("observers", name)
        for what, quoted in zip(("normal_after", "leakage_after"), stated["quoted"], strict=True):
            assert abs(found[name, what] - quoted) <= band, (name, what)
        if stated["quoted_high"]:
            assert 1 - found[name, "normal_before"] <= band, name
        # The spread over time is small: not an average of zeros and ones.
        assert found[name, "leakage_spread"] < 0.1


def test_friction_fault_is_diagnosed_only_without_mixing() -> None:
    """With little process noise it is diagnosed without mixing, and never with it.

    In each step the filter of a mode with negligible probability starts from the estimates of the
    others, here normal and leakage, which alternate.
    """
    friction = {"scenarios": {"plain": {"fault": "friction"}}}
    found = {}
    for mixing in (False, True):
        little = {"mixing": mixing, "process_noise": [1e-6] * 5}
        changed = parameters({**friction, "observers": {"kalman": little}})
        estimate = Evaluator(changed).figure("fig5_plain").estimates["kalman"]
        found[mixing] = estimate["probability"]
        assert estimate.events["fault"] == (5.0,)
    late = window(estimate.time, 7.0, 10.0, closed="right")
    assert found[False][late, 1].mean() > 0.95
    assert np.mean(found[False][late].argmax(axis=1) == 1) > 0.99
    assert found[True][late, 1].max() < 1e-6
    for mixed in found.values():
        assert mixed[window(estimate.time, 3.0, 5.0, closed="right"), 0].mean() > 0.95


# --- The stage ----------------------------------------------------------------------------------

OUTPUT_NOISE = {"position": 2.9e-6, "velocity": 2e-5, "acceleration": 7.8e-2, "jerk": 676.0}
LAYERS = {"position": 0.01, "velocity": 0.01, "acceleration": 30.0, "jerk": 3000.0}


def observer(algorithm: str, realisation: str) -> Tree:
    names = REALISATIONS[realisation]
    body = {
        "algorithm": algorithm, "realisation": realisation,
        "process_noise": [1e-6] * (5 if realisation == "motion" else 4),
        "measurement_noise": [OUTPUT_NOISE[name] for name in names],
        "self_transition": 0.97, "initial_covariance": 0.5, "initial_mode": "unknown",
        "mixing": True, "quoted": [0.5, 0.5], "quoted_high": False,
    }  # fmt: skip
    if algorithm == "kalman":
        return body
    layer = [LAYERS[name] for name in names]
    return {
        **body, "boundary_layer": layer, "layer_scale": 1.0, "layer_factor": 0.5,
        "convergence_rate": 0.2, "inverse": "pseudo",
    }  # fmt: skip


def by_hand(body: Tree, found: Series) -> tuple[IMM, Run[ImmState]]:
    filters: list[Any] = []
    for mode in MODES:
        one = ActuatorModel(*ACTUATOR[mode]).sampled(body["realisation"], found.step, 200.0)
        Q, R = np.diag(body["process_noise"]), np.diag(body["measurement_noise"])
        # Inputs are u from each row on, which drives the state, and u up to it, which is measured.
        B, D = np.pad(one.B, ((0, 0), (0, 1))), np.pad(one.D, ((0, 0), (1, 0)))
        model = LinearModel(one.A, B, one.C, D, Q=Q, R=R, sampling_period=found.step)
        if body["algorithm"] == "kalman":
            filters.append(KalmanFilter(model))
        else:
            layer = 0.5 * np.array(body["boundary_layer"])
            filters.append(
                SmoothVariableStructureFilter(model, boundary_layer=layer, convergence_rate=0.2)
            )
    off = (1 - 0.97) / 2
    chain = [[0.97, off, off], [off, 0.97, off], [off, off, 0.97]]
    bank = IMM(filters, chain)
    columns = [MOTION.index(name) for name in REALISATIONS[body["realisation"]]]
    z, control = found["measured"][:, columns], found["input"]
    u = np.column_stack([control, np.append(0.0, control[:-1])])
    start = bank.init(np.zeros(filters[0].model.states), 0.5, u=u[0])
    return bank, bank.run(z[1:], u[1:], start=start)


@pytest.mark.parametrize("realisation", REALISATIONS)
@pytest.mark.parametrize("algorithm", ["kalman", "smooth_variable_structure"])
def test_estimate_stage_agrees_with_a_direct_bank_run(algorithm: str, realisation: str) -> None:
    body, found = observer(algorithm, realisation), record("plain")
    settings = {"plant": parameters().section("plant"), "observer": body}
    estimate = observe.estimate(read_job(keys.Parameters, settings), found)
    _, run = by_hand(body, found)
    np.testing.assert_array_equal(estimate["probability"][0], np.full(3, 1 / 3))
    np.testing.assert_array_equal(estimate["probability"][1:], run["probability"])
    velocity = run["state"][:, 1 if realisation == "motion" else 0]
    assert estimate["velocity"][0] == 0
    np.testing.assert_allclose(estimate["velocity"][1:], velocity, rtol=1e-14)
    if algorithm == "kalman":
        assert "saturated" not in estimate.channels
        # Any realisation detects the leak, and has less velocity noise than the measurement.
        late = found.time > 6
        assert estimate["probability"][late, 2].mean() > 0.95
        error = (estimate["velocity"] - found["motion"][:, 1])[late]
        assert np.sqrt(np.mean(error**2)) < parameters().section("scenarios", "plain", "noise")[1]
    else:
        layer = 0.5 * np.array(body["boundary_layer"])
        counted = [float((np.abs(row) > layer).sum()) / row.size for row in run["innovation"]]
        np.testing.assert_allclose(estimate["saturated"][1:], counted, rtol=1e-14)
        assert 0.01 < estimate["saturated"].mean() < 0.99
        assert estimate["saturated"][0] == 0
        turned = np.zeros_like(run["innovation"])
        for k, (before, row) in enumerate(pairwise(run["innovation"]), start=1):
            turned[k] = (np.sign(row) == -np.sign(before)) & (np.abs(row) > layer)
        np.testing.assert_allclose(estimate["chattering"][1:], turned.mean(axis=(1, 2)), rtol=1e-14)
        assert 0 < estimate["chattering"].mean() < estimate["saturated"].mean()
        place = REALISATIONS[realisation].index("velocity")
        jumps = [
            sum(mu * e[place] for mu, e, now in zip(*row, strict=True) if now[place])
            for row in zip(run["probability"], run["innovation"], turned, strict=True)
        ]
        np.testing.assert_allclose(estimate["chattering_correction"][1:], jumps, atol=1e-15)


def test_no_error_is_outside_wide_layers() -> None:
    for figure in ("fig5_plain", "fig7_plain"):
        estimates = evaluator().figure(figure).estimates
        for name, estimate in estimates.items():
            if "saturated" in estimate.channels:
                factor = parameters().section("observers", name, "layer_factor")
                assert not estimate["saturated"].any(), (name, factor)
    thin = parameters({"observers": {"svsf": {"layer_factor": 1e-9}}})
    share = observe.estimate(job_of(thin, "observe", "svsf"), record("plain"))["saturated"]
    assert share[-1000:].mean() > 0.99


def test_mixing_is_optional() -> None:
    body = observer("kalman", "motion")
    settings = {"plant": parameters().section("plant"), "observer": {**body, "mixing": False}}
    assert observe.build(read_job(keys.Parameters, settings), 1e-3).mixing is False
    assert (
        observe.build(read_job(keys.Parameters, {**settings, "observer": body}), 1e-3).mixing
        is True
    )


# --- Scores -------------------------------------------------------------------------------------

RULES = keys.Metrics(
    before=[3.0, 5.0], after=[7.0, 10.0], overshoot=[5.5, 6.5], alarm=0.9, band=0.1
)
TIME = np.arange(1001) * 0.01


def constant_pieces(*pieces: tuple[float, tuple[float, float, float]]) -> Array:
    """Probabilities that are constant from each of the times on."""
    values = np.zeros((len(TIME), 3))
    for begin, row in pieces:
        values[begin - 1e-9 < TIME] = row
    return values


def scores(probability: Array, fault: int = 2) -> dict[str, float]:
    return {name: value for name, value, _ in probabilities(RULES, TIME, probability, 5.0, fault)}


def test_windows_exclude_their_start_and_include_their_end() -> None:
    np.testing.assert_allclose(TIME[window(TIME, 3.0, 3.03, closed="right")], [3.01, 3.02, 3.03])


def test_scores_of_known_probabilities_are_exact() -> None:
    found = scores(
        constant_pieces(
            (0.0, (0.98, 0.01, 0.01)),
            (5.03, (0.85, 0.05, 0.1)),  # the third sample after the fault
            (5.2, (0.4, 0.1, 0.5)),
            (6.0, (0.6, 0.1, 0.3)),
            (6.3, (0.3, 0.1, 0.6)),
        )
    )
    wanted = {
        "normal_before": 0.98,
        "normal_after": 0.3, "friction_after": 0.1, "leakage_after": 0.6,
        "normal_spread": 0.0, "leakage_spread": 0.0,
        "overshoot": 0.3, "alarm_samples": 3.0, "diagnosed_share": 1.0,
    }  # fmt: skip
    assert found == pytest.approx(wanted, abs=1e-12)


def test_overshoot_counts_below_the_plateau_too() -> None:
    below = constant_pieces(
        (0.0, (0.98, 0.01, 0.01)), (5.2, (0.4, 0.1, 0.5)), (6.0, (0.1, 0.1, 0.8)),
        (6.3, (0.3, 0.1, 0.6)),
    )  # fmt: skip
    assert scores(below)["overshoot"] == pytest.approx(0.2, abs=1e-12)


def test_change_at_the_onset_is_not_a_detection() -> None:
    found = scores(constant_pieces((0.0, (1, 0, 0)), (5.0, (0, 0, 1))))
    assert np.isnan(found["alarm_samples"])
    # The sample at 5 s belongs to the earlier window.
    assert found["normal_before"] == pytest.approx(1 - 1 / 200)


def test_alarm_before_the_fault_is_false() -> None:
    """In the window before the fault, or between its end and the fault; not in the start."""
    leak = (5.03, (0.1, 0.1, 0.8))
    for begin, heard in ((2.5, 3.0), (3.5, np.nan), (4.9, np.nan)):
        rings = (begin, (0.8, 0.1, 0.1)), (begin + 0.2, (1, 0, 0))
        found = scores(constant_pieces((0.0, (1, 0, 0)), *rings, leak))
        assert found["alarm_samples"] == pytest.approx(heard, nan_ok=True), begin


def test_missing_detection_is_nan() -> None:
    found = scores(constant_pieces((0.0, (0.95, 0.05, 0.0))))
    assert np.isnan(found["alarm_samples"])
    assert found["diagnosed_share"] == 0.0


def test_diagnosed_share_depends_on_the_stated_fault() -> None:
    rows = constant_pieces((0.0, (0.95, 0.05, 0.0)), (5.5, (0.1, 0.8, 0.1)))
    assert scores(rows, fault=1)["diagnosed_share"] == 1.0
    assert scores(rows, fault=2)["diagnosed_share"] == 0.0


def flipping() -> Array:
    """On average 0.4 and 0.6 after the fault, but only zeros and ones."""
    values = constant_pieces((0.0, (1, 0, 0)))
    late = np.flatnonzero(TIME > 5)
    values[late] = np.where((np.arange(len(late)) % 5 < 2)[:, None], [1, 0, 0], [0, 0, 1])
    return values


def test_oscillating_probability_has_a_large_deviation_from_its_mean() -> None:
    found = scores(flipping())
    assert found["normal_after"] == pytest.approx(0.4)
    assert found["leakage_after"] == pytest.approx(0.6)
    assert found["leakage_spread"] == pytest.approx(np.sqrt(0.24))
    assert found["diagnosed_share"] == pytest.approx(0.6)
    quoted = [0.4, 0.6]
    assert quoted_distance(RULES, TIME, flipping(), quoted, False) == pytest.approx(np.sqrt(0.24))
    # The normal mode before the fault, where its probability is one, is included.
    far = quoted_distance(RULES, TIME, flipping(), quoted, True)
    assert far == pytest.approx(np.sqrt(2 * 0.24 / 3))


def test_distance_of_steady_probabilities_is_exact() -> None:
    rows = constant_pieces((0.0, (0.9, 0.1, 0.0)), (5.0, (0.5, 0.1, 0.4)))
    rows[TIME > 10 - 1e-9] = rows[TIME < 5][:1]  # the last sample, one of 300
    exact = constant_pieces((0.0, (0.9, 0.1, 0.0)), (5.0, (0.5, 0.1, 0.4)))
    assert quoted_distance(RULES, TIME, exact, [0.5, 0.4], False) == pytest.approx(0, abs=1e-15)
    assert quoted_distance(RULES, TIME, exact, [0.2, 0.8], False) == pytest.approx(
        np.sqrt((0.09 + 0.16) / 2)
    )
    before = (199 * 0.01 + 0.25) / 200
    assert quoted_distance(RULES, TIME, exact, [0.2, 0.8], True) == pytest.approx(
        np.sqrt((0.09 + 0.16 + before) / 3)
    )
    off = (0.4**2 + 0.4**2) / 300 / 2
    assert quoted_distance(RULES, TIME, rows, [0.5, 0.4], False) == pytest.approx(np.sqrt(off))


# --- Invalid values -----------------------------------------------------------------------------


def plants(**values: Any) -> Tree:
    return {"plant": values}


def plain(**values: Any) -> Tree:
    return {"scenarios": {"plain": values}}


def svsf(**values: Any) -> Tree:
    return {"observers": {"svsf": values}}


def rules(**values: Any) -> Tree:
    return {"metrics": values}


def study(name: str, **values: Any) -> Tree:
    return {"studies": {name: values}}


def search(**values: Any) -> Tree:
    return {"searches": {"calibrated": values}}


TERM = {"kind": "constant", "axis": 1, "size": 1.0}

# User input, the key named in the message, and the message.
BAD_CONFIG: dict[str, tuple[Tree, str, str]] = {
    **{
        f"{mode} {part}": (
            plants(**{f"{mode}_{part}": [1, 2, 3]}), f"plant.{mode}_{part}", "a list of 4 numbers",
        )
        for mode in MODES for part in ("numerator", "denominator")
    },
    "an unstable mode": (
        plants(friction_denominator=[1, 2, 3, -4]), "plant.friction_denominator", "be stable",
    ),
    "horizon between samples": (
        plants(horizon=10.0005), "scenarios.plain.period",
        "10.0005 s must be a whole multiple of the period, 0.001 s",
    ),
    "a period too short": (plain(period=1e-7), "scenarios.plain.period", "makes more than 5e+06"),
    "a period that does not fit": (
        plain(period=3e-3), "scenarios.plain.period", "must be a whole multiple",
    ),
    "an input after the end": (
        plain(input=[{**TERM, "from": 12}]), "scenarios.plain.input",
        "starts at 12 s, must start before the end at 10 s",
    ),
    "an input between samples": (
        plain(input=[{**TERM, "from": 0.50005}]), "scenarios.plain.input",
        "must jump at a multiple of 0.001 s",
    ),
    "the normal mode for a fault": (
        plain(fault="normal"), "scenarios.plain.fault", "must be one of friction, leakage",
    ),
    "more than the whole leak": (
        plain(share=1.5), "scenarios.plain.share", "1.5 must be from 0 to 1",
    ),
    "a fault after the end": (
        plain(onset=10), "scenarios.plain.onset", "10 s must be before the end at 10 s",
    ),
    "a fault between samples": (
        plain(onset=5.0005), "scenarios.plain.onset", "must be a whole multiple of the period",
    ),
    "noise of three": (plain(noise=[1, 2, 3]), "scenarios.plain.noise", "a list of 4 numbers"),
    "unknown realisation": (
        svsf(realisation="pva"), "observers.svsf.realisation",
        "'pva' must be one of velocity, derivatives, motion",
    ),
    "a realisation with fewer states": (
        svsf(realisation="velocity", process_noise=[1, 1, 1]), "observers.svsf.process_noise",
        "has shape (3,), must be one",
    ),
    "process noise of two": (svsf(process_noise=[1, 1]), "observers.svsf.process_noise", "(2,)"),
    "negative process noise": (
        svsf(process_noise=-1), "observers.svsf.process_noise", "must be positive semidefinite",
    ),
    "negative measurement noise": (
        svsf(measurement_noise=-1), "observers.svsf.measurement_noise", "positive semidefinite",
    ),
    "negative covariance": (
        svsf(initial_covariance=-1), "observers.svsf.initial_covariance", "positive semidefinite",
    ),
    "covariance of two": (
        svsf(initial_covariance=[1, 1]), "observers.svsf.initial_covariance", "has shape (2,)",
    ),
    "mixing by a word": (
        svsf(mixing="false"), "observers.svsf.mixing", "'false' must be one of true and false",
    ),
    "two layers": (
        svsf(boundary_layer=[1, 2]), "observers.svsf.boundary_layer", "a list of 3 numbers",
    ),
    "a layer of no width": (
        svsf(boundary_layer=[1, 2, 0]), "observers.svsf.boundary_layer", "greater than zero",
    ),
    "no convergence": (
        svsf(convergence_rate=1.0), "observers.svsf.convergence_rate", "from 0 to below 1",
    ),
    **{
        f"{name} {words}": (rules(**{name: value}), f"metrics.{name}", said)
        for name in ("before", "after", "overshoot")
        for words, value, said in (
            ("falls", [6, 5], "must be 0 or more, rising"),
            ("is one number", [7], "must be a list of 2 numbers"),
            ("is after the end", [11, 12], "must start before the end at 10 s"),
        )
    },
    **{
        f"{name} {value}": (rules(**{name: value}), f"metrics.{name}", said)
        for name in ("alarm", "band")
        for value, said in ((1.5, "must be less than 1"), ("x", "'x' is not a number"))
    },
    "kept in a number": (
        study("neighbourhood", kept=3), "studies.neighbourhood.kept", "3 must be a word",
    ),
    "factors": (study("neighbourhood", factors=[0]), "studies.neighbourhood.factors", "0 must"),
    "a period of a study": (
        study("changes", periods=[3e-3]), "studies.changes.periods", "must be a whole multiple",
    ),
    "a period that the input does not fit": (
        study("changes", periods=[0.2]), "studies.changes.periods", "with it, scenario.input:",
    ),
    "causes without an SVSF": (
        study("causes", observers=["kalman_tuned"]), "studies.causes.observers", "have an SVSF",
    ),
    **{
        f"bounds of {name}": (search(**{name: [1, 0.1]}), f"searches.calibrated.{name}", "and rise")
        for name in ("process_noise", "position_noise", "velocity_noise", "acceleration_noise",
                     "leave")
    },
    "surely leaves": (search(leave=[0.1, 0.95]), "searches.calibrated.leave", "must stay below 1"),
    "a spread of all": (search(spread=1), "searches.calibrated.spread", "must be 0.99 or less"),
    "unknown scenario": (search(scenario="stpe"), "searches.calibrated", "did you mean 'step'"),
}  # fmt: skip


@pytest.mark.nightly_after(45)
@pytest.mark.parametrize("case", BAD_CONFIG)
def test_invalid_value_is_reported_in_one_sentence(case: str) -> None:
    changes, key, said = BAD_CONFIG[case]
    with pytest.raises(InputError) as caught:
        check_parameters(parameters(changes))
    # An entry of a list is named with its position.
    assert re.sub(r"\.\d+$", "", caught.value.parameter) == f"imm.{key}"
    assert said in caught.value.problem
    assert "\n" not in str(caught.value)


def test_config_is_accepted() -> None:
    check_parameters(parameters())
