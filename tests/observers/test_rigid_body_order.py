"""Order of convergence against references that never interpolate, and closed forms of rotation.

The references integrate plant and observer together in plain numpy with a Runge-Kutta method of
order 8. The delayed estimate of the continuous observer needs no interpolation if the intervals
are stacked: v of interval i at local time s is K1 v of interval i - 1 at the same s, plus
K2 times the measured rate error. So all intervals up to i run side by side from their initial
values, which are the end values of the stack one interval shorter.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from reobserve.core.errors import InputError
from reobserve.observers.adaptive import AdaptiveObserver
from reobserve.observers.fixed_step import run_on_halves
from reobserve.observers.ilo import ILO
from reobserve.observers.ilo_sampled import SampledILO
from reobserve.observers.rigid_body_observer import RigidBodyObserver, State
from reobserve.observers.run import Run
from reobserve.papers.ilo.setup import stride
from reobserve.plants.satellite import Satellite
from reobserve.replication.parameters.job import read_parameters
from reobserve.replication.parameters.parameters import Parameters
from reobserve.signals.inputs import Signal
from reobserve.systems.rigid_body import RigidBody

Array = NDArray[np.float64]
Terms = tuple[dict[str, Any], ...]

ROOT = Path(__file__).parents[2]

INERTIA = np.array([[36, 1.5, 0], [1.5, 17, 0], [0, 0, 26.0]])
INPUT = np.array([[1.0, 0.1, 0.0], [0.0, 0.9, -0.2], [0.05, 0.0, 1.1]])
FAULT = np.array([[0.9, 0.2, 0.0], [-0.1, 1.1, 0.1], [0.0, 0.15, 0.8]])
OBSERVER_GAIN = np.array([[50.0, 8.0, -3.0], [8.0, 40.0, 5.0], [-3.0, 5.0, 60.0]])
K2 = np.array([[200.0, 20.0, -10.0], [15.0, 160.0, 12.0], [0.0, -25.0, 220.0]])
FORGETTING = np.array([[0.9, 0.05, 0.0], [-0.04, 0.85, 0.06], [0.02, 0.0, 0.8]])
INTEGRAL = np.array([[900.0, 60.0, 0.0], [60.0, 700.0, -40.0], [0.0, -40.0, 800.0]])

INTERVAL, INTERVALS, PIECES = 0.1, 6, 10  # pieces are the largest steps; jumps lie on their ends
RATE, ESTIMATE = np.array([1.2, -1.6, 2.0]), np.array([1.185, -1.59, 1.97])


@dataclass(frozen=True)
class Scenario:
    """Torques, and an offset [rad/s] of the measured rate that makes the record jump."""

    fault: Terms
    control: Terms
    offset: Terms = ()


def scenario(*onsets: float) -> Scenario:
    """A constant, a sine and a ramp from the given times on; the sensor jumps with the ramp."""
    first, second, third = onsets
    return Scenario(
        (
            {"kind": "constant", "axis": 1, "from": first, "size": 3.0},
            {"kind": "sine", "axis": 2, "from": second, "amplitude": 2.0, "frequency": 10.0},
            {"kind": "ramp", "axis": 3, "from": third, "until": 0.5, "slope": 20.0},
        ),
        (
            {"kind": "sine", "axis": 3, "amplitude": 4.0, "frequency": 3.0, "phase": 0.5},
            {"kind": "constant", "axis": 2, "from": second, "size": -2.0},
        ),
        ({"kind": "constant", "axis": 1, "from": third, "size": 0.01},),
    )


SCENARIOS = {"at updates": scenario(0.1, 0.2, 0.3), "between updates": scenario(0.13, 0.24, 0.37)}


# --- References ---------------------------------------------------------------------------------


def value(terms: Terms, time: float, inside: float) -> Array:
    """The terms active at ``inside``, a time in the smooth piece that contains ``time``."""
    total = np.zeros(3)
    for term in terms:
        if term.get("from", 0.0) < inside < term.get("until", np.inf):
            total[term["axis"] - 1] += {
                "constant": lambda t: t["size"],
                "sine": lambda t: (
                    t["amplitude"] * np.sin(t["frequency"] * time + t.get("phase", 0))
                ),
                "ramp": lambda t: t["slope"] * (time - t["from"]),
            }[term["kind"]](term)
    return total


def euler(rate: Array, torque: Array) -> Array:
    """J w' + w x J w = torque, solved for w'."""
    return np.asarray(np.linalg.solve(INERTIA, torque - np.cross(rate, INERTIA @ rate)))


def integrate(slope: Callable[[float, Array], Array], start: float, end: float, y: Array) -> Array:
    """The state at ``end``: the last step ends there, without interpolation."""
    found = solve_ivp(slope, (start, end), y, method="DOP853", rtol=1e-12, atol=1e-14)
    assert found.success
    return np.asarray(found.y[:, -1])


@dataclass(frozen=True)
class Reference:
    """At the ends of all pieces; ``fault`` from the right, ``before`` from the left."""

    rate: Array
    fault: Array
    before: Array


def empty_reference() -> Reference:
    return Reference(*np.full((3, INTERVALS * PIECES + 1, 3), np.nan))


def observer_slope(rate: Array, measured: Array, known: Array, estimate: Array) -> Array:
    """w^' under B u and B_f f^, which are in ``known``."""
    return euler(rate, OBSERVER_GAIN @ (measured - rate) + known + FAULT @ estimate)


@cache
def stacked_reference(where: str, identity: bool) -> Reference:
    """Plant and continuous observer, the intervals stacked (see the top of this file)."""
    case, K1 = SCENARIOS[where], np.eye(3) if identity else FORGETTING
    piece = INTERVAL / PIECES
    record = empty_reference()
    starts = [np.concatenate([RATE, ESTIMATE])]

    def learned(y: Array, local: float, inside: float) -> Array:
        """v of every interval in the stack."""
        estimates, v = [], np.zeros(3)
        for i, (w, estimate) in enumerate(y.reshape(-1, 2, 3)):
            offset = value(case.offset, i * INTERVAL + local, i * INTERVAL + inside)
            v = K1 @ v + K2 @ (w + offset - estimate)
            estimates.append(v)
        return np.array(estimates)

    for last in range(INTERVALS):
        y = np.concatenate(starts)
        for m in range(PIECES):
            inside = (m + 0.5) * piece

            def slope(local: float, y: Array, inside: float = inside) -> Array:
                slopes = []
                stack = zip(y.reshape(-1, 2, 3), learned(y, local, inside), strict=True)
                for i, ((w, estimate), v) in enumerate(stack):
                    now, within = i * INTERVAL + local, i * INTERVAL + inside
                    known = INPUT @ value(case.control, now, within)
                    measured = w + value(case.offset, now, within)
                    slopes.append(euler(w, known + FAULT @ value(case.fault, now, within)))
                    slopes.append(observer_slope(estimate, measured, known, v))
                return np.concatenate(slopes)

            k = last * PIECES + m
            record.rate[k] = y[-3:]
            record.fault[k] = learned(y, m * piece, inside)[-1]
            y = integrate(slope, m * piece, (m + 1) * piece, y)
            record.before[k + 1] = learned(y, (m + 1) * piece, inside)[-1]
        starts.append(y[-6:])
    # The law at the very end, where the next interval would start.
    w, estimate = y[-6:-3], y[-3:]
    end = INTERVALS * INTERVAL
    error = w + value(case.offset, end, end + 0.5 * piece) - estimate
    record.rate[-1] = estimate
    record.fault[-1] = K1 @ record.fault[-1 - PIECES] + K2 @ error
    return record


@cache
def plain_reference(where: str, kind: str) -> Reference:
    """Plant and sampled or adaptive observer, piece by piece."""
    case, piece = SCENARIOS[where], INTERVAL / PIECES
    record = empty_reference()
    w, estimate, memory = RATE, ESTIMATE, np.zeros(3)

    def fault_estimate(memory: Array, error: Array) -> Array:
        return memory if kind == "sampled" else memory + 0.1 * K2 @ error

    for k in range(INTERVALS * PIECES + 1):
        inside = (k + 0.5) * piece
        error = w + value(case.offset, k * piece, inside) - estimate
        if k:
            before = w + value(case.offset, k * piece, inside - piece) - estimate
            record.before[k] = fault_estimate(memory, before)
        if kind == "sampled" and k % PIECES == 0:
            memory = FORGETTING @ memory + K2 @ error
        record.rate[k] = estimate
        record.fault[k] = fault_estimate(memory, error)

        def slope(time: float, y: Array, inside: float = inside) -> Array:
            w, estimate, memory = y.reshape(3, 3)
            known = INPUT @ value(case.control, time, inside)
            measured = w + value(case.offset, time, inside)
            error = measured - estimate
            v = fault_estimate(memory, error)
            return np.concatenate(
                [
                    euler(w, known + FAULT @ value(case.fault, time, inside)),
                    observer_slope(estimate, measured, known, v),
                    np.zeros(3) if kind == "sampled" else INTEGRAL @ error,
                ]
            )

        y = np.concatenate([w, estimate, memory])
        w, estimate, memory = integrate(slope, k * piece, (k + 1) * piece, y).reshape(3, 3)
    return record


# --- The package --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Deviation:
    """The largest deviations from the reference, for a number of steps per interval."""

    rate: float
    fault: float
    before: float


def simulate(where: str, build: Callable[[float], RigidBodyObserver], steps: int) -> Run[State]:
    """Plant on the grid of half steps, with the observer on it."""
    case, h = SCENARIOS[where], INTERVAL / steps
    half_steps = 2 * steps * INTERVALS
    fault, control, offset = (
        Signal.parse("test", terms, 3) for terms in (case.fault, case.control, case.offset)
    )
    rate = Satellite(INERTIA, INPUT, FAULT).simulate(RATE, control, fault, h / 2, half_steps)
    time = np.arange(half_steps + 1) * (h / 2)
    observer = build(h)
    run = run_on_halves(
        observer, rate + offset(time), control(time), state=observer.init(ESTIMATE),
        y_before=rate + offset(time, before=True), u_before=control(time, before=True),
    )  # fmt: skip
    assert run.diverged_at is None
    return run


def deviation(
    where: str, build: Callable[[float], RigidBodyObserver], steps: int, reference: Reference
) -> Deviation:
    every, run = steps // PIECES, simulate(where, build, steps)
    pairs = (
        (run["rate"][::every], reference.rate),
        (run["fault"][::every], reference.fault),
        (run.before["fault"][::every][1:], reference.before[1:]),  # only differences after t = 0
    )
    return Deviation(*(float(np.max(np.abs(found - known))) for found, known in pairs))


def order(steps: list[int], deviations: list[float]) -> float:
    """The slope of log deviation over log step."""
    return float(-np.polyfit(np.log(steps), np.log(deviations), 1)[0])


def check_order(
    where: str, build: Callable[[float], RigidBodyObserver], reference: Reference
) -> None:
    steps = [10, 20, 40, 80]
    found = [deviation(where, build, n, reference) for n in steps]
    for name in ("rate", "fault", "before"):
        assert order(steps, [getattr(d, name) for d in found]) == pytest.approx(4.0, abs=0.1), name
    fine = deviation(where, build, 160, reference)
    assert max(fine.rate, fine.fault, fine.before) < 1e-9


BODY = RigidBody(INERTIA, INPUT, FAULT)


def continuous(K1: Array) -> Callable[[float], RigidBodyObserver]:
    return lambda step: ILO(BODY, K1, K2, OBSERVER_GAIN, INTERVAL, sampling_period=step)


@pytest.mark.parametrize("identity", [False, True], ids=["forgetting", "identity"])
@pytest.mark.parametrize("where", SCENARIOS)
def test_continuous_observer_is_of_order_4(where: str, identity: bool) -> None:
    K1 = np.eye(3) if identity else FORGETTING
    check_order(where, continuous(K1), stacked_reference(where, identity))


@pytest.mark.parametrize("identity", [False, True], ids=["forgetting", "identity"])
@pytest.mark.parametrize("where", SCENARIOS)
def test_jump_of_the_estimate_recurs_every_interval(where: str, identity: bool) -> None:
    # w^ is continuous: v jumps by K2 w~(0) at t = 0 and by K2 b where the sensor jumps by b, and
    # K1 hands every jump on to one interval later. Whatever is integrated in between cancels.
    K1 = np.eye(3) if identity else FORGETTING
    expected = np.zeros((INTERVALS * PIECES + 1, 3))
    sensor = SCENARIOS[where].offset[0]
    jumps = [(0.0, RATE - ESTIMATE), (sensor["from"], np.array([sensor["size"], 0, 0]))]
    for onset, size in jumps:
        first = round(onset / INTERVAL * PIECES)
        for i, k in enumerate(range(first, len(expected), PIECES)):
            expected[k] += np.linalg.matrix_power(K1, i) @ K2 @ size
    expected[0] = 0.0  # only differences after t = 0
    run = simulate(where, continuous(K1), 2 * PIECES)
    assert (run["fault"] - run.before["fault"])[::2] == pytest.approx(expected, abs=1e-11)


@pytest.mark.parametrize("where", SCENARIOS)
def test_sampled_observer_is_of_order_4(where: str) -> None:
    def build(step: float) -> SampledILO:
        return SampledILO(BODY, FORGETTING, K2, OBSERVER_GAIN, INTERVAL, sampling_period=step)

    check_order(where, build, plain_reference(where, "sampled"))


@pytest.mark.parametrize("where", SCENARIOS)
def test_adaptive_observer_is_of_order_4(where: str) -> None:
    def build(step: float) -> AdaptiveObserver:
        return AdaptiveObserver(BODY, OBSERVER_GAIN, INTEGRAL, 0.1 * K2, sampling_period=step)

    check_order(where, build, plain_reference(where, "adaptive"))


# --- The plant alone ----------------------------------------------------------------------------

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


@pytest.mark.parametrize(
    ("period", "samples"),
    [(0.002, 1), (0.004, 2), (0.02, 10), (0.001, 0), (0.003, 0), (1e-6, 0)],
)
def test_half_period_must_be_a_whole_number_of_samples(period: float, samples: int) -> None:
    observer = SampledILO(
        RigidBody(inertia=np.eye(3)),
        K1=1.0,
        K2=0.1,
        observer_gain=1.0,
        update_interval=period,
        sampling_period=period,
    )
    plant = replace(read_parameters(Parameters.load(ROOT, "ilo")).plant, step=0.001)
    if samples:
        assert stride(plant, observer) == samples
    else:
        with pytest.raises(InputError, match=r"^sampling_period: .* even multiple of plant.step"):
            stride(plant, observer)
