"""Search: the unstated noise and transition with which three banks come nearest to the paper.

Differential evolution (Storn & Price 1997) over the logarithms of the numbers of
`study_rows.TUNED`. It is seeded: the same settings find the same numbers, on one core or two.

The distance of a choice is the largest over itself and a few neighbours, which lie in the same
directions for all choices. The banks have more than one steady state. Where one of them ends, the
quoted values can be met to the last digit, but by numbers that must not move by a hundredth.

With ``switching`` a choice in which the thin layers do not switch, or the nominal ones do, counts
as farther away than any that meets this condition: see `calibration.switches`.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve_papers.papers.imm import keys
from reobserve_papers.papers.imm.calibration import Calibration, switches
from reobserve_papers.papers.imm.study_rows import OUTPUTS, STATES, TUNED
from reobserve_papers.signals.random_streams import random_stream
from reobserve_papers.signals.series import Series

Array = NDArray[np.float64]

WORST = 10.0  # the distance of a bank that diverges: worse than any other
STILL = 1.0  # added where the wrong layers switch: no distance between probabilities is larger
DIGITS = 3  # to which the numbers found are rounded
THREADS = 2


def run(job: keys.Job, plant: Series, progress: Callable[[str], None]) -> dict[str, Any]:
    """Run the search: the numbers found, the remaining distance, and its history.

    ``progress`` is called with a line whenever a generation is over.
    """
    body = job.search
    calibration = Calibration(job.plant, job.observers, job.metrics, plant)
    calibration.tuned_numbers()
    low, high = bounds(body)
    nearby = _nearby(job.seed, body.neighbour_pairs, body.spread)
    history: list[list[float]] = []

    def distance(logarithms: Array) -> float:
        worst = 0.0
        for step in nearby:
            trial = calibration.try_out(10.0**logarithms * step)
            loss = trial.distance if np.isfinite(trial.distance) else WORST
            if body.switching is not None and not switches(trial, job.observers, body.switching):
                loss += STILL
            worst = max(worst, loss)
        return worst

    def report(intermediate_result: Any) -> None:
        count, best = int(intermediate_result.nfev), float(intermediate_result.fun)
        history.append([count, round(best, 6)])
        progress(f"{count} trials, best distance {best:.4f}")

    from scipy.optimize import differential_evolution

    with ThreadPoolExecutor(THREADS) as pool:
        result = differential_evolution(
            distance,
            list(zip(low, high, strict=True)),
            popsize=body.population,
            maxiter=body.generations,
            mutation=(0.4, 0.9),
            recombination=0.8,
            seed=np.random.Generator(np.random.PCG64(job.seed)),
            init="sobol",
            updating="deferred",
            workers=pool.map,
            polish=False,
            tol=0.0,
            callback=report,
        )
    rounded = [float(f"{10.0**value:.{DIGITS}g}") for value in result.x]
    trial = calibration.try_out(np.array(rounded))
    targets = sum(3 if observer.quoted_high else 2 for observer in job.observers.values())
    return {
        "found": dict(zip(TUNED, rounded, strict=True)),
        "distance": trial.distance,
        "worst_nearby": distance(np.log10(rounded)),
        "means": {name: list(means) for name, means in trial.means.items()},
        "outside": dict(trial.outside),
        "trials": int(result.nfev),
        "tuned": len(TUNED),
        "targets": targets,
        "history": history,
    }


def _nearby(seed: int, pairs: int, spread: float) -> Array:
    """Factors to the tuned numbers, shape (1 + 2 pairs, q): one, and pairs of opposite steps."""
    stream = random_stream(seed, "imm", "search", "neighbours")
    # Corners of the cube, so that all numbers move by the same factor.
    steps = np.log1p(spread) * (2.0 * stream.integers(0, 2, (pairs, len(TUNED))) - 1.0)
    factors: Array = np.exp(np.vstack([np.zeros((1, len(TUNED))), steps, -steps]))
    return factors


def bounds(body: keys.Search) -> tuple[Array, Array]:
    """Logarithms of the lower and upper bounds of the numbers of `TUNED`."""
    limits = []
    for (low, high), places in (
        (body.process_noise, STATES),
        (body.position_noise, 1),
        (body.velocity_noise, 1),
        (body.acceleration_noise, OUTPUTS - 2),
        (body.leave, 1),
    ):
        limits += [(np.log10(low), np.log10(high))] * places
    low_high: Array = np.array(limits)
    return low_high[:, 0], low_high[:, 1]


def check(body: keys.Search) -> None:
    """Refuse a probability to leave a mode that may reach one."""
    maximum = body.leave[1] * (1 + body.spread)
    if maximum >= 1:
        raise InputError("leave", f"is up to {maximum:g} with the spread, must stay below 1")
