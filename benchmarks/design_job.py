"""Designs for one plant in a fresh process: their times and memory, printed as JSON.

``python -m benchmarks.design_job STATES ROUNDS METHOD...``, with the names of `METHODS`.
The rounds take the methods in turns. The process is fresh so that its peak of memory is that of the
first method.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from statistics import median
from typing import Any
from unittest.mock import patch

from benchmarks.design_problem import plant
from reobserve.core.errors import InputError
from reobserve.synthesis.extended_state import design as designs
from reobserve.synthesis.extended_state import pd_pi
from reobserve.synthesis.extended_state.design import CertifiedGains
from reobserve.synthesis.extended_state.feasible_point import SOLVERS
from reobserve.synthesis.extended_state.system import AugmentedSystem

Method = Callable[[AugmentedSystem], CertifiedGains]


def unsplit(system: AugmentedSystem) -> CertifiedGains:
    """By Clarabel, with the cones as they are stated."""
    with patch.dict(SOLVERS["CLARABEL"], chordal_decomposition_enable=False):
        return pd_pi.design(system)


METHODS: dict[str, Method] = {
    "Clarabel": pd_pi.design,
    "SCS": lambda system: pd_pi.design(system, solver="SCS"),
    "unsplit": unsplit,
}


def main() -> None:
    """Warm up on the smallest plant, then measure."""
    states, rounds, names = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3:]
    for name in names:
        METHODS[name](plant(2))
    system, before = plant(states), _peak()
    runs: dict[str, list[dict[str, Any]]] = {name: [] for name in names}
    for _ in range(rounds):
        for name in names:
            try:
                runs[name].append(_measured(METHODS[name], system))
            except InputError as error:
                print(json.dumps({"refused": f"{name}: {error}"}))
                return
            peak = _peak()
            if before is not None and peak is not None:
                runs[name][-1]["memory"] = peak - before
    found = {}
    for name, measured in runs.items():
        # Times are medians; all else is the same in every run, but memory grows in the first.
        times = {
            part: median(run["times"][part] for run in measured) for part in measured[0]["times"]
        }
        found[name] = {**measured[0], "times": times}
        if "iterations" in measured[0]:
            best = min(run["times"]["solver"] for run in measured)
            found[name]["iteration"] = best / measured[0]["iterations"]
    print(json.dumps(found))


def _measured(method: Method, system: AugmentedSystem) -> dict[str, Any]:
    """One design: the times [s] of its parts, what the solver tells of itself, and the design."""
    import clarabel
    import cvxpy

    solvers: list[Any] = []
    make = clarabel.DefaultSolver
    with ExitStack() as stack:
        compiling = stack.enter_context(_timed(cvxpy.Problem, "get_problem_data"))
        solving = stack.enter_context(_timed(cvxpy.Problem, "solve"))
        certifying = stack.enter_context(_timed(designs, "certify"))
        polishing = [
            stack.enter_context(_timed(designs, part)) for part in ("minimiser", "polished")
        ]
        stack.enter_context(
            patch.object(clarabel, "DefaultSolver", lambda *args: _kept(solvers, make(*args)))
        )
        start = time.perf_counter()
        design = method(system)
        whole = time.perf_counter() - start
    times = {
        "design": whole,
        "compilation": sum(compiling),
        "solver": sum(solving) - sum(compiling),
        "polishing": sum(sum(part) for part in polishing),
        "certificate": sum(certifying),
    }
    measured: dict[str, Any] = {"times": times, "design": design.to_dict()}
    if solvers:
        info = solvers[0].get_info()
        inner = info.linsolver
        measured |= {"iterations": info.iterations, "factor": inner.nnzL, "threads": inner.threads}
    return measured


def _kept(place: list[Any], made: Any) -> Any:
    place.append(made)
    return made


@contextmanager
def _timed(owner: Any, name: str) -> Iterator[list[float]]:
    """The times [s] of all calls of a function."""
    function, times = getattr(owner, name), []

    def call(*args: Any, **named: Any) -> Any:
        start = time.perf_counter()
        try:
            return function(*args, **named)
        finally:
            times.append(time.perf_counter() - start)

    with patch.object(owner, name, call):
        yield times


def _peak() -> float | None:
    """The most memory [bytes] this process ever had, where the system tells."""
    # Not getrusage: on Linux that of a new process starts with the peak of its parent.
    try:
        lines = Path("/proc/self/status").read_text(encoding="utf-8").splitlines()
    except OSError:
        return None
    return next(1024.0 * int(line.split()[1]) for line in lines if line.startswith("VmHWM"))


if __name__ == "__main__":
    main()
