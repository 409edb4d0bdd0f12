"""The `motor` task: its records, and methods on records with known answers."""

from __future__ import annotations

from dataclasses import astuple, replace
from functools import cache
from typing import Any

import control
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from reobserve import AugmentedKalmanFilter, LinearModel
from reobserve.core.discretisation import zero_order_hold
from reobserve.core.errors import InputError
from reobserve.tuning.task import Array, Condition, Estimates, TaskRecord
from reobserve.tuning.task_tuning import _cost
from reobserve_papers.bench.packaged_task import PackagedTask
from reobserve_papers.bench.tasks import motor
from tests import ROOT

FILE = ROOT / "config/bench/motor.yaml"
PERIOD = 0.02
BANK = {"jump": 2.0, "rate": 0.2, "burst": 0.5}
FAST = {
    "pd_pi": {"excess": 0.001, "filter_rate": 400.0},
    "pi": {"excess": 0.001, "filter_rate": 400.0},
    "pi_feasible": {"decay": 10.0, "filter_rate": 400.0},
    "pi_riccati": {"actuator": 1.0, "sensor": 1.0, "process": 0.1, "filter_rate": 100.0},
    "random_walk": {"actuator": 1.0, "sensor": 1.0, "process": 0.01},
    "smoothed": {"actuator": 1.0, "sensor": 1.0, "process": 0.01},
    "fault_bank": BANK | {"drift_actuator": 1.0, "drift_sensor": 1.0},
    "luenberger": {"rate_1": 10.0, "rate_2": 12.0, "rate_3": 30.0, "rate_4": 40.0},
    "inverted": {"lag_actuator": 0.005, "lag_sensor": 0.005},
}


@cache
def task() -> PackagedTask:
    return PackagedTask.read(FILE)


def quiet(**keys: Any) -> Any:
    """The plant with negligible noise and disturbances."""
    return replace(task().plant_in("nominal"), noise=1e-12, disturbance=(1e-12, 1e-12), **keys)


def values(found: Array | Estimates) -> Array:
    return found.values if isinstance(found, Estimates) else found


def recorded(seed: int, plant: Any, **condition: Any) -> TaskRecord:
    return motor.simulate(plant, Condition("c", **condition), seed, PERIOD)


def test_record_solves_the_differential_equation() -> None:
    """By an adaptive method and without random parts; with the slowest sines."""
    record = recorded(5, quiet(faults=["sine"], faulty=(2, 2), onset=(1.0, 1.001)))  # on a row
    J, b, K, R, L = 0.01, 0.1, 0.01, 1.0, 0.5

    def rate(t: float, x: Any) -> list[float]:
        u = 0.5 if t % 4.0 < 2.0 else -0.5
        fault = 0.75 * np.interp(t, record.time, record.truth[:, 0])
        return [(-b * x[0] + K * x[1]) / J, (-K * x[0] - R * x[1] + u + fault) / L]

    found = solve_ivp(rate, (0, 10), [0, 0], "LSODA", record.time, rtol=1e-9, atol=1e-10,
                      max_step=0.01)  # fmt: skip
    expected = found.y.T + np.outer(0.2 * record.truth[:, 1], [1.0, 0.0])
    assert record.measurements == pytest.approx(expected, abs=3e-4)  # lines in place of sines


def test_wrong_model_changes_the_measurements_only() -> None:
    right, wrong = recorded(5, quiet()), recorded(5, quiet(), model=0.1)
    assert (right.truth == wrong.truth).all()
    assert (right.inputs == wrong.inputs).all()
    assert np.abs(right.measurements - wrong.measurements).max() > 0.01


def test_wrong_model_has_each_constant_off_by_up_to_the_stated_share(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bodies, loop = [], motor.ControlledMotor
    monkeypatch.setattr(
        motor, "ControlledMotor", lambda body, *more: bodies.append(body) or loop(body, *more)
    )
    for seed in range(1, 7):
        recorded(seed, quiet(), model=0.1)
    right = np.array(astuple(quiet().motor))[:6]
    shares = np.array([astuple(one)[:6] for one in bodies]) / right
    assert np.abs(shares - 1).max() <= 0.1
    assert (np.ptp(shares, axis=0) > 0.08).all()
    assert len(np.unique(shares.round(12))) == 36


def test_disturbances_and_noise_have_the_stated_sizes() -> None:
    plant = task().plant_in("nominal")
    record, less = recorded(3, plant), recorded(3, replace(plant, noise=1e-12))
    assert (record.measurements - less.measurements).std() == pytest.approx(0.01, rel=0.05)
    alone = less.measurements - recorded(3, quiet()).measurements
    # x' = A x + Dd d: uniform d held for 0.1 s has the deviation a / sqrt(3).
    decay = np.exp(-1.0)
    speed = 0.2 / np.sqrt(3) * 0.1 * (1 - decay) / np.sqrt(1 - decay**2)
    assert alone[::5, 0].std() == pytest.approx(speed, rel=0.25)  # one hundred values


@pytest.mark.parametrize("method", FAST)
def test_methods_find_constant_faults_exactly(method: str) -> None:
    """All methods are exact in the end without noise, disturbance or voltage jumps."""
    plant = quiet(faults=["step"], onset=(0.5, 1.0), turn=40.0, faulty=(2, 2))
    record = recorded(2, plant)
    run = motor.METHODS[method](plant, FAST[method], PERIOD, 0.01)
    assert values(run(record))[-1] == pytest.approx(record.truth[-1], abs=1e-6)
    assert np.abs(record.truth[-1]).min() > 0.2


@pytest.mark.parametrize("method", FAST)
def test_estimates_do_not_react_to_voltage_jumps(method: str) -> None:
    """Exact in discrete time; small in continuous time, where measurements are interpolated."""
    plant = quiet(faults=["ramp"], onset=(9.0, 9.5))
    record = recorded(2, plant)
    estimate = values(motor.METHODS[method](plant, FAST[method], PERIOD, 0.01)(record))
    bound = 1e-8 if method in {"random_walk", "luenberger", "fault_bank"} else 2e-3
    # A smoother sees the ramp before it begins.
    until = 7.0 if method == "smoothed" else 9.0
    assert np.abs(estimate[record.time < until]).max() < bound


def test_random_walk_agrees_with_a_filter_in_its_plainest_form() -> None:
    """The voltage fault acts as the voltage does, that of the speed is in its measurement."""
    body, record = task().plant_in("nominal").motor, task().record("nominal", 1)
    A = np.array([[-body.friction, body.torque_constant], [-body.emf_constant, -body.resistance]])
    A /= np.array([[body.inertia], [body.inductance]])
    held = np.zeros((3, 3))
    held[:2, :2], held[1, 2] = A, 1 / body.inductance
    whole = expm(PERIOD * held)
    F, H = np.eye(4), np.eye(2, 4)
    F[:2, :3], H[0, 3] = whole[:2], 1.0
    Q = np.diag([0.5 * 0.2, 0.5 * 0.2, 0.3, 0.4]) ** 2 * PERIOD  # D = diag(1, 2), d of 0.2 and 0.1
    R, P = 0.02**2 * np.eye(2), np.diag([0.02**2, 0.02**2, 0.0, 0.0])
    x, found = np.array([*record.measurements[0], 0.0, 0.0]), []
    for k, y in enumerate(record.measurements):
        if k:
            x, P = F @ x, F @ P @ F.T + Q
            x[:2] += whole[:2, 2] * record.inputs[k - 1, 0]
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
        x, P = x + K @ (y - H @ x), P - K @ H @ P
        found.append(x[2:])
    plant = task().plant_in("nominal")
    settings = {"actuator": 0.3, "sensor": 0.4, "process": 0.5}
    estimate = values(motor.METHODS["random_walk"](plant, settings, PERIOD, 0.02)(record))
    assert estimate * plant.largest == pytest.approx(np.array(found), abs=1e-9)


def test_bank_without_jumps_is_a_filter_in_its_plainest_form() -> None:
    """[w, i, fa, fs, fa', fs'], and the disturbances as white noise of their variance."""
    record, plant = task().record("nominal", 1), task().plant_in("nominal")
    A, B = zero_order_hold(plant.motor.A, plant.motor.B, PERIOD)
    F, H, T = np.eye(6), np.eye(2, 6), PERIOD
    F[:2, :2], F[:2, 2:3], F[2, 4], F[3, 5], H[0, 3] = A, B, T, T, 1.0
    drift = np.square([0.3 * 0.75, 0.2 * 0.2])
    Q = np.zeros((6, 6))
    Q[0, 0], Q[1, 1] = 0.2**2 * 0.1 / 3 * T, (2 * 0.1) ** 2 * 0.1 / 3 * T
    for k in range(2):
        for i, j, part in ((0, 0, T**3 / 3), (0, 2, T**2 / 2), (2, 0, T**2 / 2), (2, 2, T)):
            Q[2 + k + i, 2 + k + j] = drift[k] * part
    R, P = 0.01**2 * np.eye(2), np.diag([0.01**2, 0.01**2, 0, 0, 0, 0])
    x, found, variances = np.array([*record.measurements[0], 0, 0, 0, 0.0]), [], []
    for k, y in enumerate(record.measurements):
        if k:
            x, P = F @ x, F @ P @ F.T + Q
            x[:2] += B[:, 0] * record.inputs[k - 1, 0]
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
        x, P = x + K @ (y - H @ x), P - K @ H @ P
        found.append(x[2:4])
        variances.append(np.diag(P)[2:4])
    settings = BANK | {"drift_actuator": 0.3, "drift_sensor": 0.2, "rate": 1e-300}
    estimate = motor.fault_bank(plant, settings, PERIOD, 0.01)(record)
    assert isinstance(estimate, Estimates)
    assert estimate.values * plant.largest == pytest.approx(np.array(found), abs=1e-9)
    covered = estimate.covariances * np.square(plant.largest)
    assert covered == pytest.approx(np.array(variances), abs=1e-9)


def test_filter_of_diffuse_faults_is_the_inverted_model() -> None:
    """With as many faults as measurements, nothing is left for a gain to choose.

    The inverted model takes the current as straight between samples, the filter as driven.
    """
    record, plant = task().record("all", 1), task().plant_in("all")
    A, B = zero_order_hold(plant.motor.A, plant.motor.B, PERIOD)
    model = LinearModel(A, B, np.eye(2), None, Q=1e-8, R=1e-4, sampling_period=PERIOD)
    none = np.zeros((2, 1))
    observer = AugmentedKalmanFilter(
        model,
        fault_matrix=np.hstack([B, none]),
        random_walk=1e8,
        output_fault_matrix=np.hstack([none, [[1.0], [0.0]]]),
    )
    y, u = record.measurements, record.inputs
    start = observer.init(y[0], 1e-4, unknown_input_covariance=1e8)
    raw = observer.run(y, u, start=start)["unknown_input"] / plant.largest
    lags = {"lag_actuator": 1e-9, "lag_sensor": 1e-9}
    inverted = values(motor.inverted(plant, lags, PERIOD, 0.01)(record))
    # A voltage fault is seen in the current a row later.
    off = np.abs(raw - inverted)[2:]
    assert off[:, 1].max() < 2e-3 * np.abs(inverted[:, 1]).max()
    assert off[:, 0].max() < 2e-3 * np.abs(inverted[:, 0]).max()


def test_bank_tells_which_channel_has_the_fault() -> None:
    """A step of one channel leaves the estimate of the other at a tenth of it or less."""
    plant = quiet(faults=["step"], size=(0.9, 1.0), faulty=(1, 1))
    settings = BANK | {"drift_actuator": 0.1, "drift_sensor": 0.01}
    seen = set()
    for seed in range(6):
        record = recorded(seed, plant)
        faulty = record.truth.any(axis=0)
        found = values(motor.fault_bank(plant, settings, PERIOD, 0.003)(record))
        assert np.sqrt((found[:, ~faulty] ** 2).mean()) < 0.1
        assert np.abs(found[-1, faulty] - record.truth[-1, faulty]) < 0.03
        seen.add(int(faulty.argmax()))
    assert seen == {0, 1}


def test_riccati_gains_agree_with_another_solver() -> None:
    plant = task().plant_in("nominal")
    settings = {"actuator": 0.3, "sensor": 0.2, "process": 0.5, "filter_rate": 20.0}
    found = motor.by_riccati(plant, settings, PERIOD, 0.01)
    system = motor._augmented(plant.motor, 20.0)
    W = np.diag([0.5 * 0.2, 0.5 * 0.2, 0.0, 0.0, 0.3, 0.2]) ** 2
    V = 0.01**2 * PERIOD * np.eye(2)
    L, _, _ = control.lqe(system.A_tilde, np.eye(6), system.C_tilde, W, V)
    expected = motor._extended_state(
        plant, system, motor.Gains(np.asarray(L), np.zeros((6, 2))), PERIOD
    )
    record = task().record("nominal", 1)
    assert values(found(record)) == pytest.approx(values(expected(record)), abs=1e-6)


def test_nearby_settings_share_a_design() -> None:
    found = [motor.preferred(one, 10) for one in (1.0, 0.05, 0.0012, 9.45, 400.0)]
    assert found == [1.0, 0.05, 0.0013, 10.0, 400.0]
    assert [motor.preferred(1.1 * 10 ** (k / 5), 5) for k in range(6)] == [1, 1.6, 2.5, 4, 6.3, 10]
    plant = task().plant_in("nominal")
    one, other = (motor.METHODS["pi"](plant, {"excess": excess, "filter_rate": 100.0}, PERIOD, 1.0)
                  for excess in (0.0101, 0.0099))  # fmt: skip
    record = task().record("nominal", 1)
    assert (values(one(record)) == values(other(record))).all()


def test_construction_time_includes_the_design(monkeypatch: pytest.MonkeyPatch) -> None:
    forgotten = []
    monkeypatch.setattr(motor, "forget", lambda: forgotten.append(motor.designed.cache_clear()))
    _cost(task(), "inverted", FAST["inverted"])
    assert len(forgotten) == 7
    assert motor.designed.cache_info().currsize == 0


def test_invalid_motor_constants_are_reported() -> None:
    tree = {**task().plant, "motor": {**task().plant["motor"], "inertia": -1.0}}
    with pytest.raises(InputError, match=r"inertia"):
        replace(task(), plant=tree).plant_in("nominal")
