"""The `vdp` task: its records, and methods against an adaptive integrator and a plain filter."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from reobserve.observers.levant import LevantDifferentiator
from reobserve.observers.normal_form import IdentityObserver
from reobserve.synthesis.normal_form.transform import normal_form
from reobserve.tuning.task import Array, Condition, Estimates, TaskRecord
from reobserve_papers.bench.packaged_task import PackagedTask
from reobserve_papers.bench.tasks import vdp
from tests import ROOT

T, NOISE = 0.02, 0.05


@cache
def task() -> PackagedTask:
    return PackagedTask.read(ROOT / "config/bench/vdp.yaml")


def plant(**changed: Any) -> Any:
    return replace(task().plant_in("nominal"), **changed)


def recorded(seed: int, stated: Any, **condition: Any) -> TaskRecord:
    return vdp.simulate(stated, Condition("c", **condition), seed, T)


def field(x1: Any, x2: Any) -> tuple[Any, Any]:
    return x2, -x1 + (1.0 - x1**2) * x2


def test_record_without_force_solves_the_differential_equation() -> None:
    record = recorded(3, plant(force=1e-12, noise=1e-12))
    found = solve_ivp(
        lambda _, x: field(*x), (0, 20), record.truth[0], "DOP853", record.time, rtol=1e-10,
        atol=1e-10,
    )  # fmt: skip
    assert record.truth == pytest.approx(found.y.T, abs=3e-6)
    assert record.measurements[:, 0] == pytest.approx(record.truth[:, 0], abs=1e-10)
    assert not record.inputs.any()


def test_force_is_held_and_normal() -> None:
    """x2' + x1 - (1 - x1^2) x2 is the force, to the error of a central difference."""
    forces = []
    for seed in range(1, 9):
        x1, x2 = recorded(seed, plant()).truth.T
        found = np.gradient(x2, T)[1:-1] - field(x1, x2)[1][1:-1]
        held = found[:-9].reshape(-1, 10)[:, 1:-1]  # rows 2 to 9 of each ten
        assert np.ptp(held, axis=1).max() < 0.02
        forces.append(held.mean(axis=1))
    assert np.std(forces) == pytest.approx(0.2, rel=0.1)
    noise = recorded(1, plant(), noise=2.0)
    assert np.std(noise.measurements - noise.truth[:, :1]) == pytest.approx(2 * NOISE, rel=0.05)


def test_wrong_model_has_both_parameters_off_by_up_to_the_share() -> None:
    found = []
    for seed in range(1, 9):
        x1, x2 = recorded(seed, plant(force=1e-12), model=0.1).truth.T
        terms = np.column_stack([-x1, (1.0 - x1**2) * x2])[1:-1]
        found.append(np.linalg.lstsq(terms, np.gradient(x2, T)[1:-1])[0])
    assert np.abs(np.array(found) - 1.0).max() < 0.105
    assert (np.ptp(found, axis=0) > 0.1).all()


def test_records_start_anywhere_in_the_square() -> None:
    starts = np.array([recorded(seed, plant(horizon=T)).truth[0] for seed in range(300)])
    assert 1.95 < np.abs(starts).max() <= 2.0
    assert starts.std(axis=0) == pytest.approx(2.0 / np.sqrt(3.0), rel=0.06)


def estimated(method: str, settings: dict[str, float], record: TaskRecord) -> Array:
    found = vdp.METHODS[method](plant(), settings, T, NOISE)(record)
    return found.values if isinstance(found, Estimates) else found


def test_extended_filter_agrees_with_a_filter_in_its_plainest_form() -> None:
    record = recorded(2, plant(horizon=4.0))
    y = record.measurements[:, 0]

    def ahead(x: Array) -> Array:
        k1 = np.array(field(*x))
        k2 = np.array(field(*(x + T / 2 * k1)))
        k3 = np.array(field(*(x + T / 2 * k2)))
        k4 = np.array(field(*(x + T * k3)))
        return np.asarray(x + T / 6 * (k1 + 2 * k2 + 2 * k3 + k4))

    x, P, found = np.array([y[0], 0.0]), np.diag([NOISE**2, 2.0**2 / 3]), []
    for k, one in enumerate(y):
        if k:
            small = 1e-6 * np.eye(2)
            F = np.column_stack([(ahead(x + d) - ahead(x - d)) / 2e-6 for d in small])
            x, P = ahead(x), F @ P @ F.T + np.diag([0.02, 0.3]) ** 2 * T
        K = P[:, 0] / (P[0, 0] + NOISE**2)
        x, P = x + K * (one - x[0]), P - np.outer(K, P[0])
        found.append(x)
    settings = {"x1": 0.02, "x2": 0.3}
    assert estimated("ekf", settings, record) == pytest.approx(np.array(found), abs=1e-6)
    # Where both know the state well, the unscented filter has the same estimates.
    late = record.time > 2.0
    other = estimated("ukf", settings, record)[late]
    assert other == pytest.approx(np.array(found)[late], abs=5e-3)


def test_parameters_as_states_are_those_of_the_model_if_they_are_certain() -> None:
    record, process = recorded(2, plant(horizon=4.0)), {"x1": 0.02, "x2": 0.3}
    for method in ("ekf", "ukf"):
        found = estimated(method, process | {"spread": 1e-9}, record)
        assert found == pytest.approx(estimated(method, process, record), abs=1e-6)


def test_parameters_as_states_make_up_for_a_wrong_model() -> None:
    """Without force: the error of the states falls to that of a filter of the right model."""
    process, late = {"x1": 1e-3, "x2": 0.01}, slice(500, None)
    errors = {}
    for name, more, model in (
        ("right", {}, 0.0), ("wrong", {}, 0.2), ("states", {"spread": 0.116}, 0.2),
    ):  # fmt: skip
        found = []
        for seed in (3, 4, 5):
            record = recorded(seed, plant(force=1e-12), model=model)
            found.append(estimated("ekf", process | more, record) - record.truth)
        errors[name] = np.sqrt(np.square(np.array(found)[:, late]).mean())
    assert errors["wrong"] > 3 * errors["right"]
    assert errors["states"] < 1.5 * errors["right"]


def test_estimated_noise_is_that_of_the_record() -> None:
    process, errors = {"x1": 1e-3, "x2": 0.09}, []
    record = recorded(2, plant(), noise=3.0)
    for noise, more in ((3 * NOISE, {}), (NOISE, {"memory": 5.0}), (NOISE, {})):
        found = vdp.METHODS["ekf"](plant(), process | more, T, noise)(record)
        assert isinstance(found, Estimates)
        errors.append(np.sqrt(((found.values - record.truth) ** 2)[200:].mean()))
    given, learned, nominal = errors
    assert learned == pytest.approx(given, rel=0.05)
    assert nominal > 1.1 * learned


def integrated(gains: tuple[float, float], record: TaskRecord) -> Array:
    """x^' = f(x^) + L (y - x^1), from the first measurement."""
    y = CubicSpline(record.time, record.measurements[:, 0])

    def rate(t: float, x: Array) -> Array:
        return np.array(field(*x)) + np.array(gains) * (y(t) - x[0])

    start = [record.measurements[0, 0], 0.0]
    found = solve_ivp(
        rate, (0, record.time[-1]), start, "DOP853", record.time, rtol=1e-8, atol=1e-8,
    )  # fmt: skip
    return np.asarray(found.y.T)


def test_observers_with_constant_gains_solve_their_differential_equation() -> None:
    """With both poles at -3 the gains are 6 and 9; the paper's poles belong to its (-2, -4)."""
    record = recorded(2, plant(horizon=4.0, noise=1e-12))
    found = estimated("high_gain", {"rho": 3.0}, record)
    assert found == pytest.approx(integrated((6.0, 9.0), record), abs=2e-3)
    printed = task().methods["normal_0"].paper
    assert printed is not None
    found = estimated("normal_form", {**printed.settings, "order": 0}, record)
    assert found == pytest.approx(integrated((2.0, 4.0), record), abs=2e-3)


def test_normal_form_and_differentiator_are_those_of_their_settings() -> None:
    record = recorded(2, plant(horizon=4.0))
    pole = 4.0 * complex(-0.6, 0.8)
    form = normal_form(vdp._system(), 3, poles=[pole, pole.conjugate()])
    observer, y = (
        IdentityObserver(form, order=2, gain="series", sampling_period=T),
        record.measurements,
    )
    found = estimated("normal_form", {"frequency": 4.0, "damping": 0.6, "order": 2}, record)
    assert (found == observer.run(y, start=observer.init([y[0, 0], 0.0]))["state"]).all()
    levant = LevantDifferentiator(L=30.0, order=2, lambdas=(2.5, 1.5, 1.1), sampling_period=T)
    found = estimated("levant", {"L": 30.0, "lambda0": 2.5}, record)
    assert (found == levant.run(y[:, 0])["derivatives"][:, :2]).all()


def test_each_method_has_a_test() -> None:
    assert set(vdp.METHODS) == {"ekf", "ukf", "normal_form", "high_gain", "levant"}
