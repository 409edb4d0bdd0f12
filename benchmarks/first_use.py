"""The first run of a filter with nothing compiled yet, and what a call costs once all is."""

from __future__ import annotations

import tempfile
from statistics import median

from benchmarks.report import Row, Section, seconds
from benchmarks.timing import printed

_JOB = "benchmarks.first_use_job"
# The aims in CPU seconds and in CPU microseconds.
_FIRST = {"KF": 2.5, "IMM": 3.5, "EKF": 3.7, "UKF": 6.5}
_CALLS = {"run": 22.0, "KF": 20.0, "EKF": 39.0, "UKF": 32.0, "IMM": 28.0}
_LABELS = {
    "KF": "KF",
    "IMM": "IMM of two KF",
    "EKF": "EKF of a text",
    "UKF": "UKF of a text",
    "run": "KF: run of one row",
}


def run(quick: bool) -> Section:
    """All benchmarks of first uses and single calls."""
    processes = 3 if quick else 5
    section = Section(
        "First use with an empty cache, imports included, and later calls; CPU times, 2 states",
        f"median of {processes} fresh processes; cost is our time over the peer's, speed the "
        "peer's over ours",
    )
    firsts = {what: [_first(what) for _ in range(processes)] for what in ("imports", *_FIRST)}
    for what, aim in _FIRST.items():
        ours, theirs = median(firsts[what]), median(firsts["imports"])
        label = f"{_LABELS[what]}: first run"
        section.rows.append(Row(label, ours, "import numba", theirs, cost=True))
        section.notes.append(_in_figures(label, firsts[what], aim))
    calls = [printed(_JOB, "calls") for _ in range(processes)]
    for what, aim in _CALLS.items():
        label = _LABELS[what] if what == "run" else f"{_LABELS[what]}: one call of step"
        peer = "filterpy KF" if what == "run" else f"filterpy {what}"
        times, peers = ([one[name] for one in calls] for name in (what, peer))
        section.rows.append(Row(label, median(times), "filterpy", median(peers)))
        if what == "KF" and "JAX" in calls[0]:
            jitted = median(one["JAX"] for one in calls)
            section.rows.append(Row(label, median(times), "JAX", jitted))
        section.notes.append(_in_figures(label, times, aim * 1e-6))
    section.notes.append("filterpy: one call of predict and one of update")
    return section


def _first(what: str) -> float:
    with tempfile.TemporaryDirectory() as cache:
        return float(printed(_JOB, what, NUMBA_CACHE_DIR=cache))


def _in_figures(label: str, times: list[float], aim: float) -> str:
    return f"{label}: {seconds(median(times))} (worst {seconds(max(times))}, aim {seconds(aim)})"
