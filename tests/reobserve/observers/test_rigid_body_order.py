"""Order of convergence against references that never interpolate.

The references integrate plant and observer together in plain numpy with a Runge-Kutta method of
order 8. The delayed estimate of the continuous observer needs no interpolation if the intervals
are stacked: v of interval i at local time s is K1 v of interval i - 1 at the same s, plus
K2 times the measured rate error. So all intervals up to i run side by side from their initial
values, which are the end values of the stack one interval shorter.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from reobserve.observers.adaptive import AdaptiveObserver
from reobserve.observers.fixed_step import run_on_halves
from reobserve.observers.ilo import ILO, SampledILO
from reobserve.observers.rigid_body_observer import RigidBodyObserver, RigidBodyState
from reobserve.observers.run import Run
from reobserve.systems.rigid_body import RigidBody
from tests.reobserve.observers.small_plants import trajectory

Array = NDArray[np.float64]
Terms = tuple[dict[str, Any], ...]

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


@cache
def plant(where: str) -> Callable[[Array], Array]:
    """The true rate at any times."""
    case = SCENARIOS[where]

    def slope(time: float, rate: Array, inside: float) -> Array:
        known = INPUT @ value(case.control, time, inside)
        return euler(rate, known + FAULT @ value(case.fault, time, inside))

    edges = INTERVAL / PIECES * np.arange(INTERVALS * PIECES + 1)
    return trajectory(slope, RATE, edges.tolist())


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


def simulate(
    where: str, build: Callable[[float], RigidBodyObserver], steps: int
) -> Run[RigidBodyState]:
    """Plant on the grid of half steps, with the observer on it."""
    case, h = SCENARIOS[where], INTERVAL / steps
    half_steps = 2 * steps * INTERVALS
    time = np.arange(half_steps + 1) * (h / 2)
    rate = plant(where)(time)

    def limits(side: float) -> tuple[Array, Array]:
        """The measured rate and the control, at times from one side of possible jumps."""
        offset, control = (
            np.array([value(terms, t, t + side) for t in time])
            for terms in (case.offset, case.control)
        )
        return rate + offset, control

    (y, u), (y_before, u_before) = limits(1e-9), limits(-1e-9)
    y_before[0], u_before[0] = y[0], u[0]
    observer = build(h)
    run = run_on_halves(
        observer, y, u, start=observer.init(ESTIMATE), y_before=y_before, u_before=u_before
    )
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
    return lambda step: ILO(
        BODY,
        K1=K1,
        K2=K2,
        observer_gain=OBSERVER_GAIN,
        update_interval=INTERVAL,
        sampling_period=step,
    )


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
        return SampledILO(
            BODY,
            K1=FORGETTING,
            K2=K2,
            observer_gain=OBSERVER_GAIN,
            update_interval=INTERVAL,
            sampling_period=step,
        )

    check_order(where, build, plain_reference(where, "sampled"))


@pytest.mark.parametrize("where", SCENARIOS)
def test_adaptive_observer_is_of_order_4(where: str) -> None:
    def build(step: float) -> AdaptiveObserver:
        return AdaptiveObserver(
            BODY,
            observer_gain=OBSERVER_GAIN,
            integral_gain=INTEGRAL,
            proportional_gain=0.1 * K2,
            sampling_period=step,
        )

    check_order(where, build, plain_reference(where, "adaptive"))
