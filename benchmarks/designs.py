"""Designs of extended state observers by Clarabel and SCS, and their use."""

from __future__ import annotations

import json
import subprocess
import sys
from math import log
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import design_simulation
from benchmarks.design_problem import plant
from benchmarks.report import Check, Row, Section, seconds

_STATES, _FEW_STATES = (2, 4, 8, 12, 16, 24), (2, 8, 12)
_UNSPLIT = (8, 12)  # states at which cones are left whole, too; it takes much longer with more
# Relative to the largest: what is left once Newton's method has finished what a solver began.
_AGREE = 1e-9

Found = dict[str, dict[str, Any]]


def run(quick: bool) -> Section:
    """All benchmarks of extended state observers."""
    section = Section(
        "Extended state observers: design by (19), and simulation",
        "designs in a fresh process for each plant, warmed up, certificate included: median of "
        f"{'1 round' if quick else '5 rounds, of 3 from n = 12 on'}, peers in turns",
    )
    by_clarabel = {}
    for states in _FEW_STATES if quick else _STATES:
        found = _solvers(section, states, _rounds(states, quick))
        if found is not None:
            by_clarabel[states] = found
    for states in _UNSPLIT[:1] if quick else _UNSPLIT:
        if states in by_clarabel:
            _unsplit(section, states, _rounds(states, quick), by_clarabel[states])
    if len(by_clarabel) > 1:
        section.notes += _growth(by_clarabel)
    design_simulation.add(section, quick)
    return section


def _rounds(states: int, quick: bool) -> int:
    if quick:
        return 1
    return 5 if states <= 8 else 3


def _job(section: Section, states: int, rounds: int, *methods: str) -> Found | None:
    """What `benchmarks.design_job` finds; none, with a note, if a design is refused."""
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.design_job", str(states), str(rounds), *methods],
        cwd=Path(__file__).parents[1],
        check=True,
        capture_output=True,
        text=True,
    )
    found: Found = json.loads(done.stdout)
    if "refused" in found:
        section.notes.append(f"n = {states} is not measured: {found['refused']}")
        return None
    return found


def _solvers(section: Section, states: int, rounds: int) -> dict[str, Any] | None:
    """Clarabel against SCS; what Clarabel's method took."""
    found = _job(section, states, rounds, "Clarabel", "SCS")
    if found is None:
        return None
    one, other = found["Clarabel"], found["SCS"]
    label, times = f"n = {states}", one["times"]
    section.rows += [
        Row(f"{label}: by Clarabel", times["design"], "by SCS", other["times"]["design"]),
        *(
            Row(f"{label}: of it {part}", times[name], "whole", times["design"], cost=True)
            for name, part in (
                ("compilation", "cvxpy's compilation"),
                ("polishing", "Newton's method"),
                ("certificate", "the certificate"),
            )
        ),
    ]
    _compare(section, f"{label}, Clarabel and SCS", one, other)
    return one


def _unsplit(section: Section, states: int, rounds: int, split: dict[str, Any]) -> None:
    found = _job(section, states, rounds, "unsplit")
    if found is None:
        return
    whole = found["unsplit"]
    section.rows.append(
        Row(
            f"n = {states}: an iteration of Clarabel",
            split["iteration"],
            "cones unsplit",
            whole["iteration"],
        )
    )
    _compare(section, f"n = {states}, cones split and unsplit", split, whole)


def _compare(section: Section, what: str, one: dict[str, Any], other: dict[str, Any]) -> None:
    """Both minimise the same, and the minimum is unique."""
    ours, theirs = one["design"], other["design"]
    objective = abs(ours["objective"] / theirs["objective"] - 1.0)
    gains = [np.array([design["L"], design["Ld"]]) for design in (ours, theirs)]
    difference = float(np.max(np.abs(gains[0] - gains[1])) / np.max(np.abs(gains[1])))
    section.checks += [
        Check(f"{what}, objective", objective, _AGREE),
        Check(f"{what}, gains", difference, _AGREE),
    ]


def _growth(found: dict[int, dict[str, Any]]) -> list[str]:
    """Why (19) grows, from the two largest plants."""
    small, large = sorted(found)[-2:]
    systems = {states: plant(states) for states in (small, large)}
    sizes = {states: system.size for states, system in systems.items()}
    N, p = sizes[large], systems[large].outputs
    cone = 2 * N
    entries = cone * (cone + 1) // 2
    unknowns = N * (N + 1) // 2 + 2 * N * N + 2 * p * N
    rows = 3 * N + systems[large].Bo.shape[1]
    step = log(sizes[large] / sizes[small])
    spent = {states: float(found[states]["iteration"]) for states in (small, large)}

    def slope(less: float, more: float) -> float:
        return log(more / less) / step

    steepness = slope(spent[small], spent[large])
    factors = slope(found[small]["factor"], found[large]["factor"])
    notes = [
        f"n = {large}: N = {N}, and (19) has {unknowns:,} unknowns, about 2.5 N^2, in a cone of "
        f"{rows} rows, about 3 N; its blocks touch each other along a path, so Clarabel splits it "
        f"into cones of which the largest has {cone} rows, 2 N",
        f"it couples all {entries:,} entries of that cone with each other: {entries**2 // 2:,} "
        f"numbers, 2 N^4, to be factored in 2.7 N^6 operations in each iteration; with those of "
        f"the unknowns its factor has {found[large]['factor']:,} numbers",
        f"measured from N = {sizes[small]} to {N}: an iteration takes at best "
        f"{seconds(spent[small])} to {seconds(spent[large])}, as N^{steepness:.1f}, and the "
        f"factor grows as N^{factors:.1f}; 6 and 4 are the slopes of the largest cone alone",
    ]
    beyond = plant(100).size / N
    guess = (
        f"n = 100: {seconds(spent[large] * beyond**steepness)} an iteration by that slope, "
        f"{seconds(spent[large] * beyond**6)} by N^6"
    )
    if "memory" in found[large]:
        memory = [found[states]["memory"] for states in (small, large)]
        notes[-1] += (
            f"; memory {memory[0] / 1e6:.0f} to {memory[1] / 1e6:.0f} MB, as N^{slope(*memory):.1f}"
        )
        guess += f", and {memory[1] * beyond**factors / 1e9:.0f} GB as the factor grows: guesses"
    threads = found[large]["threads"]
    return [*notes, f"{guess}; Clarabel uses {threads} thread{'s' if threads > 1 else ''}, SCS one"]
