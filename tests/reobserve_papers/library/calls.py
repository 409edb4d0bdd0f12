"""Valid calls of the public classes and functions of plants, signals and papers."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache, partial
from typing import Any

import numpy as np

from reobserve_papers.papers.lie.floquet import limit_cycle
from reobserve_papers.plants.dc_motor import ControlledMotor, DCMotor, SpeedControl
from reobserve_papers.plants.delayed_input import DelayedInputPlant
from reobserve_papers.plants.hydraulic_actuator import ActuatorModel
from reobserve_papers.plants.pendulum import pendulum
from reobserve_papers.plants.polynomial import PolynomialPlant
from reobserve_papers.plants.satellite import Satellite
from reobserve_papers.signals.inputs import Signal
from reobserve_papers.signals.random_streams import held_normal, random_stream
from reobserve_papers.signals.series import Channel
from tests.reobserve.library.calls import Call, by_name, call
from tests.reobserve.library.calls.call import COMPLEX, method
from tests.reobserve.library.calls.models import HALF, INERTIA, augmented, gains, van_der_pol

called = partial(call.called, package="reobserve_papers")

NUMERATOR = [27.03, 9577.0, 1.87e6, 1.65e8]
DENOMINATOR = [535.2, 7.38e4, 6.08e6, 1.813e8]
TERMS: list[dict[str, Any]] = [
    {"kind": "constant", "axis": 1, "size": 0.5},
    {"kind": "sine", "axis": 1, "from": 0.1, "amplitude": 1.0, "frequency": 2.0, "phase": 0.5},
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


@cache
def calls() -> dict[str, Call]:
    """All calls by name."""
    return by_name([*_signals(), *_plants(), *_papers()])


def _signals() -> Iterator[Call]:
    time = HALF[::2]

    def held(samples: Any, hold: Any, columns: Any) -> object:
        return held_normal(random_stream(1), samples, hold, columns)

    yield Call("signals.random_streams.held_normal", held, (20, 2, 3))
    yield from called({
        "signals.inputs.Signal.parse": ("fault", TERMS, 1),
        "signals.random_streams.random_stream": (3, "noise"),
        "signals.series.Series": (time, {"y": Channel(np.sin(time), "1")}, {"on": (0.1,)}, {}),
    })  # fmt: skip
    yield method(signal(), "__call__", time)
    yield method(signal(), "check_grid", "fault", 0.01, 1.0)
    for term in TERMS:  # each value of a term by itself

        def parse(*values: object, keys: tuple[str, ...] = tuple(term)) -> None:
            found = Signal.parse("fault", [dict(zip(keys, values, strict=True))], 1)
            assert np.isfinite(found(np.linspace(0.0, 3.0, 30))).all()

        yield Call(f"signals.inputs.Signal.parse, {term['kind']}", parse, (*term.values(),))


def _plants() -> Iterator[Call]:
    one, motor = signal(), DCMotor(0.01, 0.1, 0.01, 0.01, 1.0, 0.5)
    control = SpeedControl.placed(motor, [-5.0, -6.0, -7.0])
    controlled = (motor, control, np.eye(2), np.ones((2, 1)), np.ones((2, 1)))
    late = DelayedInputPlant(pendulum(9.81, 0.5, 0.2, 0.3))
    model = ActuatorModel(NUMERATOR, DENOMINATOR)
    oscillator = PolynomialPlant(van_der_pol())
    yield from called({"plants.dc_motor.SpeedControl.placed": (motor, [-5.0, -6.0, -7.0])}, COMPLEX)
    yield from called({
        "plants.dc_motor.DCMotor": (0.01, 0.1, 0.01, 0.01, 1.0, 0.5, False),
        "plants.dc_motor.SpeedControl": ([1.0, 0.1], 2.0),
        "plants.dc_motor.ControlledMotor": controlled,
        "plants.delayed_input.DelayedInputPlant": (late.model,),
        "plants.delayed_input.delayed": (one, one, HALF),
        "plants.delayed_input.check_delay": ("delay", one, (0.0, 1.0), 0.01, 1.0),
        "plants.first_order_lag.first_order_lag": (1.0, 2.0),
        "plants.pendulum.pendulum": (9.81, 0.5, 0.2, 0.3),
        "plants.hydraulic_actuator.ActuatorModel": (NUMERATOR, DENOMINATOR),
        "plants.hydraulic_actuator.simulate": (
            [model, model], [0] * 10 + [1] * 10, np.ones(20), 1e-3,
        ),
        "plants.polynomial.PolynomialPlant": (oscillator.system,),
        "plants.satellite.Satellite": (INERTIA, np.eye(3), np.eye(3)),
    })  # fmt: skip
    noise = (np.zeros((20, 2)), np.zeros((20, 1)))
    yield method(ControlledMotor(*controlled), "simulate", one, one, one, *noise, 0.01, [0.0, 0.0])
    yield method(late, "simulate", [0.1, 0.0], one, one, 0.01, 20)
    yield method(model, "sampled", "motion", 1e-3, 1e3)
    yield method(model, "blended", ActuatorModel([1, 2, 3, 4e8], DENOMINATOR), 0.5)
    yield method(oscillator, "simulate", [0.1, 0.0], 0.01, 20)
    yield method(oscillator, "output", np.zeros((5, 2)))
    body, three = Satellite(INERTIA), signal(3)
    yield method(body, "simulate", [0.1, 0.0, 0.0], three, three, 0.01, 20)


def _papers() -> Iterator[Call]:
    forward = van_der_pol(["w", "-a + (1 - a**2)*w"])
    cycle = limit_cycle(forward, [2.0, 0.5], 20.0)
    yield from called({
        "papers.lie.floquet.limit_cycle": (forward, [2.0, 0.5], 20.0),
        "papers.lie.floquet.floquet_exponents": (cycle, np.tile(-np.eye(2), (400, 1, 1))),
        "papers.eso.deviation.held_deviation": (augmented(), gains(), np.ones(3), 0.1),
    })  # fmt: skip
