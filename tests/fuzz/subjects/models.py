"""Models, plants, signals and what they share."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from reobserve.models.linear import LinearModel
from reobserve.models.polynomial import PolynomialSystem
from reobserve.models.rigid_body import RigidBody
from reobserve.models.triangular import TriangularModel
from reobserve.models.triangular_text import triangular_model
from reobserve.numerics.discretisation import interpolating_hold, polynomial_hold, zero_order_hold
from reobserve.plants.dc_motor import ControlledMotor, DCMotor, SpeedControl, poles_for
from reobserve.plants.delayed_input import DelayedInputPlant, check_delay, delayed
from reobserve.plants.first_order_lag import first_order_lag
from reobserve.plants.hydraulic_actuator import ActuatorModel, simulate
from reobserve.plants.pendulum import pendulum
from reobserve.plants.polynomial import PolynomialPlant
from reobserve.plants.satellite import Satellite
from reobserve.timeseries.input_history import InputHistory
from reobserve.timeseries.series import Channel, Series
from reobserve.timeseries.signals import Signal

from .subject import Subject, subject

INERTIA = np.array([[36.0, 1.5, 0.0], [1.5, 17.0, 0.0], [0.0, 0.0, 26.0]])
TRANSITION = np.array([[1.0, 0.01], [-0.01, 0.99]])
NUMERATOR = [27.03, 9577.0, 1.87e6, 1.65e8]
DENOMINATOR = [535.2, 7.38e4, 6.08e6, 1.813e8]

TERMS = [
    {"kind": "constant", "axis": 1, "size": 0.5},
    {"kind": "sine", "axis": 1, "from": 0.1, "amplitude": 1.0, "frequency": 2.0, "phase": 0.5},
]
MORE_TERMS = [
    {"kind": "growing_sine", "axis": 1, "from": 1, "until": 2, "growth": 0.01, "frequency": 1.57},
    {"kind": "ramp", "axis": 1, "from": 1, "until": 4, "slope": 0.1},
    {"kind": "square", "axis": 1, "from": 1, "until": 6, "high": 1, "period": 4, "width": 2},
    {"kind": "prbs", "axis": 1, "until": 3, "amplitude": 0.1, "clock": 100, "order": 7},
    {"kind": "sweep", "axis": 1, "amplitude": 0.1, "start": 1, "end": 50, "duration": 20},
]


def signal(axes: int = 1) -> Signal:
    """A constant on every axis."""
    terms = [{"kind": "constant", "axis": k + 1, "size": 0.1} for k in range(axes)]
    return Signal.parse("signal", terms, axes)


def linear_model() -> LinearModel:
    """Two states, one input, one output."""
    return LinearModel(TRANSITION, [[0.0], [0.01]], [[1.0, 0.0]], 1e-4, 1e-2)


def van_der_pol() -> PolynomialSystem:
    """Van der Pol's equation in reversed time, so that the origin is stable."""
    return PolynomialSystem.from_expressions(["-w", "a - (1 - a**2)*w"], ["a"], ["a", "w"], 3)


def motor() -> ControlledMotor:
    """The DC motor under its controller."""
    plain = DCMotor(0.01, 0.1, 0.01, 0.01, 1.0, 0.5)
    control = SpeedControl.placed(plain, [-5.0, -6.0, -7.0])
    return ControlledMotor(plain, control, np.eye(2), np.ones((2, 1)), np.ones((2, 1)))


def actuator() -> ActuatorModel:
    """The hydraulic actuator without fault."""
    return ActuatorModel(NUMERATOR, DENOMINATOR)


def subjects() -> Iterator[Subject]:
    """Calls that must be accepted."""
    time = np.linspace(0.0, 0.2, 21)
    yield subject(zero_order_hold, TRANSITION, [[0.0], [1.0]], 0.1)
    yield subject(interpolating_hold, TRANSITION, [[0.0], [1.0]], 0.1, [0.0, 1.0])
    yield subject(polynomial_hold, TRANSITION, [[0.0], [1.0]], 0.1, 1)
    samples = np.column_stack([np.sin(time), np.cos(time)])
    yield subject(InputHistory, 0.02, samples, samples)
    history = InputHistory(0.02, samples, samples)
    yield subject(history.at, [0.0, 0.05], of=history)
    yield subject(history.latest, 3, of=history)
    yield subject(history.followed_by, samples, samples, of=history)
    yield subject(
        LinearModel, TRANSITION, [[0.0], [0.01]], [[1.0, 0.0]], 1e-4, 1e-2, [[0.0]], False
    )
    yield subject(RigidBody, INERTIA, np.eye(3), np.eye(3))
    # A model of a user's own; its functions have to be compiled.
    lag = first_order_lag()
    yield subject(TriangularModel, 1, lag.drift, lag.input_gain, np.array([1.0, 1.0]))
    yield subject(triangular_model, ["a", "b"], ["0", "-a"], "1")
    system = van_der_pol()
    yield subject(PolynomialSystem, system.dynamics, system.output)
    texts = (["-w", "a - (1 - a**2)*w"], ["a"], ["a", "w"], 3)
    yield subject(PolynomialSystem.from_expressions, *texts)
    yield subject(Signal.parse, "fault", TERMS, 1)
    yield Subject("signals.Signal.parse, kinds", Signal.parse, ("fault", MORE_TERMS, 1))
    for term in (*TERMS, *MORE_TERMS):
        # Each value of a term by itself.
        yield _term(term)
    one = signal()
    yield subject(one.__call__, time, of=one)
    yield subject(one.check_grid, "fault", 0.01, 1.0, of=one)
    yield subject(Series, time, {"y": Channel(np.sin(time), "1")}, {"onset": (0.1,)}, {})
    yield from _plants(time)


def _term(term: dict[str, object]) -> Subject:
    keys = list(term)

    def parse(*values: object) -> None:
        found = Signal.parse("fault", [dict(zip(keys, values, strict=True))], 1)
        assert np.isfinite(found(np.linspace(0.0, 3.0, 30))).all(), "not finite"

    return Subject(f"signals.Signal.parse, {term['kind']}", parse, tuple(term.values()))


def _plants(time: np.ndarray) -> Iterator[Subject]:
    yield subject(DCMotor, 0.01, 0.1, 0.01, 0.01, 1.0, 0.5, False)
    yield subject(SpeedControl, [1.0, 0.1], 2.0)
    plain = DCMotor(0.01, 0.1, 0.01, 0.01, 1.0, 0.5)
    yield subject(SpeedControl.placed, plain, [-5.0, -6.0, -7.0], takes=("complex",))
    yield subject(poles_for, 1.0, 0.1)
    whole = motor()
    yield subject(
        ControlledMotor, plain, whole.control, np.eye(2), np.ones((2, 1)), np.ones((2, 1))
    )
    noise = (np.zeros((20, 2)), np.zeros((20, 1)))
    simulated = (signal(), signal(), signal(), *noise, 0.01, [0.0, 0.0])
    yield subject(whole.simulate, *simulated, of=whole)
    late = DelayedInputPlant(pendulum(9.81, 0.5, 0.2, 0.3))
    yield subject(DelayedInputPlant, late.model)
    yield subject(late.simulate, [0.1, 0.0], signal(), signal(), 0.01, 20, of=late)
    yield subject(delayed, signal(), signal(), time)
    yield subject(check_delay, "delay", signal(), (0.0, 1.0), 0.01, 1.0)
    yield subject(first_order_lag, 1.0, 2.0)
    yield subject(pendulum, 9.81, 0.5, 0.2, 0.3)
    yield subject(ActuatorModel, NUMERATOR, DENOMINATOR)
    model = actuator()
    yield subject(model.sampled, "motion", 1e-3, 1e3, of=model)
    yield subject(model.blended, ActuatorModel([1, 2, 3, 4e8], DENOMINATOR), 0.5, of=model)
    yield subject(simulate, [model, model], [0] * 10 + [1] * 10, np.ones(20), 1e-3)
    plant = PolynomialPlant(van_der_pol())
    yield subject(PolynomialPlant, plant.system)
    yield subject(plant.simulate, [0.1, 0.0], 0.01, 20, of=plant)
    yield subject(plant.output, np.zeros((5, 2)), of=plant)
    satellite = Satellite(INERTIA)
    yield subject(Satellite, INERTIA, np.eye(3), np.eye(3))
    yield subject(satellite.simulate, [0.1, 0.0, 0.0], signal(3), signal(3), 0.01, 20, of=satellite)
