"""Printed errors that no other test of the theory shows."""

from __future__ import annotations

import numpy as np
import pytest

from reobserve.observers.adaptive import AdaptiveObserver
from reobserve.observers.fixed_step import run_on_halves
from reobserve.observers.ilo import ILO
from reobserve.synthesis.ilo_certificate import _Design, certify, lemma1_sides
from reobserve.systems.rigid_body import RigidBody
from reobserve_papers.plants.satellite import Satellite
from reobserve_papers.signals.inputs import Signal

INERTIA = np.array([[36, 1.5, 0], [1.5, 17, 0], [0, 0, 26.0]])
STUCK = [{"kind": "constant", "axis": 1, "from": 0.5, "size": 0.5}]


def test_printed_norm_of_assumption_1_violates_inequality_17() -> None:
    # w~ = 0, e(t - tau) = 0 and e = d = (1, 1, 1): dV/dt = e.e = 3, and the maximum norm of d is 1.
    design = _Design.check(1e3, 1.0, 0.1, 1.0, 0.0).evaluate(10, 10, 10, 10, 0.1)
    assert design.holds
    assert design.epsilon3 == pytest.approx(1.2 * 1.2)
    d = np.ones(3)
    derivative = float(d @ d)
    decay = -design.rho1 * derivative
    assert derivative > decay + design.epsilon3 * np.linalg.norm(d, np.inf) ** 2
    assert derivative <= decay + design.epsilon3 * np.linalg.norm(d, 2) ** 2


def test_term_bounded_by_10_enters_7_with_a_minus() -> None:
    # K2 w~ = (1, 0, 0) and d = (-2, 0, 0): the left side of (10) is -4, that in (7) is +4.
    learned, d = np.array([1.0, 0.0, 0.0]), np.array([-2.0, 0.0, 0.0])
    for gamma3 in (0.1, 1.0, 2.0, 30.0):
        bound = gamma3 * learned @ learned + d @ d / gamma3
        assert 2 * learned @ d <= bound  # as printed, where it is vacuous
        assert -2 * learned @ d <= bound  # as (7) needs it: (10) with -d
    error = -learned + d  # e(t - tau) = 0
    assert error @ error == learned @ learned + d @ d - 2 * learned @ d == 9.0


def test_input_of_equation_3_is_the_estimate() -> None:
    step, steps, delay = 1e-3, 4000, 10
    nothing, fault = Signal(3, ()), Signal.parse("fault", STUCK, 3)
    rate = Satellite(INERTIA).simulate(np.zeros(3), nothing, fault, step / 2, 2 * steps)
    observer = ILO(
        RigidBody(INERTIA),
        K1=0.9,
        K2=2000.0,
        observer_gain=10.0,
        update_interval=delay * step,
        sampling_period=step,
    )
    run = run_on_halves(observer, rate, np.zeros_like(rate), start=observer.init(np.zeros(3)))
    v, seen = run["fault"], 2000.0 * (rate[::2] - run["rate"])
    assert v[delay:] == pytest.approx(0.9 * v[:-delay] + seen[delay:], abs=1e-9)
    assert abs(v[-1, 0] - 0.5) < 1e-3


def test_inequality_12_fails_for_some_positive_constants() -> None:
    # K1 e(t - tau) = 1 and K2 w~ = -1 give e = 2: 4 <= alpha4 + alpha5 is false for a half each.
    gains = (np.array([[1.0]]), np.array([[-1.0]]), np.array([[0.0]]), 1.0, 1.0)
    for gamma1 in (0.1, 1.0, 7.0):
        left, right = lemma1_sides(*gains, gamma1, 1e-9, 1e-9)
        assert left[0] == 4.0
        assert right[0] == pytest.approx((1 + gamma1) + (1 + 1 / gamma1))
        assert left[0] <= right[0] * (1 + 1e-12)
    assert left[0] > 0.5 + 0.5


def test_mismatch_of_a_stuck_thruster_equals_the_fault_initially() -> None:
    fault = Signal.parse("fault", STUCK, 3)
    time = np.arange(0, 1000) * 1e-3
    for interval in (0.1, 0.01, 0.001):
        mismatch = (fault(time) - fault(time - interval))[:, 0]
        early = (time > 0.5 - 1e-9) & (time < 0.5 + interval - 1e-9)
        assert np.all(mismatch[early] == 0.5)
        assert np.all(mismatch[~early] == 0.0)


def test_theorem_1_depends_on_the_unit_of_torque() -> None:
    # 2 lambda (1 - k1^2) > k1^2 + 2 k2 + k2^2 is 3 > 1.5 in N m; the same gains in mN m are a
    # thousand times the numbers, and 3000 is less than a million.
    assert certify(2.0, 1.0, 0.5, 0.5).certified
    assert not certify(2000.0, 1.0, 0.5, 500.0).certified


def test_bounded_mean_allows_unbounded_peaks() -> None:
    # |e|^2 = n on [n, n + 1 / n^3): the mean over [0, N] is the sum of 1 / n^2 over N.
    n = np.arange(1, 10_001)
    energy = np.cumsum(n * (1.0 / n**3))
    assert np.all(energy / n <= np.pi**2 / 6)
    assert energy[-1] / n[-1] < 2e-4
    assert n.max() == 10_000  # the running maximum of |e|^2, which grows without bound


def test_stuck_thruster_is_not_a_constant_additive_fault() -> None:
    body = Satellite(INERTIA)
    command = {"kind": "sine", "axis": 1, "amplitude": 0.5, "frequency": 0.5}
    working = Signal.parse("control", [{**command, "until": 0.5}], 3)
    always = Signal.parse("control", [command], 3)
    constant = Signal.parse("fault", STUCK, 3)
    cancelled = {**command, "from": 0.5, "amplitude": -0.5}
    exact = Signal.parse("fault", [*STUCK, cancelled], 3)
    start, grid = [0.05, -0.03, 0.04], (1e-3, 5000)
    stuck = body.simulate(start, working, constant, *grid)
    assert np.abs(body.simulate(start, always, exact, *grid) - stuck).max() < 1e-12
    printed = body.simulate(start, always, constant, *grid)
    impulse = 0.5 * (np.cos(0.25) - np.cos(2.5)) / 0.5  # of the command from 0.5 to 5 s [N m s]
    assert printed[-1, 0] - stuck[-1, 0] == pytest.approx(impulse / 36, rel=0.1)


def test_adaptive_observer_identifies_a_constant_fault() -> None:
    step, steps = 1e-3, 10_000
    nothing, fault = Signal(3, ()), Signal.parse("fault", STUCK, 3)
    rate = Satellite(INERTIA).simulate(np.zeros(3), nothing, fault, step / 2, 2 * steps)
    observer = AdaptiveObserver(
        RigidBody(INERTIA),
        observer_gain=100.0,
        integral_gain=100.0,
        proportional_gain=0.0,
        sampling_period=step,
    )
    run = run_on_halves(observer, rate, np.zeros_like(rate), start=observer.init(np.zeros(3)))
    found = run["fault"][:, 0]
    assert abs(found[-1] - 0.5) < 1e-3
