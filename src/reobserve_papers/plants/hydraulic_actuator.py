"""Electrohydrostatic actuator: identified models, and a plant that changes from one to another.

Gadsden et al. 2011, (24) to (26), give the velocity of a cylinder over the input
of its servo motor, a voltage or the speed that it stands for (the paper has both), for three modes,
as transfer functions of order 4 and relative degree 1. With the Markov parameters h1 to h4 each has
the realisation

    x1' = x2 + h1 u    x2' = x3 + h2 u    x3' = x4 + h3 u    x4' = -a4 x1 - ... - a1 x4 + h4 u

whose states mean the same in all modes but for the inputs' share in them: x1 is the velocity,
x2 + h1 u the acceleration, and so on while u is held. States are divided by powers of a frequency,
since they would differ by ten orders of magnitude otherwise, and Ad have a condition of 1e10.

The observer-canonical realisation has the same velocity and other states, whose meaning differs
from mode to mode: x_i' = x_(i+1) - a_i x1 + b_i u.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_kind
from reobserve.core.discretisation import zero_order_hold
from reobserve.core.errors import InputError, shown
from reobserve.core.kernel import allocating_kernel
from reobserve.core.matrices import as_floats, as_positive, as_scalar, as_vector

Array = NDArray[np.float64]

ORDER = 4

# What a realisation measures, by its name: rows of `SampledActuator.C`.
REALISATIONS = {
    "velocity": ("velocity",),
    "derivatives": ("velocity", "acceleration", "jerk"),
    "motion": ("position", "velocity", "acceleration"),
    "observer_canonical": ("velocity",),
}

# What goes on through a change of mode; see `simulate`.
HAND_OVERS = ("motion", "states", "outputs")

MOTION = ("position", "velocity", "acceleration", "jerk")


@dataclass(frozen=True, eq=False)
class SampledActuator:
    """A model at the samples: x(k+1) = A x(k) + B u(k), measured C x(k+1) + D u(k)."""

    A: Array
    B: Array
    C: Array
    D: Array


@dataclass(frozen=True, eq=False)
class ActuatorModel:
    """One mode: the transfer function from the input to the velocity.

    Gadsden et al. 2011, (24) to (26).

    Parameters
    ----------
    numerator
        Coefficients of s^3 to 1, shape (4,).
    denominator
        Those of s^3 to 1, shape (4,); that of s^4 is 1.
    """

    numerator: ArrayLike
    denominator: ArrayLike
    _sampled: dict[tuple[str, float, float], SampledActuator] = field(
        default_factory=dict, init=False, repr=False
    )

    def __post_init__(self) -> None:
        for name in ("numerator", "denominator"):
            object.__setattr__(self, name, as_vector(name, getattr(self, name), ORDER))
        slowest = np.roots([1.0, *self.coefficients[1]]).real.max()
        if slowest >= 0:
            raise InputError(
                "denominator", f"has a pole with real part {slowest:g}, must be stable"
            )

    @property
    def coefficients(self) -> tuple[Array, Array]:
        """Numerator and denominator as arrays."""
        return np.asarray(self.numerator), np.asarray(self.denominator)

    @cached_property
    def markov(self) -> Array:
        """h1 to h4, shape (4,): the numbers that the transfer function's series in 1/s has."""
        b, a = self.coefficients
        h = np.zeros(ORDER)
        for k in range(ORDER):
            h[k] = b[k] - a[:k] @ h[:k][::-1]
        return h

    @property
    def gain(self) -> float:
        """Velocity over input at rest."""
        b, a = self.coefficients
        return float(b[-1] / a[-1])

    def blended(self, other: ActuatorModel, share: float) -> ActuatorModel:
        """The model whose coefficients lie ``share`` of the way to another's."""
        as_kind("other", other, ActuatorModel)
        if not 0 <= (share := as_scalar("share", share)) <= 1:
            raise InputError("share", f"{share:g} must be from 0 to 1")
        mine, theirs = self.coefficients, other.coefficients
        return ActuatorModel(
            *((1 - share) * here + share * there for here, there in zip(mine, theirs, strict=True))
        )

    def sampled(self, realisation: str, period: float, frequency: float) -> SampledActuator:
        """The model at samples, exactly, for an input that is held between them.

        Parameters
        ----------
        realisation
            One of `REALISATIONS`: ``velocity`` (4 states, 1 output), ``derivatives`` (4 states,
            velocity, acceleration and jerk), ``motion`` (5 states, the first a position;
            position, velocity and acceleration) or ``observer_canonical`` (4 states, velocity).
        period
            Between samples [s].
        frequency
            By whose powers states are divided [rad/s].
        """
        if not isinstance(realisation, str) or realisation not in REALISATIONS:
            raise InputError(
                "realisation", f"{shown(realisation)} must be one of {', '.join(REALISATIONS)}"
            )
        chosen = realisation, as_positive("period", period), as_positive("frequency", frequency)
        # Banks that differ in their noise alone share the models, thousands of times in a search.
        if chosen not in self._sampled:
            self._sampled[chosen] = self._sample(*chosen)
        return self._sampled[chosen]

    def _sample(self, realisation: str, period: float, scale: float) -> SampledActuator:
        powers = np.float64(scale) ** np.arange(ORDER)
        # Position, then velocity and its derivatives, divided by frequency^-1, 1, frequency, ...
        A, B = np.zeros((ORDER + 1, ORDER + 1)), np.zeros((ORDER + 1, 1))
        A[:-1, 1:] = scale * np.eye(ORDER)
        A[-1, 1:] = -self.coefficients[1][::-1] * powers / powers[-1]
        B[1:, 0] = self.markov / powers
        if realisation == "observer_canonical":
            A, B = self._observer_canonical(powers)
        elif realisation != "motion":
            A, B = A[1:, 1:], B[1:]
        transition, effect = zero_order_hold(A, B, period)
        measured = REALISATIONS[realisation]
        first = 0 if realisation == "motion" else 1
        C, D = np.zeros((len(measured), len(A))), np.zeros((len(measured), 1))
        for row, name in enumerate(measured):
            derivative = MOTION.index(name)
            C[row, derivative - first] = scale ** (derivative - 1)
            D[row] = self.markov[derivative - 2] if derivative >= 2 else 0.0
        return SampledActuator(transition, effect, C, D)

    def _observer_canonical(self, powers: Array) -> tuple[Array, Array]:
        b, a = self.coefficients
        A = np.diag(powers[1:] / powers[:-1], 1)
        A[:, 0] = -a / powers
        return A, (b / powers)[:, None]


def simulate(
    models: Sequence[ActuatorModel],
    mode: ArrayLike,
    control: ArrayLike,
    period: float,
    hand_over: str = "motion",
) -> Array:
    """Position, velocity, acceleration and jerk at the samples, from rest: shape (k + 1, 4).

    Where a sample ends a step of the input, acceleration and jerk are the limits from the left.

    Parameters
    ----------
    models
        One a mode.
    mode
        The index of the model that holds over each step, shape (k,).
    control
        Input over each step, shape (k,).
    period
        Between samples [s].
    hand_over
        What goes on as it was at a change of mode, one of `HAND_OVERS`: all of the ``motion``, so
        that the states x1 to x4 jump by what the input has a share in them; the ``states``, so that
        acceleration and jerk jump; or neither: all models run from the start on, and the
        ``outputs`` are switched, so that all but the position jumps.
    """
    if hand_over not in HAND_OVERS:
        raise InputError("hand_over", f"{shown(hand_over)} must be one of {', '.join(HAND_OVERS)}")
    frequency = 1.0 / as_positive("period", period)
    if not isinstance(models, list | tuple):
        raise InputError("models", f"{shown(models)} must be a list of models")
    models = [as_kind(f"models[{k}]", model, ActuatorModel) for k, model in enumerate(models)]
    held, chosen = as_floats("control", control), as_floats("mode", mode)
    whole = np.asarray(mode).dtype.kind in "iu"
    if held.ndim != 1:
        raise InputError("control", f"has shape {held.shape}, must be (k,)")
    if chosen.shape != held.shape:
        raise InputError("mode", f"has shape {chosen.shape}, must be {held.shape} like control")
    if not models or not whole or not np.isin(chosen, np.arange(len(models))).all():
        raise InputError("mode", f"must be whole numbers from 0 to {len(models) - 1}")
    sampled = [model.sampled("motion", period, frequency) for model in models]
    markov = np.array([model.markov for model in models])
    shares = np.zeros((len(models), ORDER + 1))
    shares[:, 2:] = markov[:, :-1] / frequency ** np.arange(1, ORDER)
    scales = frequency ** np.arange(-1.0, ORDER - 1)
    index = np.ascontiguousarray(chosen, dtype=np.int64)

    def run(index: NDArray[np.int64]) -> Array:
        motion: Array = _simulate(
            np.array([model.A for model in sampled]),
            np.array([model.B[:, 0] for model in sampled]),
            shares,
            shares if hand_over == "motion" else np.zeros_like(shares),
            scales,
            index,
            np.ascontiguousarray(held),
        )
        return motion

    if hand_over != "outputs":
        return run(index)
    alone = np.array([run(np.full_like(index, k)) for k in range(len(models))])
    return _switched(alone, index)


def _switched(alone: Array, mode: NDArray[np.int64]) -> Array:
    """The motion in the mode of each step, from those of models that run alone, (r, k + 1, 4)."""
    rows = np.arange(len(mode))
    motion = np.vstack([np.zeros(ORDER), alone[mode, rows + 1]])
    moved = alone[mode, rows + 1, 0] - alone[mode, rows, 0]
    motion[1:, 0] = np.cumsum(moved)
    return motion


@allocating_kernel
def _simulate(
    A: Array,
    B: Array,
    shares: Array,
    jumps: Array,
    scales: Array,
    mode: NDArray[np.int64],
    control: Array,
) -> Array:
    """``shares`` of the input in each state, of which ``jumps`` are made up for at a change.

    ``scales`` lead from states to motion.
    """
    n = ORDER + 1
    motion = np.zeros((len(control) + 1, ORDER))
    state, moved = np.zeros(n), np.zeros(n)
    for k in range(len(control)):
        now = mode[k]
        # x += (J_before - J_now) u: x + J u goes on as it was, with the jumps J
        if k > 0 and mode[k - 1] != now:
            for a in range(n):
                state[a] += (jumps[mode[k - 1], a] - jumps[now, a]) * control[k - 1]
        # x(k+1) = A x(k) + B u(k)
        for a in range(n):
            total = B[now, a] * control[k]
            for b in range(n):
                total += A[now, a, b] * state[b]
            moved[a] = total
        for a in range(n):
            state[a] = moved[a]
        # motion = scales (x + shares u)
        for a in range(ORDER):
            motion[k + 1, a] = scales[a] * (state[a] + shares[now, a] * control[k])
    return motion
