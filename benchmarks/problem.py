"""The observers and the record that all kernel benchmarks share, and the compiled-loop call."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.observers.adaptive import AdaptiveObserver
from reobserve.observers.ilo import ILO, SampledILO
from reobserve.observers.rigid_body_observer import RigidBodyRecord, RigidBodyRows, RigidBodyState
from reobserve.systems.rigid_body import RigidBody

Array = NDArray[np.float64]
Observer = ILO | SampledILO | AdaptiveObserver

STEP = 5e-4
DELAY = 20
INTERVAL = STEP * DELAY

_RATE_FREQUENCY, _RATE_PHASE = np.array([1.0, 0.7, 2.0]), np.array([0.0, 1.0, 2.0])
_CONTROL_FREQUENCY, _CONTROL_PHASE = np.array([0.5, 0.3, 0.2]), np.array([0.0, 1.5, 1.0])

# No zero off the diagonals: a peer that skipped one would show.
_BODY = RigidBody(
    np.array([[36.0, 1.5, 0.2], [1.5, 17.0, 0.3], [0.2, 0.3, 26.0]]),
    np.eye(3) + 0.1,
    np.eye(3) + 0.05,
)
_K1 = 0.9 * np.eye(3) + 0.01
_K2 = 2000.0 * np.eye(3) + 20.0


def measured_rate(time: Any) -> Array:
    """A measured rate [rad/s] in closed form, so that every peer can read it at any instant."""
    rate: Array = 0.05 * np.sin(np.multiply.outer(time, _RATE_FREQUENCY) + _RATE_PHASE)
    return rate


def known_control(time: Any) -> Array:
    """A control torque [N m], likewise."""
    control: Array = 0.5 * np.sin(np.multiply.outer(time, _CONTROL_FREQUENCY) + _CONTROL_PHASE)
    return control


def sampled_record(steps: int, step: float = STEP) -> tuple[Array, Array]:
    """Rate and control of ``steps`` steps as an observer reads them, two samples a step."""
    time = np.arange(2 * steps + 1) * (0.5 * step)
    return measured_rate(time), known_control(time)


def continuous(step: float = STEP) -> ILO:
    """The continuous ILO with full 3 x 3 gains and an interval of 20 steps of 0.5 ms."""
    return ILO(
        _BODY,
        K1=_K1,
        K2=_K2,
        observer_gain=_gain(100.0),
        update_interval=INTERVAL,
        sampling_period=step,
    )


def observers() -> dict[str, Observer]:
    """One observer of each law, by the name of its C function."""
    return {
        "continuous": continuous(),
        "sampled": SampledILO(
            _BODY,
            K1=_K1,
            K2=_K2,
            observer_gain=_gain(1000.0),
            update_interval=INTERVAL,
            sampling_period=STEP,
        ),
        "adaptive": AdaptiveObserver(
            _BODY,
            observer_gain=_gain(100.0),
            integral_gain=_gain(1000.0),
            proportional_gain=_K1 * 10.0,
            sampling_period=STEP,
        ),
    }


def _gain(size: float) -> Array:
    return size * (np.eye(3) + 0.02)


def constants(observer: Observer) -> tuple[Any, ...]:
    """What the compiled loop of an observer reads, in the order of its law."""
    return tuple(observer._constants)


def loop(
    observer: Observer, state: RigidBodyState, record: tuple[Array, Array], outputs: list[Array]
) -> int:
    """The compiled loop alone: no checks, no outputs to allocate. The record has no jumps."""
    rate, control = record
    start = state.rate.copy(), state.memory.copy()
    return observer._run(
        *start, state.count, RigidBodyRecord(rate, rate, control, control), RigidBodyRows(*outputs)
    )
