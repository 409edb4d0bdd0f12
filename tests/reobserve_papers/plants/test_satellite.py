"""The satellite: its order of convergence, closed forms of rotation, divergence and bad input."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from reobserve.core.errors import DivergenceError, InputError
from reobserve_papers.plants.satellite import Satellite
from reobserve_papers.signals.inputs import Signal
from tests.reobserve.observers.test_rigid_body_order import (
    FAULT,
    INERTIA,
    INPUT,
    INTERVAL,
    INTERVALS,
    PIECES,
    RATE,
    euler,
    integrate,
    order,
    value,
)
from tests.reobserve.systems.test_rigid_body import BAD_BODIES

Array = NDArray[np.float64]

NOTHING = Signal(3, ())


def test_plant_is_of_order_4_across_jumps_of_its_torques() -> None:
    # Torques of thousands of newton metres, so that the smallest errors stay far above rounding.
    fault = (
        {"kind": "constant", "axis": 1, "from": 0.13, "size": 300.0},
        {"kind": "sine", "axis": 2, "from": 0.24, "amplitude": 1000.0, "frequency": 10.0},
        {"kind": "ramp", "axis": 3, "from": 0.3, "until": 0.5, "slope": 4000.0},
    )
    control = ({"kind": "constant", "axis": 3, "from": 0.2, "until": 0.4, "size": -400.0},)
    piece, known = INTERVAL / PIECES, [RATE]
    for k in range(INTERVALS * PIECES):

        def slope(time: float, rate: Array, inside: float = (k + 0.5) * piece) -> Array:
            known_torque = INPUT @ value(control, time, inside)
            return euler(rate, known_torque + FAULT @ value(fault, time, inside))

        known.append(integrate(slope, k * piece, (k + 1) * piece, known[-1]))
    steps, errors = [1, 2, 4, 8], []
    for n in steps:
        found = Satellite(INERTIA, INPUT, FAULT).simulate(
            RATE,
            Signal.parse("control", control, 3),
            Signal.parse("fault", fault, 3),
            piece / n,
            n * INTERVALS * PIECES,
        )
        errors.append(float(np.max(np.abs(found[::n] - known))))
    assert order(steps, errors) == pytest.approx(4.0, abs=0.1)
    assert errors[-1] < 1e-9


def free_rotation(inertia: Array, rate: Array, step: float, horizon: float) -> Array:
    plant = Satellite(inertia)
    return plant.simulate(rate, NOTHING, NOTHING, step, round(horizon / step))


def test_free_rotation_conserves_energy_and_angular_momentum() -> None:
    steps, drifts = [100, 200, 400, 800], []
    for n in steps:
        rate = free_rotation(INERTIA, np.array([0.9, -1.1, 0.7]), 10.0 / n, 10.0)
        momentum = rate @ INERTIA
        energy = 0.5 * np.sum(rate * momentum, axis=1)
        size = np.linalg.norm(momentum, axis=1)
        drifts.append([np.max(np.abs(x / x[0] - 1)) for x in (energy, size)])
    for drift in np.transpose(drifts):
        assert order(steps, list(drift)) > 3.9
    assert np.max(drifts[-1]) < 1e-9


def test_axisymmetric_body_precesses_as_in_closed_form() -> None:
    # a w1' = (a - c) w2 w3 and a w2' = (c - a) w3 w1: the transverse rate turns at (c - a) w3 / a.
    a, c, spin, transverse = 20.0, 32.0, 1.5, 0.4
    third = np.array([1.0, 2.0, -2.0]) / 3.0
    first = np.array([2.0, 1.0, 2.0]) / 3.0
    axes = np.column_stack([first, np.cross(third, first), third])
    inertia = axes @ np.diag([a, a, c]) @ axes.T
    inertia = (inertia + inertia.T) / 2
    turn = (c - a) / a * spin
    steps, errors = [200, 400, 800, 1600], []
    for n in steps:
        step = 10.0 / n
        angle = turn * step * np.arange(n + 1)
        known = np.column_stack(
            [transverse * np.cos(angle), transverse * np.sin(angle), np.full(n + 1, spin)]
        )
        found = free_rotation(inertia, axes @ known[0], step, 10.0) @ axes
        errors.append(float(np.max(np.abs(found - known))))
    assert order(steps, errors) == pytest.approx(4.0, abs=0.1)
    assert errors[-1] < 1e-9


def test_divergent_plant_reports_its_last_finite_time() -> None:
    # A step far too large for this spin: every step raises the rate until overflow.
    plant_ = Satellite(np.diag([1.0, 2.0, 3.0]))
    with pytest.raises(
        DivergenceError, match=r"^satellite diverged: .* finite up to t = "
    ) as found:
        plant_.simulate([10.0, 11.0, 12.0], NOTHING, NOTHING, 1.0, 100)
    last = round(found.value.time)
    assert np.isfinite(plant_.simulate([10.0, 11.0, 12.0], NOTHING, NOTHING, 1.0, last)).all()
    with pytest.raises(DivergenceError):
        plant_.simulate([10.0, 11.0, 12.0], NOTHING, NOTHING, 1.0, last + 1)


@pytest.mark.parametrize(("inertia", "sentence"), BAD_BODIES)
def test_invalid_inertia_is_refused(inertia: Any, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        Satellite(inertia)


@pytest.mark.parametrize(
    ("changed", "sentence"),
    [
        ({"step": 0.0}, r"^step: 0 must be greater than zero$"),
        ({"step": -0.1}, r"^step: -0.1 must be greater than zero$"),
        ({"steps": 0}, r"^steps: 0 must be a whole number, from 1 to 10000000$"),
        (
            {"initial_rate": [1, 2]},
            r"^initial_rate: has shape \(2,\), must be a list of 3 numbers$",
        ),
    ],
)
def test_invalid_simulation_arguments_are_refused(changed: dict[str, Any], sentence: str) -> None:
    good: dict[str, Any] = {
        "initial_rate": (0.0, 0.0, 0.0), "control": NOTHING, "fault": NOTHING, "step": 0.1,
        "steps": 10,
    }  # fmt: skip
    with pytest.raises(InputError, match=sentence):
        Satellite(INERTIA).simulate(**{**good, **changed})
