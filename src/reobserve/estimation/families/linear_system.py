"""A linear model as YAML states it, and what filters on one have in common."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Literal, cast

import numpy as np

from reobserve.core.discretisation import zero_order_hold
from reobserve.core.errors import InputError
from reobserve.core.kernel import allocating_kernel
from reobserve.core.matrices import FloatArray
from reobserve.estimation.families.rules import periods, rule_estimates
from reobserve.estimation.families.signals import NamedSignal, variances
from reobserve.estimation.observer_design import Certificate, Design, Estimates, System, pole_text
from reobserve.observers.fixed_gain import FixedGainObserver
from reobserve.synthesis.linear_gain import undetectable_modes
from reobserve.systems.linear import LinearModel

Array = FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class LinearSystem(System):
    """x' = A x + B u or x(k+1) = A x(k) + B u(k), by the word ``time``, with y = C x + D u.

    A model of continuous time is sampled for inputs that are held. ``Q`` and ``R`` are covariances
    of the noise of a sample, in either time. ``check: false`` accepts a discrete A that looks like
    one of continuous time. ``periods`` are those of states and measurements that are angles, by
    name, in their units.
    """

    time: Literal["continuous", "discrete"]
    A: Array
    B: Array | None = None
    C: Array
    D: Array | None = None
    Q: Array = field(default_factory=lambda: np.array(0.0))
    R: Array = field(default_factory=lambda: np.array(1.0))
    check: bool = True
    periods: dict[str, float | str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n = len(self.states) or _rows(self.A)
        m, p = len(self.measurements) or _rows(self.C), len(self.inputs)
        if p and self.B is None:
            raise InputError("B", f"is missing, must have shape {(n, p)}, as there are inputs")
        if not p and self.B is not None and self.B.ndim == 2:
            p = self.B.shape[1]
        shapes = {"A": (n, n), "B": (n, p), "C": (m, n), "D": (m, p)}
        for name, shape in shapes.items():
            check_shape(name, getattr(self, name), shape)

    @property
    def mean(self) -> Array:
        """The initial state, zero where it is not stated, shape (n,)."""
        initial = self.initial_state
        return np.zeros(len(self.A)) if initial is None else np.array(initial, dtype=np.float64)

    def sampled(self, effect: Array) -> Array:
        """A matrix that enters x as B does, sampled, or as it is if its shape is another."""
        if self.time == "discrete" or effect.ndim != 2 or len(effect) != len(self.A):
            return effect
        # int_0^T exp(A s) ds E
        return zero_order_hold(self.A, effect, self.sampling_period)[1]

    @cached_property
    def model(self) -> LinearModel:
        """The sampled model, or `InputError` if it is none that filters can have."""
        matrices = (self.A, self.B, self.C, self.D)
        options: Any = {
            "Q": self.Q,
            "R": self.R,
            "sampling_period": self.sampling_period,
            **periods(self),
        }
        if self.time == "continuous":
            return LinearModel.from_ode(*matrices, **options)
        return LinearModel(*matrices, check=self.check, **options)


@dataclass(frozen=True, eq=False, kw_only=True)
class NoisySystem(LinearSystem):
    """A linear system of which the noise is known, and the covariance of the initial state.

    ``gate``, ``outliers`` and ``noise_memory`` [s] are those of `KalmanFilter`.
    """

    Q: Array
    R: Array
    initial_covariance: Array
    gate: float | None = None
    outliers: Literal["skip", "inflate"] | None = None
    noise_memory: float | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class BankSystem(NoisySystem):
    """A linear system for a bank of filters, which skips outliers."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.outliers is not None:
            raise InputError("outliers", "must be left out: a bank skips them")


def _rows(matrix: Array) -> int:
    return len(matrix) if matrix.ndim else 0


def check_shape(name: str, value: Any, shape: tuple[int, ...]) -> None:
    """Refuse a matrix of another shape than the signals ask for, unless it is None."""
    if value is not None and value.shape != shape:
        raise InputError(name, f"has shape {value.shape}, must be {shape}, as the signals say")


@dataclass(frozen=True, eq=False, kw_only=True)
class FilterDesign(Design):
    """A filter of mean and covariance (of a constant gain no deviations are known)."""

    left_out: ClassVar[tuple[str, ...]] = ("variance", "innovation", "log_likelihood")

    @property
    def estimates(self) -> Mapping[str, tuple[NamedSignal, ...]]:
        """The estimates of `GaussianFilter`."""
        return {
            "state": self.states, "variance": variances(self.states),
            "innovation": tuple(
                NamedSignal(f"{s.name}_innovation", s.unit) for s in self.measurements
            ),
            "log_likelihood": (NamedSignal("log_likelihood", "1"),),
            **rule_estimates(self.system, self.measurements),
        }  # fmt: skip

    def start(self) -> Any:
        """Initial mean and covariance, at the first sample, and what ``keys`` names besides."""
        observer, system = cast("Any", self.observer), self.system
        others = {name: getattr(system, key) for name, key in self.keys.items()}
        return observer.init(system.mean, system.initial_covariance, **others)

    def residual(self, y: Array, estimates: Estimates) -> Array:
        """The innovation, of a bank those of its filters, weighed by their probabilities."""
        innovation = estimates["innovation"]
        bank = "probability" in estimates
        return weighed(estimates["probability"], innovation) if bank else innovation

    @property
    def sigmas(self) -> Mapping[str, str]:
        """The variances of estimates, unless the gain is constant."""
        if isinstance(self.observer, FixedGainObserver):
            return {}
        pairs = {name: f"{name}_variance" for name in self.estimates}
        return {"state": "variance"} | {
            name: pair for name, pair in pairs.items() if pair in self.estimates
        }

    def residual_variance(self, estimates: Estimates) -> Array | None:
        """The diagonal of the innovation covariance, if the noise is stated and there is one."""
        if "innovation_covariance" not in estimates or not hasattr(
            self.system, "initial_covariance"
        ):
            return None
        return estimates["innovation_covariance"].diagonal(axis1=-2, axis2=-1)

    @property
    def unseen(self) -> tuple[str, ...]:
        """Modes of a linear model that stay as they start, unless more than its state is found."""
        model = self.system.model
        return unobserved(model) if isinstance(model, LinearModel) and not self.keys else ()


def unobserved(model: LinearModel, place: str = "model") -> tuple[str, ...]:
    """Sentences on modes whose estimate stays that of the start."""
    unobservable = undetectable_modes(model.A, model.C)
    if not len(unobservable):
        return ()
    return (
        f"state: a mode of {place} with the eigenvalue {unobservable[0]:.4g} does not decay and is "
        "unobservable, so that its estimate stays the initial one",
    )


def decay_sentences(certificate: Certificate, period: float) -> list[str]:
    """Sentences on what poles of discrete time mean."""
    radius = certificate["spectral_radius"]
    if radius == 0:
        return ["poles: all zero; an error is gone after as many samples as there are states"]
    rate = -period / np.log(radius)
    return [
        f"poles: {pole_text(certificate['poles'])}, of the error from sample to sample",
        f"spectral radius {radius:.6g}: the slowest error falls to 37 % in {rate:.3g} s",
    ]


@allocating_kernel
def weighed(probability: Array, innovation: Array) -> Array:
    """Innovations of modes, (k, r, p), by their probabilities, (k, r)."""
    rows, modes, size = innovation.shape
    mean = np.zeros((rows, size))
    for k in range(rows):
        for mode in range(modes):
            for place in range(size):
                mean[k, place] += probability[k, mode] * innovation[k, mode, place]
    return mean
