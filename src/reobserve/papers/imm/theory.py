"""Stage theory: what the paper says of its filters and equations, and no figure shows.

Whether the SVSF's full correction is stable; what a wrong model does to a filter alone and to a
bank; whether the SVSF comes to its layers, and what it makes of one that is as wide as the model is
wrong.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import DivergenceError, InputError, located, nearest
from reobserve.observers.imm import IMM
from reobserve.papers.imm import keys
from reobserve.papers.imm.keys import MODES
from reobserve.papers.imm.record import UNITS
from reobserve.papers.imm.setup import (
    bank,
    boundary_layer,
    measured_columns,
    modes,
    run,
    stacked_inputs,
)
from reobserve.plants.hydraulic_actuator import MOTION, REALISATIONS, ActuatorModel, simulate
from reobserve.replication.metrics.metrics import Metric
from reobserve.replication.metrics.parts import part
from reobserve.replication.metrics.responses import root_mean_square
from reobserve.replication.parameters.job import Job, Settings, read_job
from reobserve.signals.grid import multiple
from reobserve.signals.inputs import Signal

Array = NDArray[np.float64]

LEAST_LAYER = 1e-12  # where the models agree
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
        *_own_corrections(job, chosen),
        *_mismatches(job, chosen),
        *_layers(job, chosen),
        *_informed(job, chosen),
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


def corrected_radius(A: Array, C: Array) -> float:
    """Spectral radius of (I - C^+ C) A: outside the layers errors move so, but for gamma.

    Where every output is corrected in full, (15) with the pseudo-inverse, what is left of the
    error is what no output sees. Above one it grows, however the layers are chosen.
    """
    left = (np.eye(len(A)) - np.linalg.pinv(C) @ C) @ A
    return float(np.abs(np.linalg.eigvals(left)).max())


@part
def _corrections(job: Job) -> Iterator[Metric]:
    """The largest radius of all modes, for each realisation."""
    for realisation in REALISATIONS:
        radius = _largest_radius(job, realisation)
        yield Metric("svsf_law", f"corrected_radius_{realisation}", radius, "1")


@part
def _own_corrections(job: Job, chosen: Observers) -> Iterator[Metric]:
    """The same for the realisation that each SVSF has."""
    for name, body in _smooth(chosen):
        yield Metric(name, "corrected_radius", _largest_radius(job, body.realisation), "1")


def _largest_radius(job: Job, realisation: str) -> float:
    """Of all modes; no unit of states matters."""
    period = job.theory.period
    sampled = (mode.sampled(realisation, period, 1.0 / period) for mode in modes(job.plant))
    return max(corrected_radius(one.A, one.C) for one in sampled)


def _smooth(chosen: Observers) -> Iterator[tuple[str, keys.SmoothVariableStructure]]:
    for name, body in chosen.items():
        if isinstance(body, keys.SmoothVariableStructure):
            yield name, body


@dataclass(frozen=True)
class _Leak:
    """The motion after each step, (k, 4), of an actuator that begins to leak, without noise.

    ``begin`` is the first step of the leak, ``healthy`` the motion without it.
    """

    models: list[ActuatorModel]
    motion: Array
    healthy: Array
    control: Array
    begin: int


def _leak(job: Job) -> _Leak:
    rules, known = job.theory, modes(job.plant)
    steps, begin, signal = _grid(rules)
    control = signal(np.arange(steps) * rules.period)[:, 0]
    leaks = (np.arange(steps) >= begin).astype(np.int64)
    two = [known[0], known[MODES.index("leakage")]]
    motion, healthy = (
        simulate(two, mode, control, rules.period, rules.hand_over)[1:]
        for mode in (leaks, np.zeros_like(leaks))
    )
    return _Leak(known, motion, healthy, control, begin)


def _filtered(
    job: Job, name: str, body: keys.Observer, leak: _Leak, models: list[ActuatorModel]
) -> tuple[Array, IMM]:
    """States of a bank on the leaking actuator, and the bank."""
    with located(f"observers.{name}"):
        filters = bank(job.plant, body, job.theory.period, models)
        found = run(filters, body, leak.motion[:, measured_columns(body)], leak.control)
    if found.diverged_at is not None:
        raise DivergenceError(name, found.diverged_at)
    return found["state"], filters


def _velocity_error(body: keys.Observer, leak: _Leak, states: Array, filters: IMM) -> float:
    """Root mean square over the time from the leak on."""
    row = filters.filters[0].model.C[REALISATIONS[body.realisation].index("velocity")]
    error = states @ row - leak.motion[:, MOTION.index("velocity")]
    return float(np.sqrt(np.mean(error[leak.begin :] ** 2)))


@part
def _mismatches(job: Job, chosen: Observers) -> Iterator[Metric]:
    """Errors of the velocity after a leak: of the normal model's filter alone, and of the bank."""
    leak = _leak(job)
    for name, body in chosen.items():
        alone = replace(body, stay=1.0)  # a bank of one
        for what, told, models in (
            ("single", alone, leak.models[:1]), ("bank", body, leak.models),
        ):  # fmt: skip
            size = _velocity_error(told, leak, *_filtered(job, name, told, leak, models))
            yield Metric(name, f"{what}_velocity_error", size, UNITS["velocity"])


@part
def _layers(job: Job, chosen: Observers) -> Iterator[Metric]:
    """The largest a posteriori output error, over the layer, in the second half of the leak.

    Of the normal model's filter alone: the existence subspace is where it is one or less.
    """
    leak = _leak(job)
    late = (leak.begin + len(leak.motion)) // 2
    for name, body in _smooth(chosen):
        alone = replace(body, stay=1.0)
        states, filters = _filtered(job, name, alone, leak, leak.models[:1])
        model = filters.filters[0].model
        told = states @ model.C.T + stacked_inputs(leak.control) @ model.D.T
        error = leak.motion[:, measured_columns(body)] - told
        share = np.abs(error[late:]) / boundary_layer(body, error.shape[1])
        yield Metric(name, "layer_share", float(share.max()), "1")


@part
def _informed(job: Job, chosen: Observers) -> Iterator[Metric]:
    """Errors of the velocity with layers that are as wide as the model is wrong, and of the model.

    As wide as the largest difference between the outputs of the leaking and the normal actuator:
    an upper bound on the dynamics that are not modelled.
    """
    leak = _leak(job)
    apart = np.abs(leak.motion - leak.healthy)[leak.begin :]
    velocity = MOTION.index("velocity")
    yield Metric(
        "model", "open_velocity_error", float(root_mean_square(apart[:, velocity])),
        UNITS["velocity"],
    )  # fmt: skip
    for name, body in _smooth(chosen):
        bound = np.maximum(apart.max(axis=0), LEAST_LAYER)[measured_columns(body)]
        told = replace(
            body, stay=1.0, boundary_layer=bound.tolist(), layer_unit=1.0, layer_factor=1.0
        )
        size = _velocity_error(told, leak, *_filtered(job, name, told, leak, leak.models[:1]))
        yield Metric(name, "informed_velocity_error", size, UNITS["velocity"])
