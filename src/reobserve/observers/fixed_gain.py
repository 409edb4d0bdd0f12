"""A linear observer of constant gain: Luenberger's, by poles, or the steady Kalman filter.

    x-(k) = A x^(k-1) + B u(k-1)
    x^(k) = x-(k) + L [y(k) - C x-(k) - D u(k)]

Its error moves by (I - L C) A a sample. It computes a covariance like any linear filter:
where Q and R are not known, its estimates do not depend on them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_kind
from reobserve.core.errors import InputError
from reobserve.core.matrices import as_floats, spectral_radius
from reobserve.observers.gaussian_filter import GaussianFilter
from reobserve.observers.gaussian_state import FilterSteps, KalmanState
from reobserve.observers.kalman import LINEAR, TAKES
from reobserve.observers.linear_steps import Gain, gain_function
from reobserve.synthesis.linear import place, steady_kalman_gain
from reobserve.systems.linear import LinearModel

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class FixedGainObserver(GaussianFilter):
    """A prediction corrected by a constant gain; its estimates are those of `GaussianFilter`.

    Parameters
    ----------
    model
        The linear model that it trusts.
    gain
        L, shape (n, m).

    Raises
    ------
    InputError
        If the gain has another shape, or its error does not decay.
    """

    model: LinearModel
    gain: Array

    steps: ClassVar[FilterSteps] = LINEAR
    takes: ClassVar[tuple[str, ...]] = TAKES

    if TYPE_CHECKING:  # what it takes is wider than what it then holds

        def __init__(self, model: LinearModel, gain: ArrayLike) -> None: ...

    def __post_init__(self) -> None:
        super().__post_init__()
        gain, wanted = as_floats("gain", self.gain), (self.model.states, self.model.outputs)
        if gain.shape != wanted:
            raise InputError("gain", f"has shape {gain.shape}, must be {wanted}")
        self._set("gain", gain)
        radius = spectral_radius(self._error_transition)
        if radius >= 1.0:
            raise InputError(
                "gain",
                "gives no stable observer: the spectral radius of (I - L C) A must be below 1, "
                f"it is {radius:.6g}",
            )

    @property
    def _error_transition(self) -> Array:
        A, _, C, _, _, _ = self.model.arrays
        return (np.eye(len(A)) - self.gain @ C) @ A

    @property
    def poles(self) -> NDArray[Any]:
        """Eigenvalues of (I - L C) A, shape (n,), the slowest first."""
        poles = np.linalg.eigvals(self._error_transition)
        return poles[np.argsort(-np.abs(poles), kind="stable")]

    @cached_property
    def method(self) -> Gain:
        """The gain as it was given, row by row."""
        return Gain(_given_gain.compiled, self.gain.flatten())

    def init(
        self, mean: ArrayLike, covariance: ArrayLike = 0.0, *, u: ArrayLike | None = None
    ) -> KalmanState:
        """As `GaussianFilter.init`; a covariance is only for those who read the variance."""
        return super().init(mean, covariance, u=u)


def luenberger(model: LinearModel, poles: ArrayLike) -> FixedGainObserver:
    """The observer whose error has these poles [1], inside the unit circle.

    Raises
    ------
    InputError
        If the poles cannot be placed, `reobserve.synthesis.linear.place`; or they are not stable.
    """
    A, _, C, _, _, _ = as_kind("model", model, LinearModel).arrays
    # The corrected estimate depends on the state through C A: (I - L C) A = A - L (C A).
    return FixedGainObserver(model, place(A, C @ A, poles))


def steady_kalman(model: LinearModel) -> FixedGainObserver:
    """The Kalman filter with the gain that it comes to, from the first row on.

    Raises
    ------
    InputError
        If there is no such gain, `reobserve.synthesis.linear.steady_kalman_gain`.
    """
    return FixedGainObserver(model, steady_kalman_gain(as_kind("model", model, LinearModel)))


@gain_function
def _given_gain(
    cross: Array, factor: Array, innovation: Array, error: Array, parameters: Array, gain: Array
) -> None:
    n, m = gain.shape
    for a in range(n):
        for o in range(m):
            gain[a, o] = parameters[a * m + o]
