"""Actuator and sensor fault of the DC motor of Indriawati, Agustinah & Jazidie, Section IV.

    x' = A x + B (u + fa) + Dd d,     y = x + Fs fs + v,     x = [speed, current]

The voltage u is a square wave. Each fault has a random class and size from a random time on. The
truth is in multiples of the largest faults; the disturbances d are uniform and held.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import lru_cache, partial
from typing import ClassVar

import numpy as np

from reobserve.core.discretisation import zero_order_hold
from reobserve.core.errors import InputError, one_line
from reobserve.core.validation import Positive
from reobserve.observers.augmented_kalman import AugmentedKalmanFilter
from reobserve.observers.extended_state import ExtendedStateObserver
from reobserve.observers.fault_bank import FaultBank
from reobserve.observers.fixed_gain import FixedGainObserver
from reobserve.synthesis.extended_state import pd_pi, pi
from reobserve.synthesis.extended_state.system import AugmentedSystem, Gains
from reobserve.synthesis.placed_gains import searched
from reobserve.systems.linear import LinearModel
from reobserve.tuning.search import Settings
from reobserve.tuning.task import (
    Array,
    Condition,
    Estimates,
    Runner,
    TaskRecord,
    estimates_of,
    estimates_with,
)
from reobserve_papers.bench.faults import (
    FaultyPlant,
    HealthyRecord,
    random_faults,
    random_walks,
    score,
)
from reobserve_papers.plants.dc_motor import ControlledMotor, DCMotor, SpeedControl
from reobserve_papers.signals.inputs import Signal
from reobserve_papers.signals.random_streams import random_stream

__all__ = ["METHODS", "Plant", "forget", "score", "simulate"]

# How disturbances, noise and the sensor fault enter, Section IV; here the current has noise, too.
DD, DW, FS = np.diag([1.0, 2.0]), np.array([[1.0], [0.0]]), np.array([[1.0], [0.0]])
NONE = np.zeros((2, 1))


@dataclass(frozen=True, kw_only=True)
class Plant(FaultyPlant):
    """The motor, its noise, disturbances and faults, whose sizes are shares of the largest."""

    channels: ClassVar[int] = 2  # actuator and sensor

    motor: DCMotor
    noise: Positive  # standard deviation of speed [rad/s] and current [A]
    disturbance: tuple[Positive, Positive]  # largest d1 [rad/s^2] and d2 [A/s]
    hold: Positive  # of disturbances [s]
    voltage: Positive  # amplitude of a square wave [V]
    turn: Positive  # its period [s]
    largest: tuple[Positive, Positive]  # actuator fault [V] and sensor fault [rad/s]


def simulate(plant: Plant, condition: Condition, seed: int, period: float) -> TaskRecord:
    """A record, for which a wrong model has other constants."""
    draw = random_stream(seed, "bench", "motor", "plant")
    steps, fine = round(plant.horizon / period), 4
    step, held = period / fine, round(fine * plant.hold / period)
    faults = random_faults(draw, plant, step)
    fault = Signal.parse("fault", faults, 2)
    fault.check_jumps("fault", step, plant.horizon)
    shares = 1.0 + condition.model * draw.uniform(-1.0, 1.0, 6)
    constants = [getattr(plant.motor, field.name) for field in fields(DCMotor)[:6]]
    motor = DCMotor(*(c * share for c, share in zip(constants, shares.tolist(), strict=True)))
    d = draw.uniform(-1.0, 1.0, (steps * fine // held + 1, 2)) * plant.disturbance
    square = {"kind": "square", "axis": 1, "high": plant.voltage, "low": -plant.voltage,
              "period": plant.turn, "until": plant.horizon + 1.0}  # fmt: skip
    voltage, still = Signal.parse("voltage", [square], 1), Signal(1, ())
    voltage.check_jumps("voltage", step, plant.horizon)

    def actuator(time: Array, before: bool = False) -> Array:
        driven: Array = plant.largest[0] * fault(time, before=before)[:, :1]
        return driven + voltage(time, before=before)

    loop = ControlledMotor(motor, SpeedControl(np.zeros(2), 0.0), DD, DW, FS)
    state = loop.simulate(
        still, actuator, still, np.repeat(d, held, axis=0)[: steps * fine],
        np.zeros((steps * fine, DW.shape[1])), step,
    ).state[::fine]  # fmt: skip
    time = period * np.arange(steps + 1.0)
    truth = fault(time)
    noise = random_stream(seed, "bench", "motor", "noise").standard_normal(state.shape)
    measured = state + plant.largest[1] * truth[:, 1:] @ FS.T
    measured += condition.noise * plant.noise * noise
    every = slice(None, None, condition.period)
    kind = TaskRecord if plant.scored == "all" else HealthyRecord
    return kind(time[every], voltage(time[every]), measured[every], truth[every])


def preferred(value: float, decade: int) -> float:
    """The nearest of so many numbers a decade, to two digits: those in between share a design."""
    return float(f"{10.0 ** (round(decade * np.log10(value)) / decade):.2g}")


def _augmented(motor: DCMotor, rate: float) -> AugmentedSystem:
    return AugmentedSystem(motor.A, motor.B, np.eye(2), DD, DW, motor.B, FS, np.array(rate))


@lru_cache(maxsize=2000)  # 40 to 150 ms each
def designed(kind: str, motor: DCMotor, setting: float, rate: float) -> Gains:
    """Gains by LMI. ``setting`` is gamma over its floor less 1, or the decay rate [1/s]."""
    system = _augmented(motor, rate)
    if kind == "pi_feasible":
        return pi.design_feasible(system, setting).gains
    return pd_pi.design(system, 1.0 + setting, derivative=kind == "pd_pi").gains


def by_lmi(kind: str, plant: Plant, s: Settings, period: float, _: float) -> Runner:
    """Filter rates are rounded to five numbers a decade, the other setting to ten."""
    name = "decay" if kind == "pi_feasible" else "excess"
    setting, rate = preferred(s[name], 10), preferred(s["filter_rate"], 5)
    gains = designed(kind, plant.motor, setting, rate)
    return _extended_state(plant, _augmented(plant.motor, rate), gains, period)


def by_riccati(plant: Plant, s: Settings, period: float, noise: float) -> Runner:
    """A PI observer with Kalman's gains, for white noise on the filtered outputs."""
    from scipy.linalg import solve_continuous_are

    system = _augmented(plant.motor, s["filter_rate"])
    adds = [*(s["process"] * DD @ plant.disturbance), 0.0, 0.0, s["actuator"], s["sensor"]]
    W, C = np.diag(np.square(adds)), system.C_tilde
    # A~ P + P A~' - P C~' C~ P + W / (noise^2 T) = 0,  L = P C~'
    try:
        P = solve_continuous_are(system.A_tilde.T, C.T, W / (noise**2 * period), np.eye(2))
    except (ValueError, np.linalg.LinAlgError) as error:  # settings too far apart for scipy
        raise InputError("settings", f"{s} have no Riccati equation: {one_line(error)}") from None
    return _extended_state(plant, system, Gains(P @ C.T, np.zeros((6, 2))), period)


def _extended_state(plant: Plant, system: AugmentedSystem, gains: Gains, period: float) -> Runner:
    observer = ExtendedStateObserver(system, gains=gains, sampling_period=period)

    def run(record: TaskRecord) -> Array:
        y = record.measurements
        start = observer.init([*y[0], *y[0], 0.0, 0.0], filtered=y[0])  # begins healthy
        outputs = observer.run(y, record.inputs, start=start)
        return np.hstack([outputs["actuator_fault"], outputs["sensor_fault"]]) / plant.largest

    return run


def random_walk(smooth: bool, plant: Plant, s: Settings, period: float, noise: float) -> Runner:
    """Faults as random walks, ``actuator`` [V / sqrt(s)] and ``sensor`` [rad/s / sqrt(s)]."""
    A, B = zero_order_hold(plant.motor.A, plant.motor.B, period)
    Q = np.square(s["process"] * DD @ plant.disturbance) * period
    observer = AugmentedKalmanFilter(
        LinearModel(A, B, np.eye(2), None, Q=Q, R=noise**2, sampling_period=period),
        fault_matrix=np.hstack([B, NONE]),
        random_walk=np.square([s["actuator"], s["sensor"]]),
        output_fault_matrix=np.hstack([NONE, FS]),
    )

    def run(record: TaskRecord) -> Estimates:
        y, u = record.measurements, record.inputs
        return _over_largest(plant, random_walks(observer, y, u, noise, smooth=smooth))

    return run


def _over_largest(plant: Plant, faults: Estimates) -> Estimates:
    scale = np.array(plant.largest)
    P = faults.covariances / (scale**2 if faults.covariances.ndim == 2 else np.outer(scale, scale))
    return Estimates(faults.values / scale, P)


def fault_bank(plant: Plant, s: Settings, period: float, noise: float) -> Runner:
    """Faults that drift or jump: quiet, the actuator's jumps, the sensor's jumps.

    ``drift`` [1/s / sqrt(s)] and ``jump`` [1 / sqrt(s)] are those of faults over the largest ones,
    ``rate`` of jumps [1/s] and ``burst`` [s] those of `FaultBank`; with ``memory`` [s] it estimates
    R, from ``start`` times that of ``noise`` on: where R is too small, noise looks like jumps.
    """
    A, B = zero_order_hold(plant.motor.A, plant.motor.B, period)
    Q = DD**2 @ np.square(plant.disturbance) * plant.hold / 3.0 * period
    R = s.get("start", 1.0) * noise**2
    model = LinearModel(A, B, np.eye(2), None, Q=Q, R=R, sampling_period=period)
    largest = np.array(plant.largest)
    drift = np.array([s["drift_actuator"], s["drift_sensor"]]) * largest
    bank = FaultBank(
        model, fault_matrix=np.hstack([B, NONE]), drift=drift, jump=s["jump"] * largest,
        jump_rate=s["rate"], jump_time=s["burst"],
        output_fault_matrix=np.hstack([NONE, FS]), noise_memory=s.get("memory"),
    )  # fmt: skip

    def run(record: TaskRecord) -> Estimates:
        y, u = record.measurements, record.inputs
        start = bank.init(y[0], R, fault_covariance=0.0, rate_covariance=0.0)
        estimates = estimates_with("fault_variance", bank, "fault", y, u, start=start)
        return _over_largest(plant, estimates)

    return run


def with_fault_states(plant: Plant, s: Settings, period: float, _: float) -> Runner:
    """The state of x(k+1) = A x + B (u + fa), y = x + Fs fs with constant faults, by four poles."""
    A, B = zero_order_hold(plant.motor.A, plant.motor.B, period)
    whole = np.vstack([np.hstack([A, B, NONE]), np.eye(2, 4, 2)])
    C = np.hstack([np.eye(2), NONE, FS])
    model = LinearModel(whole, np.vstack([B, NONE]), C, None, Q=0.0, R=1.0, sampling_period=period)
    poles = np.exp(-period * np.array([s[f"rate_{k}"] for k in range(1, 5)]))
    observer = FixedGainObserver(model, gain=searched(whole, C @ whole, poles))

    def run(record: TaskRecord) -> Array:
        y, u = record.measurements, record.inputs
        start = observer.init([*y[0], 0.0, 0.0])
        return estimates_of(observer, "state", y, u, start=start)[:, 2:] / plant.largest

    return run


def inverted(plant: Plant, s: Settings, period: float, _: float) -> Runner:
    """The speed that the current drives, and what speed and voltage lack, low-passed."""
    from scipy.signal import lfilter

    motor, keep = plant.motor, np.exp(-period / np.array([s["lag_actuator"], s["lag_sensor"]]))
    A, B = zero_order_hold(motor.A, motor.B, period)
    decay, gain = np.exp(-period * motor.friction / motor.inertia), motor.torque_constant

    def run(record: TaskRecord) -> Array:
        y, u = record.measurements, record.inputs[:, 0]
        # J w' = -b w + Kt i, with a straight line between samples of i replaced by its mean
        driven = gain / motor.friction * (1.0 - decay) * 0.5 * (y[1:, 1] + y[:-1, 1])
        speed = lfilter([1.0], [1.0, -decay], np.r_[y[0, 0], driven])
        known = A[1, 0] * speed[:-1] + A[1, 1] * y[:-1, 1]
        raw = np.zeros_like(y)
        raw[1:, 0] = (y[1:, 1] - known) / B[1, 0] - u[:-1]
        raw[:, 1] = y[:, 0] - speed
        smooth = [lfilter([1.0 - keep[k]], [1.0, -keep[k]], raw[:, k]) for k in range(2)]
        return np.asarray(np.column_stack(smooth) / plant.largest)

    return run


forget = designed.cache_clear

METHODS: dict[str, Callable[..., Runner]] = {
    "pd_pi": partial(by_lmi, "pd_pi"),
    "pi": partial(by_lmi, "pi"),
    "pi_feasible": partial(by_lmi, "pi_feasible"),
    "pi_riccati": by_riccati,
    "random_walk": partial(random_walk, False),
    "fault_bank": fault_bank,
    "smoothed": partial(random_walk, True),
    "luenberger": with_fault_states,
    "inverted": inverted,
}
