"""Records with known truth for linear filters, their bank and the extended state observer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.discretisation import zero_order_hold
from reobserve.observers.augmented_kalman import AugmentedKalmanFilter
from reobserve.observers.extended_state import ExtendedStateObserver
from reobserve.observers.fault_bank import FaultBank
from reobserve.observers.fixed_gain import luenberger, steady_kalman
from reobserve.observers.grid_filter import GridFilter
from reobserve.observers.imm import IMM
from reobserve.observers.kalman import KalmanFilter
from reobserve.observers.smooth_variable_structure import SmoothVariableStructureFilter
from reobserve.synthesis.extended_state.system import AugmentedSystem, Gains
from reobserve.synthesis.linear_gain import place
from reobserve.systems.linear import LinearModel
from tests.reobserve.observers.case import Case

Array = NDArray[np.float64]

PERIOD, ROWS = 0.05, 400
A, B = [[0.0, 1.0], [-4.0, -0.6]], [[0.0], [4.0]]  # a mass on a spring under a force
HELD = zero_order_hold(A, B, PERIOD)
MODEL = LinearModel(*HELD, np.eye(2), Q=1e-6, R=1e-6, sampling_period=PERIOD)
SOFT = LinearModel(
    *zero_order_hold([[0.0, 1.0], [-1.0, -0.6]], B, PERIOD), np.eye(2), Q=1e-6, R=1e-6,
    sampling_period=PERIOD,
)  # fmt: skip


def force() -> Array:
    """Pulses of many lengths, held from row to row, shape (k, 1)."""
    k = np.arange(ROWS)
    return np.sign(np.sin(0.002 * k**1.6 + 0.3))[:, None]


def states(u: Array, disturbance: Array | float = 0.0) -> Array:
    """The states at the rows, shape (k, 2)."""
    x, rows = np.array([0.4, -0.2]), []
    for held in u + disturbance:
        rows.append(x)
        x = HELD[0] @ x + HELD[1] @ held
    return np.array(rows)


def _filter(observer: Any, bound: float = 1e-12) -> Case:
    u = force()
    x = states(u)
    start = observer.init([0.0, 0.0], 1.0)
    return Case(observer, x, u, start, {"state": x}, {"state": bound}, 100, 1e3)


def kalman() -> Case:
    """The Kalman filter."""
    return _filter(KalmanFilter(MODEL))


def variable_structure() -> Case:
    """The SVSF, with a layer wide enough for it to depend on the model."""
    case = _filter(SmoothVariableStructureFilter(MODEL, boundary_layer=10.0, convergence_rate=0.1))
    return replace(case, state=case.observer.init(case.truth["state"][0], 1.0))


def steady() -> Case:
    """The steady Kalman filter."""
    return _filter(steady_kalman(MODEL))


def placed() -> Case:
    """Luenberger's observer."""
    return _filter(luenberger(MODEL, [0.5, 0.6]))


def bank() -> Case:
    """Two Kalman filters, one of them with the plant's model."""
    stays = [[0.99, 0.01], [0.01, 0.99]]
    return _filter(IMM([KalmanFilter(MODEL), KalmanFilter(SOFT)], stays), 1e-5)


def unknown_input() -> Case:
    """A Kalman filter that estimates a constant force."""
    observer, u = AugmentedKalmanFilter(MODEL, fault_matrix=HELD[1], random_walk=2e-7), force()
    x, d = states(u, 0.3), np.full((ROWS, 1), 0.3)
    start = observer.init([0.0, 0.0], 1.0)
    truth, bounds = {"state": x, "unknown_input": d}, {"state": 1e-8, "unknown_input": 1e-8}
    return Case(observer, x, u, start, truth, bounds, 300, 1e3)


def extended_state() -> Case:
    """The extended state observer, which estimates constant actuator and sensor faults.

    Its errors come from measurements that are not linear between samples.
    """
    none, rate = np.zeros((2, 0)), np.array([[0.0], [1.0]])
    system = AugmentedSystem(A, B, np.eye(2), none, none, B, rate, Az=20.0)
    poles = [-3.0, -3.5, -4.0, -30.0, -31.0, -32.0]
    gains = Gains(place(system.A_tilde, system.C_tilde, poles), np.zeros((system.size, 2)))
    observer, u = ExtendedStateObserver(system, gains=gains, sampling_period=PERIOD), force()
    x = states(u, 0.3)
    faults = {"actuator_fault": np.full((ROWS, 1), 0.3), "sensor_fault": np.full((ROWS, 1), -0.2)}
    y = x + np.array([0.0, -0.2])
    bounds = {"state": 0.02, "actuator_fault": 0.02, "sensor_fault": 0.02}
    return Case(observer, y, u, observer.init(), {"state": x, **faults}, bounds, 200, 10.0, 1.7e308)


def jumping() -> Case:
    """A bank for a force that jumps, with no noise but its own: it is seen a row later."""
    u, k = force(), np.arange(ROWS)
    fault = np.where((k > 150) & (k < 250), 0.5, 0.0)[:, None]
    x, observer = (
        states(u, fault),
        FaultBank(MODEL, fault_matrix=HELD[1], drift=1e-3, jump=10.0, jump_rate=0.1, jump_time=0.1),
    )
    start = observer.init([0.0, 0.0], 1.0)
    truth = {"state": x, "fault": fault}
    return Case(observer, x, u, start, truth, {"state": 0.005, "fault": 0.02}, 300, 3.0)


def late() -> Case:
    """A grid of delays of the force, of which one is right."""
    u = force()
    x = states(np.concatenate([u[:1], u[:1], u[:1], u[:-3]]))
    model = LinearModel.from_ode(A, B, np.eye(2), Q=1e-6, R=1e-6, sampling_period=PERIOD)
    observer = GridFilter.of_delay(model, delays=[0.0, 0.05, 0.1, 0.15, 0.18, 0.25])
    start = observer.init([0.0, 0.0], 1.0)
    truth = {"state": x, "parameter": np.full(ROWS, 0.15)}
    return Case(observer, x, u, start, truth, {"state": 1e-9, "parameter": 1e-9}, 100, 1e3)


CASES: dict[str, Callable[[], Case]] = {
    "Kalman filter": kalman,
    "SVSF": variable_structure,
    "steady Kalman filter": steady,
    "Luenberger observer": placed,
    "IMM": bank,
    "fault bank": jumping,
    "grid filter": late,
    "augmented Kalman filter": unknown_input,
    "extended state observer": extended_state,
}
