"""Stage theory: claims on filters and equations that no figure shows.

They test whether the full correction of the SVSF is stable, how a wrong model affects a single
filter and a bank, whether the SVSF's output errors come to lie within its layers, and how near its
states are to the truth with layers as wide as the error of its model.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import DivergenceError, InputError, located, nearest
from reobserve.core.matrices import spectral_radius
from reobserve.observers.gaussian_filter import GaussianFilter
from reobserve.observers.imm import IMM, ImmState
from reobserve.observers.run import Run
from reobserve.systems.linear import LinearModel
from reobserve_papers.metrics.metrics import Metric
from reobserve_papers.metrics.responses import root_mean_square
from reobserve_papers.metrics.theory_parts import part
from reobserve_papers.papers.imm import keys
from reobserve_papers.papers.imm.keys import MODES
from reobserve_papers.papers.imm.null import MEASUREMENT, RANDOM_GAIN, RandomGainFilter
from reobserve_papers.papers.imm.plant import modes
from reobserve_papers.papers.imm.setup import STATE_FREQUENCY, bank, measured_columns, run
from reobserve_papers.papers.imm.units import UNITS
from reobserve_papers.plants.hydraulic_actuator import MOTION, REALISATIONS, ActuatorModel, simulate
from reobserve_papers.signals.grid import multiple
from reobserve_papers.signals.inputs import Signal
from reobserve_papers.signals.random_streams import random_stream

Array = NDArray[np.float64]

LEAST_LAYER = 1e-12  # where the models agree
ROUNDING = 1e-9  # of the size of a state: a smaller difference of two motions is not a number
STATES = MOTION[1:]  # which all realisations estimate
MOST_UPDATES = 10_000  # of a covariance, until it comes to rest
Observers = dict[str, keys.Observer]


def measure(job: keys.Job, designs: dict[str, Any]) -> list[Metric]:
    """The numbers of the paper's theory (see `MEANINGS` of `metrics`)."""
    chosen = check(job.theory, job.observers)
    return [
        *_corrections(job, chosen),
        *_mismatches(job, chosen),
        *_layers(job, chosen),
        *_informed(job, chosen),
    ]


def check(theory: keys.Theory, observers: Mapping[str, keys.Observer]) -> Observers:
    """The banks that the theory names, or `InputError` for unknown names or invalid times."""
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


def corrected_radius(model: LinearModel, inverse: str) -> float:
    """Spectral radius of (I - W C) A, which moves errors outside the layers, apart from gamma.

    Full correction of every output, by the right inverse W of C, leaves the part of the error that
    no output shows. Above one this part grows, however the layers are chosen. W is the
    pseudo-inverse, or the inverse weighted by the steady-state covariance of full correction.
    """
    A, _, C, _, Q, R = model.arrays
    W = np.linalg.pinv(C)
    if inverse == "weighted":
        P = Q
        for _ in range(MOST_UPDATES):
            # P = A P A' + Q, W = P C' (C P C')^-1, P = (I - W C) P (I - W C)' + W R W'
            P, before = A @ P @ A.T + Q, W
            W = np.linalg.solve(C @ P @ C.T, C @ P).T
            left = np.eye(len(A)) - W @ C
            P = left @ P @ left.T + W @ R @ W.T
            if np.abs(W - before).max() <= 1e-12 * np.abs(W).max():
                break
    return spectral_radius((np.eye(len(A)) - W @ C) @ A)


@part
def _corrections(job: keys.Job, chosen: Observers) -> Iterator[Metric]:
    """The largest radius of all modes, for the first SVSF: layers do not matter."""
    name, body = next(_smooth(chosen))
    filters = cast("list[GaussianFilter]", bank(job.plant, body, job.theory.period).filters)
    radius = max(corrected_radius(member.model, body.inverse) for member in filters)
    yield Metric(name, "corrected_radius", radius, "1")


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


def _leak(job: keys.Job) -> _Leak:
    rules, known = job.theory, modes(job.plant)
    steps, begin, signal = _grid(rules)
    control = signal(np.arange(steps, dtype=np.float64) * rules.period)[:, 0]
    leaks = (np.arange(steps) >= begin).astype(np.int64)
    two = [known[0], known[MODES.index("leakage")]]
    motion, healthy = (
        simulate(two, mode, control, rules.period, rules.switching_condition)[1:]
        for mode in (leaks, np.zeros_like(leaks))
    )
    return _Leak(known, motion, healthy, control, begin)


def _filtered(
    job: keys.Job,
    name: str,
    body: keys.Observer,
    leak: _Leak,
    models: list[ActuatorModel],
    noise: Array | float = 0.0,
    kind: type[RandomGainFilter] | None = None,
) -> tuple[Run[ImmState], IMM]:
    """Estimates of a bank on the leaking actuator, and the bank: of filters of a kind, if given."""
    with located(f"observers.{name}"):
        filters = bank(job.plant, body, job.theory.period, models)
        if kind is not None:
            others = tuple(kind(cast("GaussianFilter", member).model) for member in filters.filters)
            filters = replace(filters, filters=others)
        measured = leak.motion[:, measured_columns(body)] + noise
        result = run(filters, body, measured, leak.control)
    if result.diverged_at is not None:
        raise DivergenceError(name, result.diverged_at)
    return result, filters


@part
def _mismatches(job: keys.Job, chosen: Observers) -> Iterator[Metric]:
    """A priori errors of the velocity after a leak: of the normal model's filter, and of the bank.

    A posteriori the error of a measured velocity without noise may be nothing but rounding.
    """
    leak = _leak(job)
    for name, body in chosen.items():
        alone = replace(body, self_transition=1.0)  # a bank of one
        for what, observer, models in (
            ("single", alone, leak.models[:1]), ("bank", body, leak.models),
        ):  # fmt: skip
            result, filters = _filtered(job, name, observer, leak, models)
            size = _prediction_error(observer, leak, result, filters)
            yield Metric(name, f"{what}_prediction_error", size, UNITS["velocity"])


def _prediction_error(
    body: keys.Observer, leak: _Leak, result: Run[ImmState], filters: IMM
) -> float:
    """Root mean square from the leak on of the velocity's prediction, combined as in (22)."""
    # e(k|k-1) = sum_j c_j e_j(k|k-1), c_j = sum_i p_ij mu_i(k-1)
    weights = result["probability"][leak.begin - 1 : -1] @ filters.transition
    errors = result["innovation"][leak.begin :, :, REALISATIONS[body.realisation].index("velocity")]
    return float(root_mean_square(np.sum(weights * errors, axis=1)))


@part
def _layers(job: keys.Job, chosen: Observers) -> Iterator[Metric]:
    """The first SVSF with layers narrower than the error of its model.

    The filter of the normal model runs alone on the leaking actuator, whose outputs differ from
    those of the model by up to b. Without correction the model leaves layers of a share of b.
    ``layer_ratio`` is the maximum a priori output error in the second half of the leak, divided by
    such a layer; the existence subspace is where it is one or less. A posteriori it is about a
    quarter by construction.
    """
    leak = _leak(job)
    late = (leak.begin + len(leak.motion)) // 2
    name, body = next(_smooth(chosen))
    bound = _model_error(leak, body)
    layer = job.theory.layer_share * bound
    result, _ = _filtered(job, name, _alone(body, layer), leak, leak.models[:1])
    ratio = np.abs(result["innovation"][late:, 0]) / layer
    differ = bound > LEAST_LAYER  # the model alone leaves no other layers
    yield Metric(name, "layer_ratio", float(ratio[:, differ].max(initial=0.0)), "1")


def _model_error(leak: _Leak, body: keys.Observer) -> Array:
    """The maximum difference of each measured output of the leaking and the normal actuator."""
    differences = np.abs(leak.motion - leak.healthy)[leak.begin :]
    bound: Array = np.maximum(differences.max(axis=0), LEAST_LAYER)[measured_columns(body)]
    return bound


def _alone(body: keys.SmoothVariableStructure, layer: Array) -> keys.SmoothVariableStructure:
    """A bank of one, with these layers."""
    return replace(
        body, self_transition=1.0, boundary_layer=layer.tolist(), layer_scale=1.0, layer_factor=1.0
    )


@part
def _informed(job: keys.Job, chosen: Observers) -> Iterator[Metric]:
    """Errors of states of the first SVSF of the normal model, alone on the leaking actuator.

    Its layers are as wide as the error of the model, an upper bound on the unmodelled dynamics:
    the difference of the outputs or, with ``layers=step``, the error of a prediction from exact
    outputs. The record has no noise or, with ``record=noisy``, that of R. The errors are compared
    with those of the model without correction, of a filter with random gains, and of the measured
    velocity.
    """
    leak = _leak(job)
    name, body = next(_smooth(chosen))
    sizes = np.abs(leak.motion[:, 1:]).max(axis=0)
    errors = np.array(_errors(leak, leak.healthy[:, 1:]))
    errors[errors <= ROUNDING * sizes] = np.nan  # where both models rest
    for state, error in zip(STATES, errors.tolist(), strict=True):
        yield Metric("model", f"open_{state}_error", error, UNITS[state])
    alone, normal = _alone(body, _model_error(leak, body)), leak.models[:1]
    rows, feedthrough = state_outputs(normal[0], body.realisation, job.theory.period)

    def metrics(
        who: str, noise: Array | float = 0.0, layer: Array | None = None, **at: str
    ) -> Iterator[Metric]:
        kind = RandomGainFilter if who == RANDOM_GAIN else None
        chosen = alone if layer is None else _alone(body, layer)
        result, _ = _filtered(job, name, chosen, leak, normal, noise, kind)
        estimate = result["state"] @ rows.T + np.outer(leak.control, feedthrough)
        for state, error in zip(STATES, _errors(leak, estimate), strict=True):
            yield Metric.at(who, (f"informed_{state}_error", error, UNITS[state]), **at)

    R = bank(job.plant, alone, job.theory.period, normal).filters[0].model.R
    stream = random_stream(0, "imm", "theory")
    noise = stream.standard_normal((len(leak.motion), len(R))) @ np.linalg.cholesky(R).T
    # psi near zero and gamma = 0 correct every output in full.
    full = replace(
        _alone(body, np.full(len(R), LEAST_LAYER)), convergence_rate=0.0, inverse="pseudo"
    )
    result, _ = _filtered(job, name, full, leak, normal)
    step = np.abs(result["innovation"][leak.begin :, 0]).max(axis=0)
    for who in (name, RANDOM_GAIN):
        yield from metrics(who)
        yield from metrics(who, noise, record="noisy")
        yield from metrics(who, layer=np.maximum(step, LEAST_LAYER), layers="step")
    velocity = REALISATIONS[body.realisation].index("velocity")
    size = float(root_mean_square(noise[leak.begin :, velocity]))
    yield Metric.at(
        MEASUREMENT, ("informed_velocity_error", size, UNITS["velocity"]), record="noisy"
    )


def _errors(leak: _Leak, states: Array) -> list[float]:
    """Root mean squares from the leak on of the errors of `STATES`, (k, 3)."""
    errors = (states - leak.motion[:, 1:])[leak.begin :]
    return [float(root_mean_square(column)) for column in errors.T]


def state_outputs(model: ActuatorModel, realisation: str, period: float) -> tuple[Array, Array]:
    """C, (3, n), and D, (3,), from a realisation's states to `STATES`."""
    shared = model.sampled("derivatives", period, STATE_FREQUENCY)
    if realisation == "motion":
        return np.pad(shared.C, ((0, 0), (1, 0))), shared.D[:, 0]
    if realisation != "observer_canonical":
        return shared.C, shared.D[:, 0]
    own = model.sampled(realisation, period, STATE_FREQUENCY)
    # Both have the same velocity: C A^k x = C' A'^k x', k = 0 to 3
    there, here = (
        np.vstack([form.C[:1] @ np.linalg.matrix_power(form.A, k) for k in range(len(form.A))])
        for form in (shared, own)
    )
    return shared.C @ np.linalg.solve(there, here), shared.D[:, 0]
