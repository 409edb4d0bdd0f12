"""Stage theory: what the paper says of its filters and equations, and no figure shows.

Whether the SVSF's full correction is stable; what a wrong model does to a filter alone and to a
bank; whether any gain is better than Kalman's; what (8) and (15) give as they are printed.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.errors import DivergenceError, InputError, located
from reobserve.grid import multiple
from reobserve.linear_model import LinearModel
from reobserve.matrices import as_positive
from reobserve.metrics import Metric
from reobserve.papers.imm.setup import MODES, UNITS, bank, measured_columns, modes, run
from reobserve.plants.hydraulic_actuator import MOTION, ORDER, REALISATIONS, simulate
from reobserve.random_streams import random_stream
from reobserve.signals import Signal

Array = NDArray[np.float64]


def measure(settings: dict[str, Any], designs: dict[str, Any]) -> list[Metric]:
    """The numbers of the paper's theory; see ``results/README.md`` for their names.

    Raises
    ------
    InputError
        If a value of the ledger cannot be used.
    DivergenceError
        If a filter leaves the range of floating-point numbers.
    """
    chosen = _check(settings)
    return [
        *_corrections(settings),
        *_mismatches(settings, chosen),
        *_gains(settings, chosen),
        *_printed(settings, chosen),
    ]


def _check(settings: dict[str, Any]) -> dict[str, Any]:
    """The settings of the banks that the theory names; `InputError` for a rule that is none."""
    rules, known = settings["theory"], settings["observers"]
    names = rules["observers"]
    if not isinstance(names, list) or not names or not set(names) <= set(known):
        raise InputError("observers", f"{names!r} must be a list of some of {', '.join(known)}")
    if not isinstance(rules["gains"], int) or rules["gains"] < 1:
        raise InputError("gains", f"{rules['gains']!r} must be a whole number, 1 or more")
    as_positive("spread", rules["spread"])
    as_positive("period", rules["period"])
    return {name: known[name] for name in names}


def corrected_radius(A: Array, H: Array) -> float:
    """Spectral radius of (I - H^+ H) A: outside the layers errors move so, but for gamma.

    Where every output is corrected in full, (15) with the pseudo-inverse, what is left of the
    error is what no output sees. Above one it grows, however the layers are chosen.
    """
    left = (np.eye(len(A)) - np.linalg.pinv(H) @ H) @ A
    return float(np.abs(np.linalg.eigvals(left)).max())


def _corrections(settings: dict[str, Any]) -> Iterator[Metric]:
    """The largest radius of all modes, for each choice of outputs; no unit of states matters."""
    period = settings["theory"]["period"]
    for realisation in REALISATIONS:
        radius = 0.0
        for mode in modes(settings["plant"]):
            one = mode.sampled(realisation, period, 1.0 / period)
            radius = max(radius, corrected_radius(one.A, one.H))
        yield Metric("svsf_law", f"corrected_radius_{realisation}", radius, "1")


def _mismatches(settings: dict[str, Any], chosen: dict[str, Any]) -> Iterator[Metric]:
    """Errors of the velocity after a leak: of the normal model's filter alone, and of the bank.

    Root mean square over the time from the leak on, without noise.
    """
    rules, known = settings["theory"], modes(settings["plant"])
    period = rules["period"]
    steps = multiple("horizon", as_positive("horizon", rules["horizon"]), period, "theory.period")
    begin = multiple("onset", as_positive("onset", rules["onset"]), period, "theory.period")
    if begin >= steps:
        raise InputError("onset", f"{rules['onset']:g} s must be before the end of the horizon")
    signal = Signal.parse("input", rules["input"], 1)
    signal.check_grid("input", period, rules["horizon"])
    control = signal(np.arange(steps) * period)[:, 0]
    leaks = (np.arange(steps) >= begin).astype(np.int64)
    healthy, leaky = known[0], known[MODES.index("leakage")]
    motion = simulate([healthy, leaky], leaks, control, period)[1:]
    for name, body in chosen.items():
        columns = measured_columns(body)
        names = REALISATIONS[body["realisation"]]
        alone = {**body, "stay": 1.0}  # a bank of one
        for what, told, models in (("single", alone, [healthy]), ("bank", body, known)):
            with located(f"observers.{name}"):
                filters = bank(settings["plant"], told, period, models)
                found = run(filters, body, motion[:, columns], control)
            if found.diverged_at is not None:
                raise DivergenceError(name, found.diverged_at * period)
            row = filters.filters[0].model.H[names.index("velocity")]
            error = found.estimate @ row - motion[:, MOTION.index("velocity")]
            size = float(np.sqrt(np.mean(error[begin:] ** 2)))
            yield Metric(name, f"{what}_velocity_error", size, UNITS["velocity"])


def steady_gain(model: LinearModel) -> Array:
    """Kalman's gain at rest: P H^T (H P H^T + R)^-1 with P of the Riccati equation."""
    from scipy.linalg import solve_discrete_are

    A, _, H, _, Q, R = model.arrays
    P = solve_discrete_are(A.T, H.T, Q, R)
    gain: Array = np.linalg.solve(H @ P @ H.T + R, H @ P).T
    return gain


def error_variance(model: LinearModel, gain: Array) -> float:
    """Trace of the covariance at rest of the a posteriori error under a fixed gain.

    Infinite if the error does not come to rest; the fixed point of (12) and (17).
    """
    from scipy.linalg import solve_discrete_lyapunov

    A, _, H, _, Q, R = model.arrays
    left = np.eye(len(A)) - gain @ H
    moves = left @ A
    if np.abs(np.linalg.eigvals(moves)).max() >= 1.0:
        return float("inf")
    return float(np.trace(solve_discrete_lyapunov(moves, left @ Q @ left.T + gain @ R @ gain.T)))


def _gains(settings: dict[str, Any], chosen: dict[str, Any]) -> Iterator[Metric]:
    """How much larger the variance is at least with gains near Kalman's, of all modes."""
    rules = settings["theory"]
    stream = random_stream(0, "imm", "theory", "gains")
    for name, body in chosen.items():
        if body["algorithm"] != "kalman":
            continue
        with located(f"observers.{name}"):
            filters = bank(settings["plant"], body, rules["period"]).filters
        least = np.inf
        for one in filters:
            model: LinearModel = one.model
            gain = steady_gain(model)
            best = error_variance(model, gain)
            for _ in range(rules["gains"]):
                moved = gain * (1.0 + rules["spread"] * stream.standard_normal(gain.shape))
                least = min(least, error_variance(model, moved) / best)
        yield Metric(name, "least_variance_rise", float(least) - 1.0, "1")


def printed_weights(transition: Array, probabilities: Array) -> Array:
    """Mixing weights (7) over the sums of (8) as it is printed, which end at j."""
    reached = np.triu(transition) * probabilities[:, None]
    weights: Array = transition * probabilities[:, None] / reached.sum(axis=0)
    return weights


def _printed(settings: dict[str, Any], chosen: dict[str, Any]) -> Iterator[Metric]:
    """What (8) and (15) give by the letter."""
    period = settings["theory"]["period"]
    equal = np.full(len(MODES), 1.0 / len(MODES))
    largest = 0.0
    for name, body in chosen.items():
        with located(f"observers.{name}"):
            filters = bank(settings["plant"], body, period)
        weights = printed_weights(np.asarray(filters.transition, dtype=np.float64), equal)
        largest = max(largest, float(np.abs(weights.sum(axis=0) - 1.0).max()))
    yield Metric("equation_8", "largest_weight_excess", largest, "1")
    widths = [len(body["boundary_layer"]) for body in chosen.values() if "boundary_layer" in body]
    if widths:
        yield Metric("equation_15", "states_without_gain", float(ORDER - max(widths)), "1")
