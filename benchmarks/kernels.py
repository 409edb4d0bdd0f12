"""The compiled observers against the same loops in C and numpy, and against `solve_ivp`."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable

import numpy as np

from benchmarks import compiled, peers, problem
from benchmarks.problem import DELAY, Array, Observer
from benchmarks.report import Check, Row, Section, seconds
from benchmarks.timing import first_call, interleaved
from reobserve.observers.fixed_step import run_on_halves
from reobserve.observers.rigid_body_observer import RigidBodyState

Pair = tuple[Array, Array]

STEPS = 100_000
_AIM = 0.5  # of C

# Tuned so that scipy is about as accurate as the library with its step of 0.5 ms.
_SCIPY = {"method": "RK45", "rtol": 1e-10, "atol": 5e-12, "first_step": 1e-3}


def run(quick: bool) -> Section:
    """All kernel benchmarks."""
    repeats = 3 if quick else 15
    section = Section(
        f"Observers over {STEPS:,} steps",
        f"best of {repeats} rounds, peers in turns; speed is the peer's time over ours",
    )
    start = time.perf_counter()
    c = compiled.compile_c()
    c_compile = time.perf_counter() - start
    if c is None:
        section.notes.append("no C compiler on the PATH: the comparisons with C are skipped")
    else:
        section.notes.append(f"C: {c.command} ({seconds(c_compile)})")
        for law, observer in problem.observers().items():
            _against_c(section, c, law, observer, repeats)
    _against_numpy(section, 2 * DELAY if quick else 100 * DELAY, repeats)
    _against_scipy(section, 10 if quick else 100, 1 if quick else 3)
    _first_call(section, c_compile if c else None)
    return section


def _against_c(
    section: Section, c: compiled.Compiled, law: str, observer: Observer, repeats: int
) -> None:
    record = problem.sampled_record(STEPS)
    start = observer.init(record[0][0])
    out, c_out = _outputs(STEPS), _outputs(STEPS)
    call = _c_call(c, law, observer, record, c_out)
    times = interleaved(
        {
            "run": lambda: run_on_halves(observer, *record, start=start),
            "loop": lambda: problem.loop(observer, _copy(start), record, out),
            "C": call,
        },
        repeats,
    )
    result = run_on_halves(observer, *record, start=start)
    section.rows += [
        Row(f"{law}: run, checks included", times["run"], "C", times["C"], aim=_AIM),
        Row(f"{law}: compiled loop alone", times["loop"], "C", times["C"], aim=_AIM),
    ]
    # Not bit for bit: another compiler may choose other instructions for the same source.
    for what, ours, theirs, tolerance in (
        ("rate [rad/s]", result["rate"], c_out[0], 1e-13),
        ("fault [N m]", result["fault"], c_out[1], 1e-10),
        ("fault before [N m]", result.before["fault"], c_out[2], 1e-10),
    ):
        section.checks.append(Check(f"{law}, C, {what}", _largest(ours, theirs), tolerance))


def _c_call(
    c: compiled.Compiled, law: str, observer: Observer, record: Pair, out: list[Array]
) -> Callable[[], int]:
    function = c.function(law)
    constants = compiled.constants(problem.constants(observer))
    delay = getattr(observer, "delay", 1)
    samples = compiled.record(*record)
    start = observer.init(record[0][0])

    def call() -> int:
        state = _copy(start)
        places = map(compiled.pointer, (state.rate, state.memory, *out))
        rows: int = function(constants, samples, len(out[0]) - 1, delay, *places)
        return rows

    return call


def _against_numpy(section: Section, steps: int, repeats: int) -> None:
    """A short run of numpy, its time scaled to all steps; and one step at a time on both sides."""
    observer = problem.continuous()
    record = problem.sampled_record(steps)
    whole = problem.sampled_record(STEPS)
    start = observer.init(record[0][0])

    def plain() -> peers.NumpyObserver:
        return peers.NumpyObserver(problem.constants(observer), DELAY, start.rate)

    rate, control = record

    def stepping() -> list[tuple[Array, Array]]:
        state, found = start, []
        for row in range(steps + 1):
            here, between = 2 * row, max(2 * row - 1, 0)
            state, estimate = observer.step(
                state, rate[here], control[here],
                before=(rate[here], control[here]), middle=(rate[between], control[between]),
            )  # fmt: skip
            found.append((estimate["rate"], estimate["fault"]))
        return found

    times = interleaved(
        {
            "run": lambda: run_on_halves(observer, *whole, start=start),
            "numpy": lambda: plain().run(*record),
            "step": stepping,
        },
        min(repeats, 5),
    )
    scaled = times["numpy"] * STEPS / steps
    step, loop = times["step"] / steps, times["run"] / STEPS
    section.rows += [
        Row("continuous: run, checks included", times["run"], "numpy", scaled),
        Row("continuous: one call of step", step, "numpy, one step", times["numpy"] / steps),
    ]
    section.notes += [
        f"numpy ran {steps} steps, its time is scaled to {STEPS:,}",
        f"one call of step: {seconds(step - loop)} of Python around {seconds(loop)} of work",
    ]
    result = run_on_halves(observer, *record, start=start)
    by_numpy = plain().run(*record)
    stepped = [np.array(column) for column in zip(*stepping(), strict=True)]
    section.checks += [
        Check("continuous, numpy, fault [N m]", _largest(result["fault"][:-1], by_numpy[1]), 1e-10),
        Check("continuous, step, rate [rad/s]", _largest(result["rate"], stepped[0]), 0.0),
        Check("continuous, step, fault [N m]", _largest(result["fault"], stepped[1]), 0.0),
    ]


def _against_scipy(section: Section, intervals: int, repeats: int) -> None:
    observer = problem.continuous()
    steps = intervals * DELAY
    record = problem.sampled_record(steps)
    start = observer.init(record[0][0])

    def scipy() -> Pair:
        return peers.solve(problem.constants(observer), start.rate, intervals, **_SCIPY)

    whole = problem.sampled_record(STEPS)
    times = interleaved(
        {"run": lambda: run_on_halves(observer, *whole, start=start), "scipy": scipy}, repeats
    )
    scaled = times["scipy"] * STEPS / steps
    section.rows.append(Row("continuous: run, checks included", times["run"], "solve_ivp", scaled))

    finer = 16
    reference = problem.continuous(problem.STEP / finer)
    fine = problem.sampled_record(steps * finer, problem.STEP / finer)
    exact = run_on_halves(reference, *fine, start=reference.init(start.rate))["fault"]
    exact = exact[:: DELAY * finer][:intervals]
    found = run_on_halves(observer, *record, start=start)["fault"]
    ours = _largest(found[::DELAY][:intervals], exact)
    theirs = _largest(scipy()[1], exact)
    section.checks += [
        Check(f"continuous, run, fault against {finer}-fold steps [N m]", ours, 1e-6),
        Check(f"continuous, solve_ivp, fault against {finer}-fold steps [N m]", theirs, 1e-6),
    ]
    options = ", ".join(f"{name} {value}" for name, value in _SCIPY.items())
    section.notes.append(
        f"solve_ivp ({options}) ran {intervals} intervals of {problem.INTERVAL:g} s, its time is "
        f"scaled to {STEPS:,} steps; fault up to {np.abs(exact).max():.1f} N m"
    )


def _first_call(section: Section, c_compile: float | None) -> None:
    with tempfile.TemporaryDirectory() as cache:
        compiling, loading = (first_call("benchmarks.first_call", cache) for _ in range(2))
    if c_compile is not None:
        section.rows.append(Row("continuous: first run, compiled", compiling, "cc", c_compile))
    section.rows.append(
        Row("continuous: first run, from cache", loading, "compiled", compiling, cost=True)
    )


def _outputs(steps: int) -> list[Array]:
    """Margin for the rate, the fault and its limits from the left."""
    return [np.empty((steps + 1, 3)) for _ in range(3)]


def _copy(state: RigidBodyState) -> RigidBodyState:
    return RigidBodyState(state.rate.copy(), state.memory.copy(), state.sample, state.count)


def _largest(one: Array, other: Array) -> float:
    return float(np.max(np.abs(one - other)))
