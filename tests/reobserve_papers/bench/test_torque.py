"""The `torque` task: its records, and methods on a small step of the fault, in closed form."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.linalg import expm
from scipy.signal import lsim

from reobserve.observers.levant import LevantDifferentiator
from reobserve.tuning.task import Array, Condition, Estimates, TaskRecord
from reobserve_papers.bench.packaged_task import PackagedTask
from reobserve_papers.bench.tasks import torque
from tests import ROOT

T, NOISE = 0.02, 3e-4
J = np.array([[36.0, 1.5, 0.0], [1.5, 17.0, 0.0], [0.0, 0.0, 26.0]])
TIME = T * np.arange(201)
ONSET = 50  # row
# So small that w x J w is nothing beside it.
FAULT = 1e-6 * np.array([1.0, -0.7, 0.5])


@cache
def task() -> PackagedTask:
    return PackagedTask.read(ROOT / "config/bench/torque.yaml")


def recorded(seed: int, plant: Any, **condition: Any) -> TaskRecord:
    return torque.simulate(plant, Condition("c", **condition), seed, T)


def test_record_solves_eulers_equation() -> None:
    """By an adaptive method, with sines, which have no jumps."""
    plant = replace(
        task().plant_in("nominal"), noise=1e-12, faults=["sine"], horizon=5.0, faulty=(3, 3)
    )
    record = recorded(5, plant)
    torques = CubicSpline(record.time, record.inputs), record.truth

    def rate(t: float, w: Array) -> Array:
        fault = [np.interp(t, record.time, one) for one in torques[1].T]
        return np.linalg.solve(J, torques[0](t) + fault - np.cross(w, J @ w))

    start = record.measurements[0]
    found = solve_ivp(rate, (0, 5), start, "LSODA", record.time, rtol=1e-9, atol=1e-10,
                      max_step=0.05)  # fmt: skip
    assert np.ptp(found.y, axis=1).min() > 0.02
    assert record.measurements == pytest.approx(found.y.T, abs=3e-5)  # lines in place of sines


def test_drawn_parts_have_the_stated_sizes() -> None:
    plant = replace(task().plant_in("nominal"), noise=1e-12)
    starts, rates = [], []
    for seed in range(40):
        record = recorded(seed, plant)
        starts.append(record.measurements[0])
        u, bent = record.inputs[1:-1], np.diff(record.inputs, 2, axis=0) / T**2
        assert 0.4 < np.abs(u).max() <= 0.5  # half a turn of each sine and more
        rates.append(np.sqrt(-(u * bent).sum(axis=0) / (u * u).sum(axis=0)))  # u'' = -rate^2 u
    assert np.std(starts) == pytest.approx(0.03, rel=0.15)
    assert 0.49 < np.min(rates) < 0.7
    assert 2.7 < np.max(rates) < 3.01
    noisy = recorded(1, task().plant_in("nominal"), noise=2.0).measurements
    off = noisy - recorded(1, plant).measurements
    assert off.std() == pytest.approx(2 * NOISE, rel=0.05)


def test_wrong_model_has_other_moments_about_the_same_axes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bodies = []
    kind = torque.Satellite
    monkeypatch.setattr(torque, "Satellite", lambda J: bodies.append(J) or kind(J))
    for seed in range(1, 9):
        recorded(seed, task().plant_in("nominal"), model=0.1)
    moments, axes = np.linalg.eigh(J)
    found = np.array([axes.T @ one @ axes for one in bodies])
    shares = np.diagonal(found, axis1=1, axis2=2) / moments
    assert np.abs(found - np.eye(3) * found).max() < 1e-12
    assert np.abs(shares - 1).max() <= 0.1
    assert (np.ptp(shares, axis=0) > 0.08).all()
    assert len(np.unique(shares.round(12))) == 24


def test_known_torques_leave_nothing_unexplained() -> None:
    """A body that turns fast under its control alone, to the error of the trapezoidal rule."""
    plant = replace(task().plant_in("nominal"), noise=1e-12, size=(1e-9, 2e-9), control=20.0)
    record = recorded(3, plant)
    assert np.abs(record.measurements).max() > 0.5
    found = torque.unexplained(plant, record, T)
    assert found == pytest.approx(np.tile(record.measurements[0], (501, 1)), abs=3e-4)


def stepped() -> TaskRecord:
    """A small fault from a row on: w = J^-1 f (t - onset)."""
    since = np.maximum(TIME - TIME[ONSET], 0.0)[:, None]
    truth = (TIME[ONSET] <= TIME)[:, None] * FAULT
    return TaskRecord(TIME, np.zeros((201, 3)), since * np.linalg.solve(J, FAULT), truth)


def response(share: Array) -> Array:
    """An estimate whose share of the fault is the same on each axis."""
    return np.asarray(np.concatenate([np.zeros(ONSET), share])[:, None] * FAULT)


def estimated(method: str, settings: dict[str, float]) -> Array:
    plant = task().plant_in("nominal")
    found = torque.METHODS[method](plant, settings, T, NOISE)(stepped())
    return found.values if isinstance(found, Estimates) else found


LATER = TIME[ONSET:] - TIME[ONSET]


def test_adaptive_observer_has_the_response_of_its_gains() -> None:
    """J e' = f - f^ - l J e, f^ = z + p J e, z' = g J e: of second order on each axis."""
    _, share, _ = lsim(([1.5, 6.0], [1.0, 2.0 + 1.5, 6.0]), np.ones(len(LATER)), LATER)
    settings = {"observer_gain": 2.0, "integral": 6.0, "proportional": 1.5}
    assert estimated("adaptive", settings) == pytest.approx(response(share), abs=2e-9)


def test_sampled_learning_observer_follows_its_difference_equation() -> None:
    """e(k+1) = E e(k) + (1 - E) / l (f - v(k)), v(k) = K1 v(k-1) + K2 e(k)."""
    error, v, share = 0.0, 0.0, []
    for _ in LATER:
        v = 0.9 * v + 3.0 * error
        share.append(v)
        keep = np.exp(-2.0 * T)
        error = keep * error + (1.0 - keep) / 2.0 * (1.0 - v)
    settings = {"K1": 0.9, "K2": 3.0, "observer_gain": 2.0}
    assert estimated("sampled_ilo", settings) == pytest.approx(response(np.array(share)), abs=2e-9)


@pytest.mark.parametrize(("interval", "samples"), [(0.057, 3), (0.004, 1)])
def test_learning_observer_solves_its_delay_equation(interval: float, samples: int) -> None:
    """e' = f - v - l e, v(t) = K1 v(t - tau) + K2 e(t), tau in whole samples, by small steps."""
    fine = 100
    step, late = T / fine, samples * fine
    error, v = 0.0, [0.0] * late
    for _ in range((len(LATER) - 1) * fine + 1):
        v.append(0.9 * v[-late] + 3.0 * error)
        error += step * (1.0 - v[-1] - 2.0 * error)
    settings = {"K1": 0.9, "K2": 3.0, "observer_gain": 2.0, "interval": interval}
    share = np.array(v[late::fine])
    assert estimated("ilo", settings) == pytest.approx(response(share), abs=3e-9)


def filtered(F: Array, Q: Array, start: Array) -> Array:
    """The fault by a Kalman filter in the plainest form, of s = y."""
    H, x, P, found = np.eye(3, len(F)), np.zeros(len(F)), np.diag(start), []
    for k, y in enumerate(stepped().measurements):
        if k:
            x, P = F @ x, F @ P @ F.T + Q
            K = P @ H.T @ np.linalg.inv(H @ P @ H.T + NOISE**2 * np.eye(3))
            x, P = x + K @ (y - H @ x), P - K @ H @ P
        found.append(x[3:6])
    return np.array(found)


def white(drift: Array, density: Array) -> tuple[Array, Array]:
    """Exact discretisation of x' = drift x + white noise, by Van Loan's exponential."""
    n = len(drift)
    whole = expm(T * np.block([[-drift, density], [np.zeros((n, n)), drift.T]]))
    F = whole[n:, n:].T
    return F, F @ whole[:n, n:]


def test_random_walk_agrees_with_a_filter_in_its_plainest_form() -> None:
    F = np.eye(6)
    F[:3, 3:] = T * np.linalg.inv(J)
    Q = np.diag([0.004**2 * T] * 3 + [0.8**2 * T] * 3)
    start = np.repeat([NOISE**2, 0.0], 3)
    found = estimated("random_walk", {"walk": 0.8, "process": 0.004})
    assert found == pytest.approx(filtered(F, Q, start), abs=1e-12)


def test_filter_with_a_rate_agrees_with_a_filter_in_its_plainest_form() -> None:
    """The fault is an integral of its rate, and the rate a random walk."""
    drift, density = np.zeros((9, 9)), np.zeros((9, 9))
    drift[:3, 3:6], drift[3:6, 6:] = np.linalg.inv(J), np.eye(3)
    density[6:, 6:] = 2.5**2 * np.eye(3)
    F, Q = white(drift, density)
    Q[:3], Q[:, :3] = 0.0, 0.0  # the noise of s is that of ``process`` alone
    Q[:3, :3] = 0.004**2 * T * np.eye(3)
    start = np.repeat([NOISE**2, 0.0, 0.0], 3)
    found = estimated("with_a_rate", {"walk": 2.5, "process": 0.004})
    assert found == pytest.approx(filtered(F, Q, start), abs=1e-12)


def test_bank_without_jumps_is_a_filter_of_each_axis_in_its_plainest_form() -> None:
    """J s = z of an axis, z(k+1) = z + T f, f(k+1) = f + T f'; the noise of z is that of J y."""
    settings = {"drift": 2.5, "jump": 1.0, "rate": 1e-300, "burst": 0.1}
    plant, record = task().plant_in("nominal"), task().record("nominal", 1)
    found = torque.fault_bank(plant, settings, T, NOISE)(record)
    assert isinstance(found, Estimates)
    z, T2, T3 = torque.unexplained(plant, record, T) @ J.T, T**2 / 2, T**3 / 3
    F, H = np.array([[1, T, 0], [0, 1, T], [0, 0, 1]]), np.array([1.0, 0.0, 0.0])
    Q = 2.5**2 * np.array([[0, 0, 0], [0, T3, T2], [0, T2, T]])
    for i in range(3):
        R = NOISE**2 * J[i] @ J[i]
        x, P = np.array([z[0, i], 0.0, 0.0]), np.diag([R, 0.0, 0.0])
        for k in range(len(z)):
            if k:
                x, P = F @ x, F @ P @ F.T + Q
            K = P @ H / (P[0, 0] + R)
            x, P = x + K * (z[k, i] - x[0]), P - np.outer(K, H @ P)
            assert found.values[k, i] == pytest.approx(x[1], abs=1e-9)
            assert found.covariances[k, i] == pytest.approx(P[1, 1], abs=1e-9)


def test_bank_follows_a_jump_at_once_and_a_constant_closely() -> None:
    """A step of 1 N m: as fast as a fast random walk, and as quiet as a slow one before."""
    settings = {"drift": 0.15, "jump": 2.0, "rate": 0.1, "burst": 0.15}
    plant = replace(task().plant_in("nominal"), faults=["step"], size=(1.0, 1.1), faulty=(3, 3))
    bank, walk = [], []
    for seed in range(1, 5):
        record = recorded(seed, plant)
        for made, errors in (
            (torque.fault_bank(plant, settings, T, NOISE), bank),
            (torque.METHODS["random_walk"](plant, {"walk": 0.35, "process": 2e-6}, T, NOISE), walk),
        ):
            found = made(record)
            assert isinstance(found, Estimates)
            errors.append(np.sqrt(((found.values - record.truth) ** 2).mean()))
    assert np.mean(bank) < 0.8 * np.mean(walk)


def test_estimated_noise_is_that_of_the_record() -> None:
    """At five times the noise: as if it were given, and far better than if it were not."""
    plant = replace(task().plant_in("nominal"), faults=["ramp"])
    record = recorded(3, plant, noise=5.0)
    for method, settings in (
        ("random_walk", {"walk": 0.35, "process": 2e-6}),
        ("fault_bank", {"drift": 0.15, "jump": 2.0, "rate": 0.1, "burst": 0.15}),
    ):
        errors = []
        for noise, more in ((5 * NOISE, {}), (NOISE, {"memory": 2.0}), (NOISE, {})):
            found = torque.METHODS[method](plant, settings | more, T, noise)(record)
            assert isinstance(found, Estimates)
            errors.append(np.sqrt(((found.values - record.truth) ** 2)[100:].mean()))
        given, estimated, nominal = errors
        assert estimated == pytest.approx(given, rel=0.2)
        assert nominal > 1.5 * estimated


def test_smoothed_walk_has_half_the_error_and_the_last_row_of_the_filter() -> None:
    """Inside a long record the smoother of a random walk has half the variance of the filter."""
    settings = {"walk": 0.35, "process": 2e-6}
    plant = task().plant_in("nominal")
    record = recorded(2, plant)
    filtered_, smooth = (
        torque.METHODS[name](plant, settings, T, NOISE)(record)
        for name in ("random_walk", "smoothed")
    )
    assert isinstance(filtered_, Estimates)
    assert isinstance(smooth, Estimates)
    assert smooth.values[-1] == pytest.approx(filtered_.values[-1], abs=1e-12)
    before, after = (np.einsum("kii->ki", one.covariances[200:300]) for one in (filtered_, smooth))
    assert (after < 0.5 * before).all()


def test_filtered_difference_rises_exponentially() -> None:
    found, share = estimated("filtered_difference", {"lag": 0.3}), 1.0 - np.exp(-LATER / 0.3)
    assert found == pytest.approx(response(share), abs=1e-12)


def test_differentiators_have_their_bound_over_the_moment_of_inertia() -> None:
    found, y = estimated("levant", {"L": 2e-5, "lambda0": 2.0}), stepped().measurements
    rates = [
        LevantDifferentiator(
            L=2e-5 / J[i, i], order=2, lambdas=(2.0, 1.5, 1.1), sampling_period=T
        ).run(y[:, i])
        for i in range(3)
    ]
    expected = np.column_stack([run["derivatives"][:, 1] for run in rates]) @ J
    assert found == pytest.approx(expected, abs=1e-12)
    assert found[-1] == pytest.approx(FAULT, rel=0.08)


def test_each_method_has_a_test() -> None:
    assert set(torque.METHODS) == {
        "adaptive", "sampled_ilo", "ilo", "random_walk", "smoothed", "with_a_rate", "fault_bank",
        "filtered_difference", "levant",
    }  # fmt: skip
