"""The extended observer against an independent integration, its order and its bounds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from reobserve.observers.extended_high_gain import ExtendedHighGainObserver, ExtendedHighGainState
from reobserve.observers.fixed_step import run_on_halves
from reobserve.observers.run import Run
from reobserve.systems.triangular_text import triangular_model
from tests.reobserve.observers.small_plants import (
    DELAYS,
    G_OVER_L,
    GAIN,
    MEET,
    START,
    A,
    pendulum,
    pendulum_slope,
    trajectory,
)

Array = NDArray[np.float64]

BOUNDS = (0.0, 1.5)
FIRST_DELAY = 0.3


@dataclass(frozen=True)
class Case:
    """A run of the pendulum observer along the delay of the paper."""

    applied: str
    rho: float
    order: int
    threshold: float = 0.0
    switched: str = "delay"
    dynamic: bool = False
    bounds: tuple[float, float] = BOUNDS


# The control with its derivatives, also before t = 0.
CONTROLS: dict[str, Callable[[Any], list[Any]]] = {
    "ramp": lambda t: [0.009 * t, 0.009 + 0 * t, 0 * t],
    "sine": lambda t: [np.sin(0.2 * t), 0.2 * np.cos(0.2 * t), -0.04 * np.sin(0.2 * t)],
}


def delay_in(inside: float) -> Callable[[float], float]:
    """The delay in the piece that contains a time."""
    return DELAYS[sum(inside >= jump for jump in MEET[1:-1])]


@cache
def plant(applied: str) -> Callable[[Array], Array]:
    """The states of the pendulum at any times."""

    def slope(t: float, x: Array, inside: float) -> Array:
        return pendulum_slope(x, CONTROLS[applied](t - delay_in(inside)(t))[0])

    return trajectory(slope, START, MEET)


@cache
def record(applied: str, step: float, end: float) -> tuple[Array, Array]:
    """y and u, u', u'' of the pendulum at each half step."""
    time = 0.5 * step * np.arange(round(2 * end / step) + 1)
    return plant(applied)(time)[:, 0].copy(), np.stack(CONTROLS[applied](time), axis=1)


def observer(case: Case, step: float) -> ExtendedHighGainObserver:
    return ExtendedHighGainObserver(
        pendulum(), rho=case.rho, order=case.order, delay_bounds=case.bounds,
        threshold=case.threshold, switched=case.switched,
        initial_matrix=1.0 if case.dynamic else None, sampling_period=step,
    )  # fmt: skip


def observed(case: Case, step: float, end: float) -> Run[ExtendedHighGainState]:
    y, u = record(case.applied, step, end)
    built = observer(case, step)
    start = built.init([0.0, 0.0], delay=FIRST_DELAY)
    inputs = u[:, : case.order + 1]
    return run_on_halves(built, y, inputs, start=start, on_divergence="return")


def together(run: Run[ExtendedHighGainState]) -> Array:
    return np.column_stack([run["state"], run["delay"]])


# ---- The same equations, independently: plant, observer and S by DOP853 from event to event


class Equations:
    """Right-hand sides and events of one mode: held at a bound (-1, 0, 1), switched off or not."""

    def __init__(self, case: Case) -> None:
        self.case, self.u, self.tau = case, CONTROLS[case.applied], DELAYS[0]
        self.held, self.off = 0, False

    def xi(self, t: float, v: Array) -> float:
        _, rate, bend = self.u(t)
        return GAIN * (-rate + (0.5 * v[4] * bend if self.case.order == 2 else 0.0))

    def gains(self, v: Array) -> Array:
        rho = self.case.rho
        if not self.case.dynamic:
            return np.array([3 * rho, 3 * rho**2, rho**3])
        return np.linalg.solve(v[5:].reshape(3, 3), [1.0, 0.0, 0.0])

    def raw(self, t: float, v: Array) -> float:
        return -float(self.gains(v)[2]) * (v[2] - v[0]) / self.xi(t, v)

    def slope(self, t: float, v: Array) -> Array:
        gain, error = self.gains(v), v[2] - v[0]
        if self.off and self.case.switched == "all":
            error = 0.0
        push = GAIN * self.u(t)[0] + self.xi(t, v) * v[4]
        late = GAIN * self.u(t - self.tau(t))[0]
        out = np.zeros(len(v))
        out[:5] = (
            v[1], -G_OVER_L * np.sin(v[0]) - A * v[1] + late,
            v[3] - gain[0] * error,
            -G_OVER_L * np.sin(v[2]) - A * v[3] + push - gain[1] * error,
            0.0 if self.held or self.off else -gain[2] * error / self.xi(t, v),
        )  # fmt: skip
        if self.case.dynamic:
            S, shift = v[5:].reshape(3, 3), np.eye(3, k=1)
            moved = -self.case.rho * S - shift.T @ S - S @ shift
            moved[0, 0] += 1.0
            out[5:] = moved.ravel()
        return out

    def events(self) -> dict[str, tuple[Callable[[float, Array], float], int]]:
        """The events that end the mode: functions crossing zero, with the direction."""
        found: dict[str, tuple[Callable[[float, Array], float], int]] = {}
        if self.case.threshold > 0:
            turn = 1 if self.off else -1
            found["switch"] = (lambda t, v: abs(self.xi(t, v)) - self.case.threshold, turn)
        if self.held:
            found["free"] = (lambda t, v, side=self.held: side * self.raw(t, v), -1)  # type: ignore[misc]
        elif not self.off:
            found["lower"] = (lambda t, v: v[4] - self.case.bounds[0], -1)
            found["upper"] = (lambda t, v: v[4] - self.case.bounds[1], 1)
        return found

    def change(self, name: str, t: float, v: Array) -> None:
        """Change to the mode after an event."""
        if name == "switch":
            self.off, self.held = not self.off, 0
            for side, bound in zip((-1, 1), self.case.bounds, strict=True):
                if not self.off and v[4] == bound and side * self.raw(t, v) > 0:
                    self.held = side
            return
        self.held = {"lower": -1, "free": 0, "upper": 1}[name]
        if self.held:
            v[4] = self.case.bounds[self.held > 0]


@cache
def reference(case: Case, marks: tuple[float, ...]) -> tuple[Array, list[tuple[str, float]]]:
    """The state and delay estimates at the marks, and the events [s]; steps end at marks, jumps and
    events.
    """
    v = np.array([*START, 0.0, 0.0, FIRST_DELAY, *(np.eye(3).ravel() if case.dynamic else ())])
    t, rows, log, equations = 0.0, [], [], Equations(case)
    equations.off = abs(equations.xi(t, v)) < case.threshold
    for stop in sorted({*marks, *(jump for jump in MEET[1:-1] if jump < marks[-1])}):
        equations.tau = delay_in(t)
        while stop - t > 1e-13:
            names, events = [], []
            for name, (function, direction) in equations.events().items():
                event = lambda t, v, function=function: function(t, v)  # noqa: E731
                event.terminal, event.direction = True, direction  # type: ignore[attr-defined]
                names.append(name)
                events.append(event)
            done = solve_ivp(
                equations.slope, (t, stop), v, method="DOP853", rtol=1e-12, atol=1e-15,
                max_step=0.02, events=events,
            )  # fmt: skip
            assert done.success
            t, v = float(done.t[-1]), done.y[:, -1].copy()
            if done.status == 1:
                came = next(n for n, at in zip(names, done.t_events, strict=True) if len(at))
                equations.change(came, t, v)
                log.append((came, t))
        t = stop
        if stop in marks:
            rows.append(v[2:5])
    return np.array(rows), log


EARLY = tuple(np.round(0.05 * np.arange(1, 21), 10).tolist())


def marks(end: int) -> tuple[float, ...]:
    return (*EARLY, *(float(second) for second in range(2, end + 1)))


def error(case: Case, step: float, end: int) -> float:
    rows = np.round(np.array(marks(end)) / step).astype(int)
    return float(
        np.max(np.abs(together(observed(case, step, end))[rows] - reference(case, marks(end))[0]))
    )


NARROW = (0.2, 0.9)  # the delay of 0.6 s is inside, that of 1.2 s is not
# The minimum number of events; without any the comparison would mean little.
CASES = {
    "ramp, m = 1, three jumps": (Case("ramp", 5.0, 1), 66, 4),
    "ramp, m = 2": (Case("ramp", 5.0, 2), 24, 4),
    "ramp, dynamic": (Case("ramp", 5.0, 2, dynamic=True), 24, 0),
    "ramp, dynamic, narrow": (Case("ramp", 5.0, 2, dynamic=True, bounds=NARROW), 44, 4),
    "sine, m = 1": (Case("sine", 2.5, 1, 0.7), 28, 4),
    "sine, m = 2, narrow": (Case("sine", 2.5, 2, 0.7, bounds=NARROW), 28, 8),
    "sine, m = 1, all": (Case("sine", 2.5, 1, 0.7, "all"), 28, 4),
    "sine, m = 2, all, narrow": (Case("sine", 2.5, 2, 0.7, "all", bounds=NARROW), 28, 8),
    "sine, m = 2, dynamic": (Case("sine", 2.5, 2, 0.7, dynamic=True), 28, 4),
}


@pytest.mark.nightly_after(1)
@pytest.mark.parametrize("name", CASES)
def test_agrees_with_an_independent_integration(name: str) -> None:
    case, end, events = CASES[name]
    assert error(case, 1e-3 if case.applied == "sine" else 5e-4, end) < 3e-10
    assert len(reference(case, marks(end))[1]) == events


@pytest.mark.parametrize("name", CASES)
def test_order_is_four_with_projection_and_switching(name: str) -> None:
    case, end, _ = CASES[name]
    coarse, fine = error(case, 0.005, end), error(case, 0.00125, end)
    assert 3.8 < np.log2(coarse / fine) / 2 < 4.2


# ---- Inside steps


def inside(case: Case, step: float, run: Run[ExtendedHighGainState], k: int, share: float) -> float:
    """The delay at a fraction of step k, by a shorter step on the parabola through the same
    samples.

    For the algebraic S, whose gains are constant.
    """
    y, u = record(case.applied, step, (len(run) - 1) * step)
    theta = share * np.array([[0.0], [0.5], [1.0]])
    weights = np.hstack([
        2 * (theta - 0.5) * (theta - 1), 4 * theta * (1 - theta), 2 * theta * (theta - 0.5)
    ])  # fmt: skip
    three = slice(2 * k, 2 * k + 3)
    built = observer(case, share * step)
    start = built.init(run["state"][k], delay=run["delay"][k])
    inputs = weights @ u[three, : case.order + 1]
    return float(run_on_halves(built, weights @ y[three], inputs, start=start)["delay"][-1])


def test_projection_instants_agree_with_bisection() -> None:
    """When the delay reaches or leaves a bound, to a fraction of the step, by bisection."""
    case, step = CASES["ramp, m = 2"][0], 5e-4
    run = observed(case, step, 1.0)
    held = np.isin(run["delay"], BOUNDS)
    found = []
    for k in np.flatnonzero(np.diff(held)):
        low, high = 0.0, 1.0
        while high - low > 1e-6:
            middle = 0.5 * (low + high)
            if (inside(case, step, run, k, middle) in BOUNDS) == held[k]:
                low = middle
            else:
                high = middle
        found.append((k + low) * step)
    known = [instant for _, instant in reference(case, EARLY)[1]]
    # Just released, the delay grows quadratically and stays on the bound within rounding at first.
    assert found[0::2] == pytest.approx(known[0::2], abs=2e-9)
    assert found[1::2] == pytest.approx(known[1::2], abs=2e-8)
    assert found == pytest.approx([4.984e-4, 0.11627, 0.15760, 0.55429], abs=5e-6)


@pytest.mark.parametrize("seed", range(12))
def test_delay_stays_within_its_interval(seed: int) -> None:
    """From any start and with any gain, with steps far too long for accuracy."""
    draw = np.random.default_rng(seed)
    applied, step, end = (("ramp", 0.05, 3.0), ("sine", 0.02, 10.0))[seed % 2]
    case = Case(
        applied, draw.uniform(1.5, 15), int(draw.integers(1, 3)), 0.7 * (seed % 2),
        ("delay", "all")[int(draw.integers(2))], seed % 3 == 0, ((0.0, 1.5), NARROW)[seed % 4 > 1],
    )  # fmt: skip
    y, u = record(applied, step, end)
    built = observer(case, step)
    start = built.init(draw.uniform(-2, 2, 2), delay=draw.uniform(*case.bounds))
    run = run_on_halves(built, y, u[:, : case.order + 1], start=start)
    assert run.diverged_at is None
    assert run["delay"].min() >= case.bounds[0]
    assert run["delay"].max() <= case.bounds[1]


def test_peak_between_samples_stays_within_the_interval() -> None:
    """The bound lies between the peak and the adjacent samples: both ends of the step are
    inside."""
    step, small = 0.02, 1e-4
    free = Case("ramp", 5.0, 2, dynamic=True, bounds=(0.0, 5.0))
    coarse, fine = (observed(free, h, 1.6)["delay"] for h in (step, small))
    bound = 0.5 * float(coarse.max() + fine.max())
    assert fine.max() - bound > 5e-5
    narrow = Case("ramp", 5.0, 2, dynamic=True, bounds=(0.0, bound))
    cut, known = (observed(narrow, h, 1.6)["delay"] for h in (step, small))
    after = np.arange(len(cut)) > int(np.argmax(coarse)) + 1
    missed, left = (np.abs(d - known[:: round(step / small)])[after].max() for d in (coarse, cut))
    assert left < 0.5 * missed


@pytest.mark.parametrize("rho", [5.0, 10.0, 20.0])
def test_delay_stays_finite_without_a_threshold(rho: float) -> None:
    """Where xi crosses zero the delay moves to a bound, is held there, and moves to the other."""
    assert observed(Case("sine", rho, 1), 0.01, 10.0).diverged_at is None


@pytest.mark.parametrize("step", [0.01, 0.001])
def test_sliding_along_the_threshold_agrees_with_theory(step: float) -> None:
    # xi^ = tau^ / 2 - t - 0.15 falls while the delay's gain is off, and rises while it is on, as
    # that moves tau^ by about 4 s a second: from 0.05 s on it slides along -0.1, so tau^ by 2.
    model = triangular_model(["x"], ["0"], "1")
    made = ExtendedHighGainObserver(
        model, rho=0.01, order=2, delay_bounds=(0.0, 1.5), threshold=0.1, sampling_period=step
    )
    t = step * np.arange(round(0.5 / step) + 1)
    u = np.column_stack([0.5 * t**2 + 0.15 * t, t + 0.15, np.ones_like(t)])
    run = made.run(np.full((len(t), 1), -4000.0), u, start=made.init([0.0], delay=0.2))
    assert run["delay"] == pytest.approx(np.maximum(0.2, 2.0 * t + 0.1), abs=2.5 * step)
    assert np.mean(run["switched_off"][t > 0.06]) == pytest.approx(0.5, abs=0.05)
