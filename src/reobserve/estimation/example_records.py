"""Records that go with the examples: small plants, simulated, in units that a log would have.

Each plant is followed on a grid ten times as fine as its samples.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from reobserve.core.discretisation import zero_order_hold

Array = NDArray[np.float64]
Field = Callable[[float, Array], Array]

FINE = 10  # steps of the simulation in a sampling period


@dataclass(frozen=True, eq=False)
class Simulated:
    """A plant that was followed: ``time`` [s] on the fine grid, signals by name, and which to log.

    ``logged`` has, by the title of a column, a signal, the factor to the column's unit and the
    standard deviation of its noise in that unit.
    """

    time: Array
    signals: Mapping[str, Array]
    logged: Mapping[str, tuple[str, float, float]]

    def record(self) -> dict[str, Array]:
        """The columns at all samples, ``t`` [ms] first."""
        random, columns = np.random.default_rng(12), {"t": 1000.0 * self.time[::FINE]}
        for title, (name, factor, noise) in self.logged.items():
            values = self.signals[name][::FINE]
            columns[title] = factor * values + noise * random.normal(size=len(values))
        return columns


def _followed(field: Field, start: Array, time: Array) -> Array:
    """x' = field(t, x) by the classical Runge-Kutta method, shape (k, n)."""
    rows: Array = np.empty((len(time), len(start)))
    rows[0] = x = start
    for k, (t, after) in enumerate(pairwise(time.tolist())):
        h = after - t
        k1 = field(t, x)
        k2 = field(t + h / 2, x + h / 2 * k1)
        k3 = field(t + h / 2, x + h / 2 * k2)
        k4 = field(after, x + h * k3)
        rows[k + 1] = x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return rows


def _grid(period: float, horizon: float) -> Array:
    steps: Array = np.arange(round(horizon / period) * FINE + 1, dtype=np.float64)
    return period / FINE * steps


def satellite() -> Simulated:
    """A tumbling body that a leak turns about its first axis with 0.5 N m from 5 s on."""
    inertia = np.array([[36.0, 1.5, 0.0], [1.5, 17.0, 0.0], [0.0, 0.0, 26.0]])
    inverse, time = np.linalg.inv(inertia), _grid(0.01, 15.0)
    start = np.floor(time / 0.01 + 1e-6) * 0.01  # of the period, over which torques are held
    torques = 0.2 * np.column_stack([np.sin(0.5 * start), np.cos(0.3 * start), np.sin(0.2 * start)])
    fault = np.where(time >= 5.0, 0.5, 0.0)

    def field(t: float, w: Array) -> Array:
        k = int(t / time[1] + 1e-6)
        known = torques[k] + np.array([fault[k], 0.0, 0.0])
        (a, b, c), (p, q, r) = w.tolist(), (inertia @ w).tolist()
        # w' = J^-1 (T - w x J w)
        derivative: Array = inverse @ (known - [b * r - c * q, c * p - a * r, a * q - b * p])
        return derivative

    rates = _followed(field, np.array([0.05, -0.03, 0.04]), time)
    signals = {f"w{axis}": rates[:, k] for k, axis in enumerate("xyz")}
    signals |= {f"T{axis}": torques[:, k] for k, axis in enumerate("xyz")}
    signals["fault"], signals["none"] = fault, np.zeros(len(time))
    turn = float(np.rad2deg(1.0))
    logged = {f"w{a}": (f"w{a}", turn, 2e-4) for a in "xyz"}
    logged |= {f"T{a}": (f"T{a}", 1000.0, 0.0) for a in "xyz"}
    return Simulated(time, signals, logged)


def pendulum(
    time: Array, start: float, stiffness: float, damping: float, gain: float, noise: float
) -> Simulated:
    """A pendulum that swings down from an angle [rad], measured in degrees.

    With a ``gain``, a torque in mN m turns it, held over each period.
    """
    held = np.floor(time / time[FINE] + 1e-6) * time[FINE]
    torque = 0.3 * np.sin(0.7 * held) + 0.2 * np.sin(1.9 * held)

    def field(t: float, x: Array) -> Array:
        u = torque[min(int(t / time[1] + 1e-6), len(time) - 1)]
        return np.array([x[1], -stiffness * np.sin(x[0]) - damping * x[1] + gain * u])

    rows = _followed(field, np.array([start, 0.0]), time)
    signals = {"angle": rows[:, 0], "rate": rows[:, 1], "torque": torque}
    logged = {"angle": ("angle", float(np.rad2deg(1.0)), noise)}
    logged |= {"torque": ("torque", 1000.0, 0.0)} if gain else {}
    return Simulated(time, signals, logged)


def _valve_input(t: Array | float) -> Array:
    return np.asarray(np.sin(0.2 * np.asarray(t) + 0.3))


def lag() -> Simulated:
    """x' = -x + u(t - 0.6 s), in percent: a valve and the level it sets, say."""
    time = _grid(0.01, 40.0)
    rows = _followed(
        lambda t, x: np.array([-x[0] + _valve_input(t - 0.6)]), np.array([_valve_input(-1.6)]), time
    )
    rate = -rows[:, 0] + _valve_input(time - 0.6)
    signals = {
        "level": rows[:, 0], "level_rate": rate, "valve": _valve_input(time),
        "valve_rate": 0.2 * np.cos(0.2 * time + 0.3), "delay": np.full(len(time), 0.6),
    }  # fmt: skip
    logged = {name: (name, 100.0, 0.0) for name in ("level", "level_rate", "valve", "valve_rate")}
    return Simulated(time, signals, logged)


def signal() -> Simulated:
    """A voltage in mV, sin t."""
    time = _grid(0.01, 10.0)
    signals = {"v0": np.sin(time), "v1": np.cos(time), "v2": -np.sin(time)}
    return Simulated(time, signals, {"voltage": ("v0", 1000.0, 0.0)})


def motor(
    horizon: float = 10.0, worn: float = 0.0, lost: float = 0.0, offset: float = 0.0
) -> Simulated:
    """A DC motor with x = [speed, current]: speed in rpm, current in mA, voltage in V.

    In the second half of the record the friction is higher by ``worn`` [1/s], the voltage by
    ``lost`` [V] and the reading of the speed by ``offset`` [rad/s].
    """
    period, time = 0.01, _grid(0.01, horizon)
    late = np.where(np.arange(len(time)) >= len(time) // 2, 1.0, 0.0)
    start = np.floor(time / period + 1e-6) * period
    volts = 6.0 + 3.0 * np.sign(np.sin(1.3 * start)) + np.sign(np.sin(4.1 * start))
    models = [
        zero_order_hold([[-10.0 - more, 40.0], [-0.4, -20.0]], [[0.0], [20.0]], period / FINE)
        for more in (0.0, worn)
    ]
    rows = np.zeros((len(time), 2))
    for k in range(len(time) - 1):
        A, B = models[int(late[k])]
        rows[k + 1] = A @ rows[k] + B[:, 0] * (volts[k] + lost * late[k])
    signals = {
        "speed": rows[:, 0], "current": rows[:, 1], "read": rows[:, 0] + offset * late,
        "volts": volts, "fault": lost * late, "offset": offset * late, "worn": late,
        "healthy": 1.0 - late,
    }  # fmt: skip
    logged = {
        "speed": ("read", 60.0 / (2.0 * np.pi), 0.3), "current": ("current", 1000.0, 10.0),
        "voltage": ("volts", 1.0, 0.0),
    }  # fmt: skip
    return Simulated(time, signals, logged)


driven_pendulum = partial(pendulum, _grid(0.01, 15.0), 0.4, 9.81, 0.5, 4.0, 0.01)
PLANTS: Mapping[str, Callable[[], Simulated]] = {
    "satellite": satellite,
    "pendulum": lambda: pendulum(_grid(0.02, 20.0), 0.5, 1.0, 0.1, 0.0, 0.02),
    "driven_pendulum": driven_pendulum,
    "swing": driven_pendulum,
    "lag": lag,
    "signal": signal,
    "motor": motor,
    "worn_motor": partial(motor, worn=10.0),  # twice the friction
    "weak_motor": partial(motor, 20.0, lost=-2.0),
    "biased_motor": partial(motor, 20.0, offset=1.0),
    "faulty_motor": partial(motor, 20.0, lost=-2.0, offset=1.0),
}


@cache
def followed(plant: str) -> Simulated:
    """A plant of the table, followed over its record."""
    return PLANTS[plant]()
