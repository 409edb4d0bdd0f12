"""Search: the unstated noise and transition with which three banks come nearest to the paper.

Differential evolution (Storn & Price 1997) over the logarithms of the numbers of `tuning.TUNED`,
seeded, so that the same settings find the same numbers, on one core or two.

A choice is judged by the worst of itself and a few neighbours, the same for all choices: the banks
have more than one state of rest, and where one of them ends the quoted values can be had to the
last digit, by numbers that must not move by a hundredth.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.errors import InputError, located
from reobserve.matrices import as_scalar, as_vector
from reobserve.papers.imm.tuning import OUTPUTS, STATES, TUNED, Calibration
from reobserve.random_streams import random_stream
from reobserve.series import Series

Array = NDArray[np.float64]

WORST = 10.0  # the distance of a bank that diverges: worse than any other
DIGITS = 3  # to which the numbers found are rounded
THREADS = 2


def run(settings: dict[str, Any], plant: Series, progress: Callable[[str], None]) -> dict[str, Any]:
    """The numbers found, the distance that is left, and how it came to that.

    ``progress`` is called with a line whenever a generation is over.

    Raises
    ------
    InputError
        If a bound cannot be used.
    """
    body = settings["search"]
    calibration = Calibration(settings["plant"], settings["observers"], settings["metrics"], plant)
    calibration.stated()
    with located("search"):
        low, high = bounds(body)
    nearby = _nearby(settings["seed"], int(body["neighbour_pairs"]), float(body["spread"]))
    history: list[list[float]] = []

    def distance(logarithms: Array) -> float:
        worst = 0.0
        for step in nearby:
            found = calibration.try_out(10.0**logarithms * step).distance
            worst = max(worst, found if np.isfinite(found) else WORST)
        return worst

    def told(intermediate_result: Any) -> None:
        count, best = int(intermediate_result.nfev), float(intermediate_result.fun)
        history.append([count, round(best, 6)])
        progress(f"{count} trials, best distance {best:.4f}")

    from scipy.optimize import differential_evolution

    with ThreadPoolExecutor(THREADS) as pool:
        result = differential_evolution(
            distance,
            list(zip(low, high, strict=True)),
            popsize=int(body["population"]),
            maxiter=int(body["generations"]),
            mutation=(0.4, 0.9),
            recombination=0.8,
            seed=np.random.Generator(np.random.PCG64(settings["seed"])),
            init="sobol",
            updating="deferred",
            workers=pool.map,
            polish=False,
            tol=0.0,
            callback=told,
        )
    rounded = [float(f"{10.0**value:.{DIGITS}g}") for value in result.x]
    trial = calibration.try_out(np.array(rounded))
    targets = sum(3 if one["quoted_high"] else 2 for one in settings["observers"].values())
    return {
        "found": dict(zip(TUNED, rounded, strict=True)),
        "distance": trial.distance,
        "worst_nearby": distance(np.log10(rounded)),
        "means": {name: list(means) for name, means in trial.means.items()},
        "trials": int(result.nfev),
        "tuned": len(TUNED),
        "targets": targets,
        "history": history,
    }


def _nearby(seed: int, pairs: int, spread: float) -> Array:
    """One, and pairs of opposite steps: factors to the tuned numbers, shape (1 + 2 pairs, q)."""
    stream = random_stream(seed, "imm", "search", "neighbours")
    # Corners of the cube and not points inside: all numbers move by as much.
    steps = np.log1p(spread) * (2.0 * stream.integers(0, 2, (pairs, len(TUNED))) - 1.0)
    found: Array = np.exp(np.vstack([np.zeros((1, len(TUNED))), steps, -steps]))
    return found


def bounds(body: dict[str, Any]) -> tuple[Array, Array]:
    """The logarithms of the least and the greatest of the numbers of `TUNED`.

    Raises
    ------
    InputError
        If a pair is not positive and rising.
    """
    found = []
    for name, places in (
        ("process_noise", STATES),
        ("position_noise", 1),
        ("velocity_noise", 1),
        ("acceleration_noise", OUTPUTS - 2),
        ("leave", 1),
    ):
        low, high = as_vector(name, body[name], 2)
        if not 0 < low < high:
            raise InputError(name, f"[{low:g}, {high:g}] must be above 0 and rise")
        found += [(np.log10(low), np.log10(high))] * places
    low_high = np.array(found)
    return low_high[:, 0], low_high[:, 1]


def check(body: dict[str, Any]) -> None:
    """Refuse a search that cannot be run."""
    for name in ("population", "generations"):
        if not isinstance(body[name], int) or body[name] < 1:
            raise InputError(name, f"{body[name]!r} must be a whole number, 1 or more")
    pairs, spread = body["neighbour_pairs"], as_scalar("spread", body["spread"])
    if not isinstance(pairs, int) or pairs < 0:
        raise InputError("neighbour_pairs", f"{pairs!r} must be a whole number, 0 or more")
    if not 0 <= spread < 1:
        raise InputError("spread", f"{spread:g} must be from 0 to below 1")
    most = 10.0 ** float(bounds(body)[1][-1]) * (1 + spread)
    if most >= 1:
        raise InputError("leave", f"is up to {most:g} with the spread, must stay below 1")
