"""Kalman filters and smoothers against the same in C: many fresh processes, of which medians."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from statistics import median

import numpy as np

from benchmarks.compiled import TUNED
from benchmarks.kalman_problem import ROLLED, Found, build
from benchmarks.kalman_times import ROWS, SIZES, cases
from benchmarks.report import Check, Row, Section
from benchmarks.timing import printed

# What a C programmer would say: contraction is then up to the compiler.
FLAGS = (("-O3",), ("-O3", TUNED))
_TOLERANCE = 1e-9
# Shares of C to keep, for each of `SIZES`. 60 % was aimed at. Beyond `UNROLLED` our loops are
# compiled for all sizes, C for one; the smoother writes what it predicts to memory, C does not.
_SHARES_OF_C = {
    "KF": (0.6, 0.5, 0.5),
    "smoother of KF": (0.25, 0.45, 0.6),
    "EKF": (0.55, 0.5, 0.45),
    "smoother of EKF": (0.3, 0.5, 0.6),
    "UKF": (0.35, 0.4, 0.6),
}
# The aims in CPU microseconds a row, for each of `SIZES`.
_AIMS = {
    "KF": (0.09, 0.17, 0.85),
    "EKF": (0.13, 0.25, 0.95),
    "UKF": (0.45, 0.7, 3.5),
    "smoother of EKF": (0.12, 0.35, 3.6),
}


def run(quick: bool) -> Section:
    """All benchmarks of Kalman filters."""
    processes = 3 if quick else 5
    section = Section(
        f"Kalman filters and smoothers: {ROWS:,} rows, 1 input, 1 output; CPU time of a row",
        f"median of {processes} fresh processes, in each of which peers take turns; ours with "
        "checks included; speed is the peer's time over ours",
    )
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for flags in FLAGS:
            if None in [build(folder, n, flags) for n in SIZES]:
                section.notes.append(f"no C compiler takes {' '.join(flags)}: that C is skipped")
        agreeing = {label: agree(section, label, jobs) for label, jobs in cases(folder)}
        found = [printed("benchmarks.kalman_times", name) for _ in range(processes)]
    for label, peers in agreeing.items():
        times = {peer: [one[label][peer] for one in found] for peer in ("ours", *peers)}
        middle = {peer: median(all_) for peer, all_ in times.items()}
        for peer in peers:
            kind, _, n = label.partition(", n = ")
            aim = (
                None if TUNED in peer or peer == ROLLED else _SHARES_OF_C[kind][SIZES.index(int(n))]
            )
            section.rows.append(Row(label, middle["ours"], peer, middle[peer], aim=aim))
        section.notes.append(_in_figures(label, times))
    return section


def agree(section: Section, label: str, jobs: Mapping[str, Callable[[], Found]]) -> list[str]:
    """Check what the peers compute; the names of those that compute the same."""
    (_, ours), *peers = jobs.items()
    expected, agreeing = ours(), []
    for peer, job in peers:
        pairs = zip(expected, job(), strict=True)
        difference = float(np.max([np.max(np.abs(one - other)) for one, other in pairs]))
        check = Check(f"{label}, {peer}", difference, _TOLERANCE)
        section.checks.append(check)
        if check.agrees:
            agreeing.append(peer)
        else:
            section.notes.append(f"{label}: {peer} computes something else and is not measured")
    return agreeing


def _in_figures(label: str, times: dict[str, list[float]]) -> str:
    """Microseconds, median and worst, and the share of C in the worst process."""
    kind, _, n = label.partition(", n = ")
    aim = f", aim {_AIMS[kind][SIZES.index(int(n))]:g}" if kind in _AIMS else ""
    shown = []
    for peer, all_ in times.items():
        share = min(one / ours for ours, one in zip(times["ours"], all_, strict=True))
        more = aim if peer == "ours" else f", share at least {share:.0%}"
        shown.append(f"{peer} {median(all_) * 1e6:.3g} (worst {max(all_) * 1e6:.3g}{more})")
    return f"{label}, us a row: {'; '.join(shown)}"
