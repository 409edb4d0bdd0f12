"""One cause changed at a time: frozen gains, and the numbers of the figures."""

from __future__ import annotations

from copy import deepcopy
from functools import cache
from typing import Any, cast

import numpy as np
import pytest
import scipy.stats
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.observers.gaussian_filter import GaussianFilter
from reobserve.observers.gaussian_state import Correction, Gaussian
from reobserve.observers.imm import IMM
from reobserve.observers.kalman import KalmanFilter
from reobserve.observers.smooth_variable_structure import SmoothVariableStructureFilter
from reobserve_papers.metrics.study_table import StudyTable
from reobserve_papers.papers.imm import keys, study, study_causes
from reobserve_papers.papers.imm.null import RandomGainFilter, random_shares
from reobserve_papers.papers.imm.setup import bank, measured_columns, run
from reobserve_papers.papers.imm.study_causes import corrected_shares, mean_gains
from reobserve_papers.papers.imm.study_rows import (
    FROZEN,
    INTACT,
    KALMAN,
    KINDS,
    SCANNED,
    STATED,
    WEIGHTED,
    ZERO_RATE,
)
from reobserve_papers.parameters.job import read_job
from tests.reobserve_papers.papers.imm.test_paper import Tree, measured, parameters, record

Array = NDArray[np.float64]

VARIANTS = (INTACT, KALMAN, FROZEN, ZERO_RATE)


@cache
def settings() -> Tree:
    return parameters().settings("study", "causes")


def rows(scales: list[float] | None = None, **changed: Any) -> StudyTable:
    given = deepcopy(settings())
    given["study"]["scales"] = scales or []
    for name, body in given["observers"].items():
        if name.startswith("svsf"):
            body.update(changed)
    return StudyTable.of(
        study.run(read_job(keys.Parameters, given), record("velocity_step")), KINDS
    )


class Recorder:
    """A filter of a bank that records the gain of each correction from the change of the mean."""

    def __init__(self, one: GaussianFilter) -> None:
        self.inner, self.model = one, one.model
        self.gains: list[Array] = []
        self.last: tuple[Array, Array] | tuple[()] = ()

    def predict(self, posterior: Gaussian, u: Array) -> Gaussian:
        return self.inner.predict(posterior, u)

    def correct(self, posterior: Gaussian, y: Array, u: Array) -> Correction:
        found = self.inner.correct(posterior, y, u)
        moved = self.model.C @ (found.posterior.mean - posterior.mean)  # C C^+ = I
        self.gains.append(np.linalg.pinv(self.model.C) * (moved / found.innovation))
        return found


class OfMixedState(Recorder):
    """An SVSF whose e(k|k) belongs to the mixed state, and not to its own by (18)."""

    def predict(self, posterior: Gaussian, u: Array) -> Gaussian:
        ahead, error = self.inner.predict(posterior, u), posterior.error
        if self.last:
            y, held = self.last
            error = y - self.model.C @ posterior.mean - self.model.D @ held
        return Gaussian(ahead.mean, ahead.covariance, error)

    def correct(self, posterior: Gaussian, y: Array, u: Array) -> Correction:
        self.last = y, u
        return self.inner.correct(posterior, y, u)


def test_thin_layers_miss_the_leak_with_the_error_of_the_mixed_state() -> None:
    job = read_job(keys.Parameters, deepcopy(settings()))
    body, plant = job.observers["svsf_thin_retuned"], record("velocity_step")
    one = bank(job.plant, body, plant.step)
    filters = [OfMixedState(cast(SmoothVariableStructureFilter, each)) for each in one.filters]
    measurements = plant["measured"][1:, measured_columns(body)]
    found = run(IMM(filters, one.transition), body, measurements, plant["input"][:-1])
    late = plant.time[1:] > 7.0
    assert np.mean(found["probability"][late, 2]) == pytest.approx(0.099, abs=1e-3)


def test_mean_gains_agree_with_the_corrections() -> None:
    job = read_job(keys.Parameters, deepcopy(settings()))
    body, plant = job.observers["svsf_thin_retuned"], record("velocity_step")
    one = bank(job.plant, body, plant.step)
    measurements, held = plant["measured"][1:, measured_columns(body)], plant["input"][:-1]
    part = slice(900, 1150)  # around the leak
    measurements, held = measurements[part], held.reshape(-1)[part]
    filters = [Recorder(cast(SmoothVariableStructureFilter, each)) for each in one.filters]
    found = run(IMM(filters, one.transition), body, measurements, held)
    late = np.arange(len(held)) >= 120
    assert np.ptp(filters[0].gains[100:], axis=0).max() > 1e-3  # precondition: they change
    for each, gain in zip(filters, mean_gains(one, found["innovation"], late), strict=True):
        np.testing.assert_allclose(gain, np.mean(each.gains[120:], axis=0), rtol=1e-6, atol=1e-15)


def test_effective_gain_makes_the_nearest_corrections() -> None:
    """Of all constant shares s, sum(s_k e^2) / sum(e^2) has the smallest sum of (s - s_k)^2 e^2."""
    job = read_job(keys.Parameters, deepcopy(settings()))
    body = job.observers["svsf_thin_retuned"]
    one = bank(job.plant, body, 5e-3)
    innovation = np.random.default_rng(1).standard_normal((50, 3, 3)) * [1.0, 10.0, 100.0]
    late = np.arange(50) >= 20
    effective = mean_gains(one, innovation, late, weighted=True)
    for j, each in enumerate(one.filters):
        C = cast(SmoothVariableStructureFilter, each).model.C
        shares = corrected_shares(each, innovation[:, j])[late]
        assert np.ptp(shares, axis=0).min() > 0.1  # precondition
        e = innovation[late, j]
        made = shares * e
        fitted = [np.linalg.lstsq(e[:, [o]], made[:, o])[0][0] for o in range(3)]
        np.testing.assert_allclose(C @ effective[j], np.diag(fitted), rtol=1e-9, atol=1e-12)


def test_effective_gain_without_innovations_is_the_mean() -> None:
    job = read_job(keys.Parameters, deepcopy(settings()))
    one = bank(job.plant, job.observers["svsf_thin_retuned"], 5e-3)
    nothing = np.zeros((5, 3, 3))
    both = [
        mean_gains(one, nothing, np.full(5, True), weighted=weighted) for weighted in (False, True)
    ]
    np.testing.assert_array_equal(*both)


def test_random_gains_are_those_of_the_filter_and_spread_over_all_shares() -> None:
    job = read_job(keys.Parameters, deepcopy(settings()))
    body, plant = job.observers["svsf_thin_retuned"], record("velocity_step")
    one = bank(job.plant, body, plant.step)
    measurements, held = plant["measured"][1:, measured_columns(body)], plant["input"][:-1]
    random = [RandomGainFilter(cast(KalmanFilter, each).model) for each in one.filters]
    recorded = [Recorder(each) for each in random]
    part = slice(900, 1150)
    found = run(IMM(recorded, one.transition), body, measurements[part], held.reshape(-1)[part])
    for j, each in enumerate(random):
        shares = random_shares(found["innovation"][:, j])
        gains = np.linalg.pinv(each.model.C) * shares[:, None]
        np.testing.assert_allclose(recorded[j].gains, gains, rtol=1e-6, atol=1e-12)
    shares = random_shares(np.random.default_rng(2).standard_normal(20_000))
    assert scipy.stats.kstest(shares, "uniform").pvalue > 1e-3
    assert abs(np.corrcoef(shares[1:], shares[:-1])[0, 1]) < 0.03
    np.testing.assert_array_equal(random_shares(-shares), random_shares(shares))


def test_unmodified_and_kalman_rows_agree_with_the_figure() -> None:
    found, numbers = rows(), measured("fig5_switching")
    for svsf in ("svsf_retuned", "svsf_thin_retuned"):
        for variant, name in ((INTACT, svsf), (KALMAN, "kalman_retuned")):
            for quantity, metric in (
                ("normal_after", "normal_after"),
                ("fault_after", "leakage_after"),
            ):
                value = found.value(observer=svsf, sweep=variant, quantity=quantity)
                assert value == pytest.approx(numbers[name, metric], rel=1e-12, abs=1e-15)
        for quantity in ("saturation_fraction", "chattering_fraction"):
            value = found.value(observer=svsf, sweep=INTACT, quantity=quantity)
            assert value == pytest.approx(numbers[svsf, quantity], rel=1e-12)


def test_freezing_constant_gains_changes_nothing() -> None:
    """At the plateau of the thin layers no innovation changes: nothing switches there."""
    found = rows().where(observer="svsf_thin_retuned", quantity="fault_after")
    whole, frozen = found.value(sweep=INTACT), found.value(sweep=FROZEN)
    assert frozen == pytest.approx(whole, abs=1e-9)
    wide = rows().where(observer="svsf_retuned", quantity="fault_after")
    assert abs(wide.value(sweep=INTACT) - wide.value(sweep=FROZEN)) > 1e-3  # it does not settle


def test_zero_gamma_changes_nothing_where_it_was_zero() -> None:
    found = rows(convergence_rate=0.0).where(quantity="fault_after", observer="svsf_retuned")
    assert found.value(sweep=ZERO_RATE) == found.value(sweep=INTACT)
    found = rows().where(quantity="fault_after", observer="svsf_retuned")
    assert found.value(sweep=ZERO_RATE) != found.value(sweep=INTACT)


def test_rows_are_ordered_by_svsf_scale_and_variant() -> None:
    found = rows([1e-3, 1.0])
    wanted = [
        (name, variant, scale, number)
        for name, scale, number in (
            ("svsf_retuned", 1.0, STATED), ("svsf_thin_retuned", 1.0, STATED),
            ("svsf_retuned", 1e-3, SCANNED), ("svsf_retuned", 1.0, SCANNED),
        )
        for variant in VARIANTS
    ]  # fmt: skip
    columns = ("observer", "sweep", "level", "run")
    said = list(zip(*(found[name].tolist() for name in columns), strict=True))
    assert sorted(dict.fromkeys(said)) == sorted(wanted)
    stated = found.where(run=STATED, observer="svsf_retuned")["value"]
    np.testing.assert_array_equal(found.where(run=SCANNED, level=1.0)["value"], stated)


def test_rows_of_frozen_gains_agree_with_those_of_the_causes() -> None:
    given = parameters().settings("study", "frozen")
    found = StudyTable.of(
        study.run(read_job(keys.Parameters, given), record("velocity_step")), KINDS
    )
    assert set(found["sweep"]) == {INTACT, FROZEN, WEIGHTED}
    svsfs = ["svsf_retuned", "svsf_thin_retuned"]
    assert set(found["observer"]) == {*svsfs, *(f"random_gain_{name}" for name in svsfs)}
    causes = rows()
    for name in svsfs:
        for quantity in ("normal_after", "fault_after"):
            for variant in (INTACT, FROZEN):
                where = {"observer": name, "sweep": variant, "quantity": quantity}
                assert found.value(**where) == causes.value(**where)
    # The layers of an SVSF only say which innovations of random gains are outside.
    for variant in (INTACT, FROZEN, WEIGHTED):
        one, other = (
            found.value(observer=f"random_gain_{name}", sweep=variant, quantity="fault_after")
            for name in svsfs
        )
        assert one == other


def test_rows_do_not_depend_on_the_number_of_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    two = rows([1e-3])
    monkeypatch.setattr(study_causes, "THREADS", 1)
    one = rows([1e-3])
    for column in two.columns:
        np.testing.assert_array_equal(one[column], two[column])


def test_gains_that_cannot_be_frozen_are_refused() -> None:
    without = deepcopy(settings())
    without["observers"] = {"kalman_retuned": without["observers"]["kalman_retuned"]}
    with pytest.raises(InputError, match=r"^study\.observers: must have an SVSF"):
        study.run(read_job(keys.Parameters, without), record("velocity_step"))
    with pytest.raises(InputError, match=r"inverse: must be pseudo"):
        rows(inverse="weighted")
