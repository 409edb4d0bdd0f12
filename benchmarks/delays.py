"""The delayed pendulum and its extended observer against the same loops in C and `solve_ivp`."""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks import compiled
from benchmarks.compiled import pointer
from benchmarks.delay_scipy import MODEL, RHO, SLOPE, solve
from benchmarks.report import Check, Row, Section, seconds
from benchmarks.timing import interleaved
from reobserve.core.value import for_loop
from reobserve.observers.extended_high_gain import ExtendedHighGainObserver
from reobserve.observers.extended_high_gain import _run as observer_loop
from reobserve.observers.fixed_step import run_on_halves
from reobserve_papers.plants.delayed_input import DelayedInputPlant, _simulate, delayed
from reobserve_papers.signals.inputs import Signal
from reobserve_papers.signals.random_streams import held_normal, random_stream

Array = NDArray[np.float64]

_PARAMETERS = for_loop(MODEL.parameters)
_MODEL = (_PARAMETERS, MODEL.drift, MODEL.input_gain)  # as the observer's loop takes it

HORIZON, STEP = 120.0, 1e-3
STEPS = round(HORIZON / STEP)
_AIM = 0.6  # of C
_START = ([0.87, 0.0], [0.0, 0.0], 0.3)  # x(0), x^(0), tau^(0)
_BOUNDS, _ORDER = (0.0, 1.5), 2

_JUMPS = (0.0, 20.0, 40.0, 60.0, HORIZON)
_CONSTANT = {"kind": "constant", "axis": 1}
_SINE = {"kind": "sine", "axis": 1, "frequency": 0.2}
_PROFILE = [
    {**_CONSTANT, "from": 0, "until": 20, "size": 0.6},
    {**_CONSTANT, "from": 20, "until": 40, "size": 1.2},
    {**_CONSTANT, "from": 40, "until": 60, "size": 0.3},
    {**_CONSTANT, "from": 60, "size": 0.8},
    {**_SINE, "from": 60, "amplitude": 0.45},
]
_DELAY = Signal.parse("delay", _PROFILE, 1)
# Tolerances of DOP853, for the plant and for both, with which scipy is about as accurate as the
# library with its step of 1 ms.
_PLANT, _BOTH = 1e-11, 1e-7

# A run of the study of the paper: noise and step of 10 ms.
_RUNS, _NOISE, _COARSE = 1000, 0.05, 0.01


def _control(kind: str) -> Signal:
    """The input of Fig. 1, on which the delay meets its bounds, or of Fig. 2, with a threshold."""
    past = {**_CONSTANT, "from": -1.5, "size": -1.5 * SLOPE}
    ramp = {"kind": "ramp", "axis": 1, "from": -1.5, "slope": SLOPE}
    sine = {**_SINE, "from": -1.5, "amplitude": 1.0}
    return Signal.parse(kind, [past, ramp] if kind == "ramp" else [sine], 1)


def _inputs(control: Signal, times: NDArray[Any]) -> Array:
    """u, u' and u'' at times, shape (k, 3)."""
    rate = control.derivative("control")
    return np.hstack([control(times), rate(times), rate.derivative("control")(times)])


def _observer(threshold: float, step: float = STEP) -> ExtendedHighGainObserver:
    return ExtendedHighGainObserver(
        MODEL,
        rho=RHO,
        order=_ORDER,
        delay_bounds=_BOUNDS,
        threshold=threshold,
        sampling_period=step,
    )


class _Constants(ctypes.Structure):
    _fields_ = [
        (name, ctypes.c_double)
        for name in ("swing", "damping", "torque", "step", "least", "most", "threshold")
    ]


def run(quick: bool) -> Section:
    """All benchmarks of the paper on delays."""
    repeats = 3 if quick else 15
    section = Section(
        f"Delays: pendulum and extended observer (m = {_ORDER}) over {HORIZON:g} s at 1 ms",
        f"best of {repeats} rounds, peers in turns; speed is the peer's time over ours",
    )
    start = time.perf_counter()
    c = compiled.compile_c("delay.c")
    if c is None:
        section.notes.append("no C compiler on the PATH: the comparisons with C are skipped")
    else:
        section.notes.append(f"C: {c.command} ({seconds(time.perf_counter() - start)})")
        _plant_against_c(section, c.library, repeats)
        for kind, threshold in (("ramp", 0.0), ("sine", 0.7)):
            _observer_against_c(section, c.library, kind, threshold, repeats)
    _against_scipy(section, 1 if quick else 3)
    _many_runs(section, 100 if quick else _RUNS, 1 if quick else 3)
    return section


def _constants(threshold: float) -> Any:
    return ctypes.byref(_Constants(*MODEL.parameters, STEP, *_BOUNDS, threshold))


def _plant_against_c(section: Section, library: ctypes.CDLL, repeats: int) -> None:
    control = _control("ramp")
    times = (np.arange(STEPS) + np.array([[0.0], [0.5], [1.0]])) * STEP
    rows = [delayed(control, _DELAY, row, before=i == 2) for i, row in enumerate(times)]
    inputs, states, by_c = np.array(rows), np.empty((STEPS + 1, 2)), np.empty((STEPS + 1, 2))
    states[0] = by_c[0] = _START[0]
    model = MODEL
    function = library.plant
    function.restype = ctypes.c_long
    call = partial(
        function, _constants(0.0), pointer(inputs), ctypes.c_long(STEPS), pointer(by_c)
    )  # fmt: skip
    whole = partial(DelayedInputPlant(model).simulate, _START[0], control, _DELAY, STEP, STEPS)
    loop = partial(
        _simulate, model.drift, model.input_gain, _PARAMETERS, (0, 0), inputs, STEP, states
    )  # fmt: skip
    times_taken = interleaved({"loop": loop, "simulate": whole, "C": call}, repeats)
    ours, theirs = times_taken["loop"], times_taken["C"]
    section.rows += [
        Row("plant: compiled loop alone", ours, "C", theirs, aim=_AIM),
        Row("plant: simulate, signals included", times_taken["simulate"], "C loop", theirs),
    ]
    section.checks += [
        Check("plant, C, states", _largest(states, by_c), 1e-10),
        Check("plant, simulate, states", _largest(states, whole()), 0.0),
    ]


def _observer_against_c(
    section: Section, library: ctypes.CDLL, kind: str, threshold: float, repeats: int
) -> None:
    observer = _observer(threshold)
    y, u = _record(kind)
    start = observer.init(_START[1], delay=_START[2])
    record = observer._table(y, u, 0)
    states, by_c = np.empty((STEPS + 1, 3)), np.empty((STEPS + 1, 3))
    off, off_by_c = np.zeros(STEPS), np.zeros(STEPS)
    states[0] = by_c[0] = start.values
    function = library.observer
    function.restype = ctypes.c_long
    samples = pointer(record)
    call = partial(
        function, _constants(threshold), samples, samples, ctypes.c_long(STEPS), pointer(by_c),
        pointer(off_by_c),
    )  # fmt: skip
    loop = partial(
        observer_loop, _MODEL, (0, 0), _ORDER, 1, (*_BOUNDS, threshold), STEP, record, record,
        states, off,
    )  # fmt: skip
    times = interleaved(
        {"run": lambda: run_on_halves(observer, y, u, start=start), "loop": loop, "C": call},
        repeats,
    )
    section.rows += [
        Row(f"observer, {kind}: compiled loop alone", times["loop"], "C", times["C"], aim=_AIM),
        Row(f"observer, {kind}: run, checks included", times["run"], "C loop", times["C"]),
    ]
    found = run_on_halves(observer, y, u, start=start)
    section.checks += [
        Check(f"observer, {kind}, C, estimates", _largest(states, by_c), 1e-10),
        Check(f"observer, {kind}, C, share switched off", _largest(off, off_by_c), 1e-10),
        Check(f"observer, {kind}, run, delay [s]", _largest(states[:, 2], found["delay"]), 0.0),
    ]
    held = np.mean((states[:, 2] == _BOUNDS[0]) | (states[:, 2] == _BOUNDS[1]))
    section.notes.append(f"observer, {kind}: held {held:.2%}, switched off {off.mean():.2%}")


def _record(kind: str, step: float = STEP, steps: int = STEPS) -> tuple[Array, Array]:
    """y and the inputs, two samples a step."""
    control = _control(kind)
    plant = DelayedInputPlant(MODEL)
    states = plant.simulate(_START[0], control, _DELAY, 0.5 * step, 2 * steps)
    return states[:, 0].copy(), _inputs(control, np.arange(2 * steps + 1) * (0.5 * step))


def _against_scipy(section: Section, repeats: int) -> None:
    """Plant over all segments of the delay; then both at once, where no mode changes."""
    control = _control("ramp")
    plant = partial(
        DelayedInputPlant(MODEL).simulate, _START[0], control, _DELAY, STEP, STEPS
    )  # fmt: skip
    times = interleaved(
        {"plant": plant, "scipy": lambda: solve(_START[0], _JUMPS, _PLANT)}, repeats
    )
    section.rows.append(Row("plant: simulate", times["plant"], "solve_ivp", times["scipy"]))

    # Close to the truth and up to the first jump, the delay stays off its bounds.
    span = _JUMPS[1]
    steps = round(span / STEP)
    begin = [*_START[0], *_START[0], 0.55]
    observer = _observer(0.0)
    start = observer.init(begin[2:4], delay=begin[4])
    y, u = _record("ramp", STEP, steps)

    def both() -> Array:
        DelayedInputPlant(MODEL).simulate(_START[0], control, _DELAY, 0.5 * STEP, 2 * steps)
        return run_on_halves(observer, y, u, start=start)["delay"]

    pair = interleaved({"both": both, "scipy": lambda: solve(begin, _JUMPS[:2], _BOTH)}, repeats)
    scale = HORIZON / span
    section.rows.append(
        Row("plant and observer", pair["both"] * scale, "solve_ivp", pair["scipy"] * scale)
    )
    fine = DelayedInputPlant(MODEL).simulate(
        _START[0], control, _DELAY, STEP / 4, 4 * STEPS
    )  # fmt: skip
    # After one second, while the delay still moves.
    soon = round(1.0 / STEP)
    finer = _observer(0.0, STEP / 8)
    fine_y, fine_u = _record("ramp", STEP / 8, 8 * soon)
    exact = run_on_halves(finer, fine_y, fine_u, start=start)["delay"][-1]
    by_scipy = float(solve(begin, (0.0, 1.0), _BOTH)[-1][4])
    ends = np.rint(np.array(_JUMPS[1:]) / STEP).astype(int)
    section.checks += [
        Check("plant, states against quarter steps", _largest(plant()[ends], fine[4 * ends]), 1e-9),
        Check(
            "plant, solve_ivp likewise",
            _largest(solve(_START[0], _JUMPS, _PLANT), fine[4 * ends]),
            1e-9,
        ),
        Check("delay at 1 s against eighth steps [s]", float(abs(both()[soon] - exact)), 1e-9),
        Check("delay at 1 s, solve_ivp likewise [s]", float(abs(by_scipy - exact)), 1e-9),
    ]
    section.notes.append(
        f"solve_ivp (DOP853, tolerances {_PLANT:g} and {_BOTH:g}) by segments of the delay; with "
        f"the observer over {span:g} s from close to the truth, where no mode changes, its time "
        f"and ours scaled to {HORIZON:g} s"
    )


def _many_runs(section: Section, runs: int, repeats: int) -> None:
    """Noisy runs as the study does them, in one thread and in two."""
    steps = round(HORIZON / _COARSE)
    y, u = _record("sine", _COARSE, steps)
    observer = _observer(0.7, _COARSE)
    start, limits = observer.init(_START[1], delay=_START[2]), (*_BOUNDS, 0.7)
    stream = random_stream(0, "benchmark")
    # Eight records, each used many times: drawing is not what is measured.
    samples = []
    for _ in range(8):
        both = zip(held_normal(stream, len(y), 2), held_normal(stream, len(y), 2), strict=True)
        samples.append([(y + _NOISE * a, u + _NOISE * np.outer(b, (1, 0, 0))) for a, b in both])
    records = [[observer._table(*side, 0) for side in draw] for draw in samples]

    def checked(number: int) -> float:
        (output, inputs), (output_before, inputs_before) = samples[number % len(samples)]
        done = run_on_halves(
            observer, output, inputs, start=start, y_before=output_before, u_before=inputs_before
        )
        return float(done["delay"][-1])

    def alone(number: int) -> float:
        states, off = np.empty((steps + 1, 3)), np.empty(steps)
        states[0] = start.values
        right, left = records[number % len(samples)]
        observer_loop(
            _MODEL, (0, 0), _ORDER, 1, limits, _COARSE, right, left, states, off
        )  # fmt: skip
        return float(states[-1, 2])

    def found(one: Callable[[int], float], count: int) -> Array:
        with ThreadPoolExecutor(count) as pool:
            return np.array(list(pool.map(one, range(runs))))

    for what, one in (("loop alone", alone), ("run", checked)):
        times = interleaved({f"{n}": partial(found, one, n) for n in (1, 2)}, repeats)
        section.rows.append(
            Row(f"{runs:,} noisy runs, {what}, two threads", times["2"], "one thread", times["1"])
        )
    difference = _largest(found(checked, 1), found(alone, 2))
    section.checks.append(Check("noisy runs, two threads", difference, 0.0))
    section.notes.append(f"a noisy run: {HORIZON:g} s at 10 ms; noise held as long, on y and u")


def _largest(one: Array, other: Array) -> float:
    return float(np.max(np.abs(one - other)))
