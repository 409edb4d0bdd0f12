"""The examples, written by hand with the library."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

import reobserve as ro
from reobserve.core.discretisation import zero_order_hold
from reobserve.estimation.quantities import conversion
from reobserve.observers.run import Run
from reobserve.synthesis.extended_state.system import AugmentedSystem, Gains
from reobserve.systems.triangular_text import triangular_model
from tests.reobserve.observers.cases import stated

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

BODY = ro.RigidBody([[36.0, 1.5, 0.0], [1.5, 17.0, 0.0], [0.0, 0.0, 26.0]])
PERIOD = 0.01


def read(columns: Columns, unit: str, model: str, *names: str) -> Array:
    """Columns in another unit."""
    factor = conversion("", unit, model).factor
    stacked = np.column_stack([columns[name] for name in names])
    return stacked if factor == 1.0 else stacked * factor


def rigid(make: Callable[[], Any]) -> Callable[[Columns], Run[Any]]:
    """Of rates in deg/s and torques in mN m."""

    def run(columns: Columns) -> Run[Any]:
        y = read(columns, "deg/s", "rad/s", "wx", "wy", "wz")
        return make().run(y, read(columns, "mN m", "N m", "Tx", "Ty", "Tz"))

    return run


def motor_model(friction: float = 10.0) -> ro.LinearModel:
    """The model of the examples."""
    A, B = zero_order_hold([[-friction, 40.0], [-0.4, -20.0]], [[0.0], [20.0]], PERIOD)
    return ro.LinearModel(
        A, B, np.eye(2), Q=[1e-4, 1e-4], R=[1e-3, 1e-4], check=False, sampling_period=PERIOD
    )


def motor(make: Callable[[], Any], start: Any = None) -> Callable[[Columns], Run[Any]]:
    """Of a speed in rpm, a current in mA and a voltage in V."""

    def run(columns: Columns) -> Run[Any]:
        observer = make()
        speed = read(columns, "rpm", "rad/s", "speed")
        y = np.hstack([speed, read(columns, "mA", "A", "current")])
        state = observer.init([0.0, 0.0], 1.0) if start is None else start(observer)
        return observer.run(y, columns["voltage"], start=state)

    return run


def pendulum(**options: Any) -> Callable[[Columns], Run[Any]]:
    """Of an angle in degrees."""

    def run(columns: Columns) -> Run[Any]:
        observer = ro.normal_form_observer(
            ["rate", "-sin(angle) - rate/10"], ["angle"], ["angle", "rate"],
            poles=[-1.5, -2.0], sampling_period=0.02, **options,
        )  # fmt: skip
        return observer.run(read(columns, "deg", "rad", "angle"))

    return run


def high_gain(columns: Columns) -> Run[Any]:
    model = triangular_model(["angle", "rate"], ["0", "-9.81*sin(angle) - 0.5*rate"], "4")
    observer = ro.HighGainObserver(model, rho=8.0, sampling_period=PERIOD)
    y, u = read(columns, "deg", "rad", "angle"), read(columns, "mN m", "N m", "torque")
    return observer.run(y, u, start=observer.init([0.0, 0.0]))


def swing(kind: Callable[[ro.NonlinearModel], Any]) -> Callable[[Columns], Run[Any]]:
    """Of an angle in degrees and a torque in mN m."""

    def run(columns: Columns) -> Run[Any]:
        model = ro.NonlinearModel.from_ode(
            ["rate", "-stiffness*sin(angle) - friction*rate + gain*torque"], ["angle"],
            Q=[1e-10, 1e-7], R=3e-8, state_names=["angle", "rate"], input_names=["torque"],
            parameters={"stiffness": 9.81, "friction": 0.5, "gain": 4.0}, sampling_period=PERIOD,
        )  # fmt: skip
        observer = kind(model)
        y, u = read(columns, "deg", "rad", "angle"), read(columns, "mN m", "N m", "torque")
        return observer.run(y, u, start=observer.init([0.0, 0.0], 1.0))

    return run


def extended_high_gain(columns: Columns) -> Run[Any]:
    model = triangular_model(["level"], ["-level"], "1")
    observer = ro.ExtendedHighGainObserver(
        model, rho=5.0, order=2, delay_bounds=(0.0, 1.5), threshold=0.035, sampling_period=PERIOD
    )
    y, u = read(columns, "%", "1", "level"), read(columns, "%", "1", "valve")
    return observer.run(y, u, start=observer.init([0.0], delay=0.3))


def delay_grid(columns: Columns) -> Run[Any]:
    model = ro.LinearModel.from_ode(
        [[-1.0]], [[1.0]], [[1.0]], Q=1e-8, R=1e-6, sampling_period=PERIOD
    )
    grid = ro.GridFilter.of_delay(model, delays=np.arange(11) / 10, random_walk=0.0025)
    y, u = read(columns, "%", "1", "level"), read(columns, "%", "1", "valve")
    return grid.run(y, u, start=grid.init([0.0], 1.0))


def levant(columns: Columns) -> Run[Any]:
    return ro.LevantDifferentiator(L=1.5, sampling_period=PERIOD).run(
        read(columns, "mV", "V", "voltage")
    )


def eso() -> ro.ExtendedStateObserver:
    system = AugmentedSystem(
        [[-10.0, 40.0], [-0.4, -20.0]], [[0.0], [20.0]], np.eye(2), [[1.0], [0.0]],
        [[0.05, 0.0], [0.0, 0.02]], [[0.0], [20.0]], [[1.0], [0.0]], 20.0,
    )  # fmt: skip
    L = [[23.3, 494.0], [6.4, 206.0], [132.0, -103.0], [-30.3, 420.0], [1.96, 166.0]]
    Ld = [[0.337, 6.95], [0.168, 2.70], [2.03, -0.814], [-0.276, 4.65], [0.176, 2.32]]
    gains = Gains(np.array([*L, [133.0, -457.0]]), np.array([*Ld, [2.06, -6.75]]))
    return ro.ExtendedStateObserver(system, gains=gains, sampling_period=PERIOD)


def svsf(friction: float = 10.0) -> ro.SmoothVariableStructureFilter:
    return ro.SmoothVariableStructureFilter(
        motor_model(friction), boundary_layer=[0.3, 0.1], convergence_rate=0.1
    )


STAYS = [[0.999, 0.001], [0.001, 0.999]]

EACH = {"observer_gain": 100.0, "sampling_period": PERIOD}
LEARNING = {**EACH, "K1": 1.0, "K2": 20.0, "update_interval": PERIOD}
FORGETTING = {**LEARNING, "K1": 0.99}

BY_HAND: dict[str, Callable[[Columns], Run[Any]]] = {
    "ilo-sampled": rigid(lambda: ro.SampledILO(BODY, **LEARNING)),
    "ilo-continuous": rigid(lambda: ro.ILO(BODY, **LEARNING)),
    "ilo-forgetting": rigid(lambda: ro.ILO(BODY, **FORGETTING)),
    "adaptive": rigid(
        lambda: ro.AdaptiveObserver(BODY, integral_gain=100.0, proportional_gain=0.0, **EACH)
    ),
    "adaptive-pi": rigid(
        lambda: ro.AdaptiveObserver(BODY, integral_gain=200.0, proportional_gain=30.0, **EACH)
    ),
    "normal-form-constant": pendulum(order=0),
    "normal-form-identity": pendulum(order=4),
    "normal-form-transformed": pendulum(order=4, form="transformed"),
    "high-gain": high_gain,
    "extended-high-gain": extended_high_gain,
    "levant": levant,
    "kalman": motor(lambda: ro.KalmanFilter(motor_model())),
    "augmented-kalman": motor(
        lambda: ro.AugmentedKalmanFilter(
            motor_model(), fault_matrix=motor_model().B, random_walk=0.1
        )
    ),
    "augmented-kalman-bias": motor(
        lambda: ro.AugmentedKalmanFilter(
            motor_model(),
            fault_matrix=[[0.0], [0.0]],
            random_walk=0.01,
            output_fault_matrix=[[1.0], [0.0]],
        )
    ),
    "extended-kalman": swing(ro.ExtendedKalmanFilter),
    "unscented-kalman": swing(ro.UnscentedKalmanFilter),
    "svsf": motor(svsf),
    "imm-kalman": motor(
        lambda: ro.IMM([ro.KalmanFilter(motor_model(f)) for f in (10.0, 20.0)], STAYS)
    ),
    "imm-svsf": motor(lambda: ro.IMM([svsf(f) for f in (10.0, 20.0)], STAYS)),
    "fault-bank": motor(
        lambda: ro.FaultBank(
            motor_model(),
            fault_matrix=motor_model().B,
            drift=0.1,
            jump=20.0,
            jump_rate=0.1,
            jump_time=0.05,
        )
    ),
    "delay-grid": delay_grid,
    "eso": motor(eso, lambda observer: observer.init()),
    "luenberger-gain": motor(
        lambda: ro.FixedGainObserver(motor_model(), gain=[[0.3, 0.2], [0.0, 0.4]])
    ),
    "luenberger": motor(
        lambda: ro.luenberger(motor_model(), np.exp(PERIOD * np.array([-70.0, -50.0])))
    ),
    "kalman-steady": motor(lambda: ro.steady_kalman(motor_model())),
}
for more in stated("BY_HAND"):
    BY_HAND |= more
