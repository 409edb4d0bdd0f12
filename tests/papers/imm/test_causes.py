"""One cause changed at a time: halves of filters, gains that are held, and the figures' numbers."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.observers.imm import IMM
from reobserve.observers.kalman import KalmanFilter
from reobserve.observers.smooth_variable_structure import SmoothVariableStructureFilter
from reobserve.papers.imm import keys, study, study_causes
from reobserve.papers.imm.hybrid_bank import KALMAN, LAW, HybridRun, run_hybrid
from reobserve.papers.imm.metrics import measure
from reobserve.papers.imm.study_causes import VARIANTS, variants
from reobserve.papers.imm.study_rows import (
    HEADER,
    HELD,
    INSIDE,
    KINDS,
    NO_MEMORY,
    OUTSIDE,
    SCANNED,
    STATED,
)
from reobserve.replication.metrics.study_table import StudyTable
from reobserve.replication.parameters.figure_data import FigureData
from reobserve.replication.parameters.job import read_job
from reobserve.systems.linear import LinearModel
from tests.papers.imm.test_paper import Tree, ledger, measured, record

Array = NDArray[np.float64]

# --- A bank of halves ---------------------------------------------------------------------------

A, B, H = np.array([[0.9, 0.3], [-0.2, 0.8]]), np.array([[0.1], [0.4]]), np.array([[1.0, 0.5]])
PSI, GAMMA = 0.7, 0.2
MODELS = [
    LinearModel(A, B, H, Q=[0.02, 0.03], R=[0.1], sampling_period=1.0),
    LinearModel(0.7 * A, B, H, Q=[0.02, 0.03], R=[0.1], sampling_period=1.0),
]
TRANSITION = np.array([[0.95, 0.05], [0.1, 0.9]])


def bank(mixing: bool, inverse: str = "pseudo") -> IMM:
    filters = [SmoothVariableStructureFilter(model, PSI, GAMMA, inverse) for model in MODELS]
    return IMM(filters, TRANSITION, mixing)


def a_record() -> tuple[Array, Array]:
    """Measurements of the first model and then the second one, and the inputs up to them."""
    stream = np.random.default_rng(1)
    held, x, rows = np.sign(stream.normal(size=60)), np.zeros(2), []
    for k, u in enumerate(held):
        x = (A if k < 30 else 0.7 * A) @ x + B[:, 0] * u + 0.1 * stream.normal(size=2)
        rows.append(H @ x + 0.3 * stream.normal(size=1))
    return np.array(rows), held


def halves(mixing: bool, gain: int, covariance: int, inverse: str = "pseudo") -> HybridRun:
    y, held = a_record()
    one = bank(mixing, inverse)
    return run_hybrid(
        one,
        gain,
        covariance,
        one.init([0.0, 0.0], 0.5, u=held[:1]),
        y,
        np.append(held, 0.0)[:, None],
    )


@pytest.mark.parametrize("inverse", ["pseudo", "weighted"])
@pytest.mark.parametrize("mixing", [True, False])
def test_with_both_halves_of_one_kind_it_is_the_bank_of_that_kind(
    mixing: bool, inverse: str
) -> None:
    """To the last bit."""
    y, held = a_record()
    kalman = IMM([KalmanFilter(model) for model in MODELS], TRANSITION, mixing)
    for one, kind in ((kalman, KALMAN), (bank(mixing, inverse), LAW)):
        state = one.init([0.0, 0.0], 0.5, u=held[:1])
        wanted = one.run(y, np.append(held[1:], 0.0), state=state)
        found = halves(mixing, kind, kind, inverse)
        np.testing.assert_array_equal(found.probability, wanted["probability"])
        np.testing.assert_array_equal(found.innovation, wanted["innovation"])


def by_hand(gain: int, covariance: int) -> Array:
    """Mode probabilities with mixing, by the equations as they stand."""
    y, held = a_record()
    means, errors = [np.zeros(2)] * 2, [np.zeros(1)] * 2
    spreads = [[0.5 * np.eye(2)] * 2, [0.5 * np.eye(2)] * 2]  # by Kalman's gain, by the SVSF's
    mu, rows = np.array([0.5, 0.5]), []
    for z, u in zip(y, held, strict=True):
        weight = TRANSITION * mu[:, None]
        reached = weight.sum(axis=0)
        weight = weight / reached
        mixed = [weight[0, j] * means[0] + weight[1, j] * means[1] for j in range(2)]
        wide = [
            [
                sum(
                    weight[i, j] * (kind[i] + np.outer(means[i] - mixed[j], means[i] - mixed[j]))
                    for i in range(2)
                )
                for j in range(2)
            ]
            for kind in spreads
        ]
        likelihood = np.zeros(2)
        for j, model in enumerate(MODELS):
            F, G, C, _, Q, R = model.arrays
            x = F @ mixed[j] + G[:, 0] * u
            P = [F @ kind[j] @ F.T + Q for kind in wide]
            S = [C @ one @ C.T + R for one in P]
            e = z - C @ x
            share = (abs(e) + GAMMA * abs(errors[j])) / np.maximum(abs(e), PSI)
            K = [P[0] @ C.T @ np.linalg.inv(S[0]), np.linalg.pinv(C) * share]
            likelihood[j] = np.exp(-0.5 * e @ np.linalg.solve(S[covariance], e)) / np.sqrt(
                2 * np.pi * np.linalg.det(S[covariance])
            )
            x = x + K[gain] @ e
            means[j], errors[j] = x, z - C @ x
            for kind in range(2):
                left = np.eye(2) - K[kind] @ C
                spreads[kind][j] = left @ P[kind] @ left.T + K[kind] @ R @ K[kind].T
        means, errors = list(means), list(errors)
        mu = likelihood * reached
        mu = mu / mu.sum()
        rows.append(mu)
    return np.array(rows)


@pytest.mark.parametrize("gain", [KALMAN, LAW])
@pytest.mark.parametrize("covariance", [KALMAN, LAW])
def test_halves_by_hand(gain: int, covariance: int) -> None:
    found = halves(True, gain, covariance).probability
    np.testing.assert_allclose(found, by_hand(gain, covariance), rtol=1e-9, atol=1e-12)
    other = halves(True, gain, 1 - covariance).probability
    assert np.abs(found - other).max() > 0.01  # a guard: it matters


def test_the_mean_gain_is_the_one_of_the_law() -> None:
    """Over the rows, from the innovations and what is left of them."""
    found = halves(True, LAW, LAW)
    inverse = np.linalg.pinv(H)
    for j in range(2):
        e, left, total = found.innovation[:, j, 0], 0.0, 0.0
        for row in e:
            share = (abs(row) + GAMMA * abs(left)) / max(abs(row), PSI)
            left = row * (1 - share)  # H H+ = 1
            total += share
        np.testing.assert_allclose(found.mean_gain[j], inverse * total / len(e), rtol=1e-9)


def test_without_saturation_the_gain_goes_on_as_within_the_layer() -> None:
    y, held = a_record()
    one = bank(True)
    state, inputs = one.init([0.0, 0.0], 0.5, u=held[:1]), np.append(held, 0.0)[:, None]
    wide = run_hybrid(one, LAW, LAW, state, y, inputs, unsaturated=np.array([PSI]))
    assert np.abs(wide.innovation).max() > PSI  # some of them lie outside
    for j in range(2):
        left, total = 0.0, 0.0
        for row in wide.innovation[:, j, 0]:
            share = (abs(row) + GAMMA * abs(left)) / PSI
            left = row * (1 - share)
            total += share
        wanted = np.linalg.pinv(H) * total / len(y)
        np.testing.assert_allclose(wide.mean_gain[j], wanted, rtol=1e-9)


def test_a_bank_that_leaves_the_floats_ends_there() -> None:
    y, held = a_record()
    one = bank(True)
    state, inputs = one.init([0.0, 0.0], 0.5, u=held[:1]), np.append(held, 0.0)[:, None]
    lost = run_hybrid(one, LAW, LAW, state, y, inputs, unsaturated=np.array([1e-3]))
    assert 0 < len(lost.probability) < len(y)
    assert np.isfinite(lost.probability).all()


# --- The study ----------------------------------------------------------------------------------


@cache
def settings(name: str) -> Tree:
    return ledger().settings("study", name)


def rows(name: str, scenario: str, **changed: Any) -> StudyTable:
    told = deepcopy(settings(name))
    told["study"].update({"units": [], **changed})
    return StudyTable.of(study.run(told, record(scenario)), KINDS)


def test_the_whole_and_kalman_are_the_numbers_of_the_figures() -> None:
    found = rows("causes", "step").where(run=STATED)
    for figure, svsf in (("fig5", "svsf_tuned"), ("fig7", "svsf_thin_tuned")):
        numbers = measured(figure)
        for variant, name in (("whole", svsf), ("kalman", "kalman_tuned")):
            for quantity, metric in (
                ("normal_after", "normal_after"),
                ("fault_after", "leakage_after"),
                ("fault_spread", "leakage_spread"),
            ):
                value = found.value(observer=svsf, sweep=variant, quantity=quantity)
                assert value == pytest.approx(numbers[name, metric], rel=1e-12, abs=1e-15)
        value = found.value(observer=svsf, sweep="whole", quantity="outside_share")
        assert value == numbers[svsf, "outside_share"]


def test_rows_by_svsf_then_unit_then_variant() -> None:
    found = rows("causes", "step", units=[1e-3, 1.0])
    wanted = [
        (name, variant, unit, number)
        for name, unit, number in (
            ("svsf_tuned", 1.0, STATED), ("svsf_thin_tuned", 1.0, STATED),
            ("svsf_tuned", 1e-3, SCANNED), ("svsf_tuned", 1.0, SCANNED),
        )
        for variant in VARIANTS
    ]  # fmt: skip
    told = zip(
        *(found[name].tolist() for name in ("observer", "sweep", "level", "run")), strict=True
    )
    assert list(dict.fromkeys(told)) == wanted
    stated = found.where(run=STATED, observer="svsf_tuned")["value"]
    np.testing.assert_array_equal(found.where(run=SCANNED, level=1.0)["value"], stated)


def test_rows_are_the_same_on_one_thread_and_two(monkeypatch: pytest.MonkeyPatch) -> None:
    two = rows("causes", "step", units=[1e-3])
    monkeypatch.setattr(study_causes, "THREADS", 1)
    one = rows("causes", "step", units=[1e-3])
    for column in two.columns:
        np.testing.assert_array_equal(one[column], two[column])


def plain_variants(**changed: Any) -> dict[str, HybridRun | None]:
    """Of the first half second of the plain setting, with all the noise and an input."""
    job = read_job(keys.Ledger, deepcopy(settings("causes_plain")))
    body = replace(job.observers["svsf"], **changed)
    plant = record("plain")
    part = slice(500, 1000)
    told, held = plant["measured"][1:][part, :3], plant["input"][:-1].reshape(-1)[part]
    return dict(variants(job.plant, body, plant.step, np.ascontiguousarray(told), held))


def same(one: HybridRun | None, other: HybridRun | None) -> bool:
    assert one is not None
    assert other is not None
    return bool(np.allclose(one.probability, other.probability, rtol=1e-9, atol=1e-12))


def test_a_gain_that_does_not_change_is_held_where_it_is() -> None:
    """Outside of all layers and without memory every output is corrected in full."""
    found = plain_variants(memory=0.0, layer_unit=1e-12)
    assert same(found["whole"], found[HELD])
    assert same(found["whole"], found[OUTSIDE])
    changes = plain_variants(memory=0.1, layer_unit=1e-4)
    assert not same(changes["whole"], changes[HELD])
    assert not same(changes["whole"], changes[OUTSIDE])


def test_within_wide_layers_saturation_is_never_met() -> None:
    wide, thin = plain_variants(layer_unit=1.0), plain_variants(layer_unit=2e-4)
    for found, equal in ((wide, True), (thin, False)):
        whole, inside = found["whole"], found[INSIDE]
        assert whole is not None
        assert inside is not None
        count = len(inside.probability)
        assert np.array_equal(whole.probability[:count], inside.probability) is equal


def test_no_memory_is_a_memory_of_zero() -> None:
    with_it, without = plain_variants(layer_unit=1e-4), plain_variants(layer_unit=1e-4, memory=0.0)
    assert same(with_it[NO_MEMORY], without["whole"])
    assert not same(with_it["whole"], without["whole"])


def test_without_saturation_thin_layers_diverge_and_wide_ones_do_not() -> None:
    found = rows("causes", "step", units=[1e-5, 1.0]).where(sweep=INSIDE)
    assert np.isnan(found.where(level=1e-5)["value"]).all()
    assert np.isfinite(found.where(level=1.0)["value"]).all()


def test_gains_that_are_not_stable_are_not_held() -> None:
    y, held = a_record()
    job = read_job(keys.Ledger, deepcopy(settings("causes")))
    gains = np.full((2, 2, 1), 9.0)
    assert study_causes.held_gains(bank(True), job.observers["svsf_tuned"], gains, y, held) is None


def test_a_study_without_an_svsf_is_none() -> None:
    told = deepcopy(settings("causes"))
    told["observers"] = {"kalman_tuned": told["observers"]["kalman_tuned"]}
    with pytest.raises(InputError, match=r"^study\.observers: must have an SVSF"):
        study.run(told, record("step"))


@pytest.mark.parametrize(
    ("variant", "told"), [("gain", False), ("covariance", False), ("whole", True)]
)
def test_a_bank_of_halves_that_flips_tells_no_number(variant: str, told: bool) -> None:
    def numbers(spread: float) -> dict[str, float]:
        values = {"normal_after": 0.3, "fault_after": 0.6, "fault_spread": spread}
        cells = [
            dict(zip(HEADER, ("svsf_tuned", variant, 1.0, run, name, value, "1"), strict=True))
            for run in (STATED, SCANNED)
            for name, value in values.items()
        ]
        job = read_job(keys.Ledger, ledger().settings("plot", "fig8_causes"))
        data = FigureData(job, record("step"), {}, StudyTable.of(cells, KINDS))
        return {one.metric: one.value for one in measure(data)}

    at = f"variant={variant}"
    assert numbers(0.1) == {f"normal_after {at}": 0.3, f"fault_after {at}": 0.6}
    assert np.isnan(numbers(0.11)[f"fault_after {at}"]) == (not told)
