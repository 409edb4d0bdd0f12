"""Banks of filters from the values of the parameter file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.core.matrices import as_vector
from reobserve.observers.gaussian_filter import GaussianFilter
from reobserve.observers.imm import IMM, ImmState
from reobserve.observers.kalman import KalmanFilter
from reobserve.observers.run import Run
from reobserve.observers.smooth_variable_structure import SmoothVariableStructureFilter
from reobserve.systems.linear import LinearModel
from reobserve_papers.papers.imm import keys
from reobserve_papers.papers.imm.plant import modes
from reobserve_papers.plants.hydraulic_actuator import (
    MOTION,
    ORDER,
    REALISATIONS,
    ActuatorModel,
    SampledActuator,
)

Array = NDArray[np.float64]

# [rad/s] States are divided by its powers. Q and P0 are given in these units. The value does not
# matter: with both converted to other units a bank gives the same probabilities.
STATE_FREQUENCY = 200.0

# Keys of the parameter file for parameters with other names in the library.
_KEYS = {
    "Q": "process_noise",
    "R": "measurement_noise",
    "covariance": "initial_covariance",
}


def bank(
    plant: keys.Plant,
    observer: keys.Observer,
    period: float,
    models: list[ActuatorModel] | None = None,
) -> IMM:
    """The bank of filters on all modes, or on ``models``, with its Markov chain."""
    known = modes(plant) if models is None else models
    with _parameter_keys():
        filters = [_filter(observer, mode, period) for mode in known]
    transition = _transition(observer.self_transition, len(known))
    return IMM(filters, transition, mixing=observer.mixing)


def _filter(observer: keys.Observer, mode: ActuatorModel, period: float) -> GaussianFilter:
    sampled = mode.sampled(observer.realisation, period, STATE_FREQUENCY)
    # A number stands for all states, or all outputs.
    noise = observer.process_noise, observer.measurement_noise
    Q = _picked(noise[0], range(ORDER + 1), range(ORDER + 1 - len(sampled.A), ORDER + 1))
    R = _picked(noise[1], MOTION, measured_columns(observer))
    model = _model(sampled, Q, R, period)
    if isinstance(observer, keys.Kalman):
        return KalmanFilter(model)
    layer = boundary_layer(observer, model.outputs)
    return SmoothVariableStructureFilter(
        model,
        boundary_layer=layer,
        convergence_rate=observer.convergence_rate,
        inverse=observer.inverse,
    )


def _model(mode: SampledActuator, Q: Any, R: Any, period: float) -> LinearModel:
    """The model of a filter, whose inputs are those of `stacked_inputs`.

    x(k+1) = A x(k) + [B 0] [u(k), u(k-1)]'
    y(k)   = C x(k) + [0 D] [u(k), u(k-1)]'
    """
    B, D = np.hstack([mode.B, np.zeros_like(mode.B)]), np.hstack([np.zeros_like(mode.D), mode.D])
    return LinearModel(mode.A, B, mode.C, D, Q=Q, R=R, sampling_period=period)


def stacked_inputs(held: Array) -> Array:
    """The input from each row on, and that held up to it, shape (k, 2).

    Measured acceleration and jerk are limits from the left, so they depend on the second. ``held``,
    shape (k,), are the inputs held up to the rows; the input after the last row is not used.
    """
    return np.stack([np.append(held[1:], held[-1:]), held], axis=1)


def _picked(variances: Any, all_of: Sequence[Any], places: Sequence[int]) -> Any:
    """The variances of a realisation, from a list of those of all states or all of the motion."""
    if isinstance(variances, list) and len(variances) == len(all_of):
        return [variances[place] for place in places]
    return variances


def boundary_layer(observer: keys.SmoothVariableStructure, outputs: int) -> Array:
    """psi of each output, from the first printed widths, or `InputError` if it cannot be used."""
    printed = as_vector("boundary_layer", observer.boundary_layer[:outputs], outputs)
    return observer.layer_factor * observer.layer_scale * printed


def saturation(
    observer: keys.SmoothVariableStructure, innovation: Array
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Innovations, (k, r, m), outside the boundary layer, and those of them that chatter.

    A gain is saturated outside the layer. It chatters where the innovation has changed its sign
    since the sample before.
    """
    saturated = np.abs(innovation) > boundary_layer(observer, innovation.shape[-1])
    before = np.concatenate([np.zeros_like(innovation[:1]), innovation[:-1]])
    return saturated, saturated & (innovation * before < 0)


def chattering_correction(
    observer: keys.Observer, innovation: Array, chattering: NDArray[np.bool_], probability: Array
) -> Array:
    """The chattering part of the correction of the combined velocity estimate, shape (k,).

    Outside the layer an innovation is corrected in full, apart from gamma.
    """
    velocity = REALISATIONS[observer.realisation].index("velocity")
    # sum_j mu_j e_j, over the filters that chatter
    moved = probability * innovation[..., velocity] * chattering[..., velocity]
    total: Array = np.sum(moved, axis=1)
    return total


def run(chosen: IMM, observer: keys.Observer, measured: Array, held: Array) -> Run[ImmState]:
    """Filter a record from rest, up to its end or to divergence.

    ``measured``, shape (k, m), are the ends of steps, ``held``, (k,), the inputs held over them.
    """
    state = start(chosen, observer, held[0])
    return chosen.run(measured, stacked_inputs(held), start=state, on_divergence="return")


def start(chosen: IMM, observer: keys.Observer, held: float = 0.0) -> ImmState:
    """The bank at rest, one step before the first row, with ``held`` the input over this step.

    By the observer's initial mode, all modes are equally probable or the normal mode is certain.
    """
    with _parameter_keys():
        rest = np.zeros(chosen.filters[0].model.states)
        certain = np.eye(len(chosen.filters))[0] if observer.initial_mode == "normal" else None
        return chosen.init(rest, observer.initial_covariance, probabilities=certain, u=[held, 0.0])


@contextmanager
def _parameter_keys() -> Iterator[None]:
    """Report parameters of the library by their keys in the parameter file."""
    try:
        yield
    except InputError as error:
        raise InputError(_KEYS.get(error.parameter, error.parameter), error.problem) from None


def measured_columns(observer: keys.Observer) -> list[int]:
    """The columns of `MOTION` that the observer's realisation measures."""
    return [MOTION.index(name) for name in REALISATIONS[observer.realisation]]


def _transition(self_transition: float, size: int) -> Array:
    """Transitions with one self-transition probability, the rest shared equally."""
    rows = np.full((size, size), (1.0 - self_transition) / max(size - 1, 1))
    np.fill_diagonal(rows, self_transition)
    return rows
