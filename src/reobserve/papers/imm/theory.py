"""Stage theory: what the paper says of its filters and equations, and no figure shows.

Whether the SVSF's full correction is stable; what a wrong model does to a filter alone and to a
bank; whether any gain is better than Kalman's; what (8) and (15) give as they are printed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.errors import DivergenceError, InputError, located, nearest
from reobserve.ledger.types import Job, Settings, read_job
from reobserve.models.linear import LinearModel
from reobserve.numerics.random_streams import random_stream
from reobserve.papers.imm import keys
from reobserve.papers.imm.setup import MODES, UNITS, bank, measured_columns, modes, run
from reobserve.plants.hydraulic_actuator import MOTION, ORDER, REALISATIONS, simulate
from reobserve.scoring.metrics import Metric
from reobserve.scoring.parts import part
from reobserve.synthesis.linear import steady_kalman_gain
from reobserve.timeseries.grid import multiple
from reobserve.timeseries.signals import Signal

Array = NDArray[np.float64]
Observers = dict[str, keys.Observer]


def measure(settings: Settings, designs: dict[str, Any]) -> list[Metric]:
    """The numbers of the paper's theory; see `MEANINGS` of `metrics`.

    Raises
    ------
    InputError
        If a value of the ledger cannot be used.
    DivergenceError
        If a filter leaves the range of floating-point numbers.
    """
    job = read_job(keys.Ledger, settings)
    chosen = check(job.theory, job.observers)
    return [
        *_corrections(job),
        *_mismatches(job, chosen),
        *_gains(job, chosen),
        *_printed(job, chosen),
    ]


def check(theory: keys.Theory, observers: Mapping[str, keys.Observer]) -> Observers:
    """The banks that the theory names; `InputError` for one that there is not, or for its times."""
    for name in theory.observers:
        if name not in observers:
            raise InputError("observers", f"there is no {name!r}{nearest(name, observers)}")
    _grid(theory)
    return {name: observers[name] for name in theory.observers}


def _grid(theory: keys.Theory) -> tuple[int, int, Signal]:
    """The steps of the run, those before the leak, and the input."""
    period = theory.period
    steps = multiple("horizon", theory.horizon, period, "theory.period")
    begin = multiple("onset", theory.onset, period, "theory.period")
    if begin >= steps:
        raise InputError("onset", f"{theory.onset:g} s must be before the end of the horizon")
    signal = Signal.parse("input", theory.input, 1)
    signal.check_grid("input", period, theory.horizon)
    return steps, begin, signal


def corrected_radius(A: Array, H: Array) -> float:
    """Spectral radius of (I - H^+ H) A: outside the layers errors move so, but for gamma.

    Where every output is corrected in full, (15) with the pseudo-inverse, what is left of the
    error is what no output sees. Above one it grows, however the layers are chosen.
    """
    left = (np.eye(len(A)) - np.linalg.pinv(H) @ H) @ A
    return float(np.abs(np.linalg.eigvals(left)).max())


@part
def _corrections(job: Job) -> Iterator[Metric]:
    """The largest radius of all modes, for each choice of outputs; no unit of states matters."""
    period = job.theory.period
    for realisation in REALISATIONS:
        radius = 0.0
        for mode in modes(job.plant):
            one = mode.sampled(realisation, period, 1.0 / period)
            radius = max(radius, corrected_radius(one.A, one.H))
        yield Metric("svsf_law", f"corrected_radius_{realisation}", radius, "1")


@part
def _mismatches(job: Job, chosen: Observers) -> Iterator[Metric]:
    """Errors of the velocity after a leak: of the normal model's filter alone, and of the bank.

    Root mean square over the time from the leak on, without noise.
    """
    rules, known = job.theory, modes(job.plant)
    period = rules.period
    steps, begin, signal = _grid(rules)
    control = signal(np.arange(steps) * period)[:, 0]
    leaks = (np.arange(steps) >= begin).astype(np.int64)
    healthy, leaky = known[0], known[MODES.index("leakage")]
    motion = simulate([healthy, leaky], leaks, control, period)[1:]
    for name, body in chosen.items():
        columns = measured_columns(body)
        names = REALISATIONS[body.realisation]
        alone = replace(body, stay=1.0)  # a bank of one
        for what, told, models in (("single", alone, [healthy]), ("bank", body, known)):
            with located(f"observers.{name}"):
                filters = bank(job.plant, told, period, models)
                found = run(filters, body, motion[:, columns], control)
            if found.diverged_at is not None:
                raise DivergenceError(name, found.diverged_at)
            row = filters.filters[0].model.H[names.index("velocity")]
            error = found["state"] @ row - motion[:, MOTION.index("velocity")]
            size = float(np.sqrt(np.mean(error[begin:] ** 2)))
            yield Metric(name, f"{what}_velocity_error", size, UNITS["velocity"])


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


@part
def _gains(job: Job, chosen: Observers) -> Iterator[Metric]:
    """How much larger the variance is at least with gains near Kalman's, of all modes."""
    rules = job.theory
    stream = random_stream(0, "imm", "theory", "gains")
    for name, body in chosen.items():
        if not isinstance(body, keys.Kalman):
            continue
        with located(f"observers.{name}"):
            filters = bank(job.plant, body, rules.period).filters
        least = np.inf
        for one in filters:
            model: LinearModel = one.model
            gain = steady_kalman_gain(model)
            best = error_variance(model, gain)
            for _ in range(rules.gains):
                moved = gain * (1.0 + rules.spread * stream.standard_normal(gain.shape))
                least = min(least, error_variance(model, moved) / best)
        yield Metric(name, "least_variance_rise", float(least) - 1.0, "1")


def printed_weights(transition: Array, probabilities: Array) -> Array:
    """Mixing weights (7) over the sums of (8) as it is printed, which end at j."""
    reached = np.triu(transition) * probabilities[:, None]
    weights: Array = transition * probabilities[:, None] / reached.sum(axis=0)
    return weights


@part
def _printed(job: Job, chosen: Observers) -> Iterator[Metric]:
    """What (8) and (15) give by the letter."""
    period = job.theory.period
    equal = np.full(len(MODES), 1.0 / len(MODES))
    largest = 0.0
    for name, body in chosen.items():
        with located(f"observers.{name}"):
            filters = bank(job.plant, body, period)
        weights = printed_weights(np.asarray(filters.transition, dtype=np.float64), equal)
        largest = max(largest, float(np.abs(weights.sum(axis=0) - 1.0).max()))
    yield Metric("equation_8", "largest_weight_excess", largest, "1")
    widths = [
        len(body.boundary_layer)
        for body in chosen.values()
        if isinstance(body, keys.SmoothVariableStructure)
    ]
    if widths:
        yield Metric("equation_15", "states_without_gain", float(ORDER - max(widths)), "1")
