"""A linear observer of constant gain: Luenberger's, by poles, or the steady Kalman filter."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_kind
from reobserve.core.errors import InputError, shown
from reobserve.core.matrices import as_floats, spectral_radius
from reobserve.observers.gaussian_filter import GaussianFilter
from reobserve.observers.gaussian_state import FilterSteps, KalmanState
from reobserve.observers.kalman import LINEAR, TAKES
from reobserve.observers.linear_steps import Gain, own_gain_function
from reobserve.synthesis.linear import place, steady_kalman_gain
from reobserve.systems.linear import LinearModel

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class FixedGainObserver(GaussianFilter):
    """Linear observer of constant gain L: a prediction and its correction.

        x-(k) = A x^(k-1) + B u(k-1)
        x^(k) = x-(k) + L [y(k) - C x-(k) - D u(k)]

    The error is multiplied by (I - L C) A each sample. `luenberger` and `steady_kalman` find L. The
    covariance is that of any linear filter with this gain; the other estimates do not depend on Q
    and R.

    `init` takes the mean of x; `run` and `step` take y, shape (k, m), nan where missing, and u,
    (k, p), and by name what `KalmanFilter` takes, without S. Estimates, in units of the model:
    ``state``, x^, shape (k, n), ``covariance``, (k, n, n), and its diagonal ``variance``, (k, n);
    ``innovation``, (k, m), ``innovation_covariance``, (k, m, m), and ``log_likelihood``, (k,).

    Parameters
    ----------
    model
        The linear model of the plant.
    gain
        L, shape (n, m).

    Raises
    ------
    InputError
        If the gain has another shape, or the error does not decay.

    Examples
    --------
    >>> from reobserve import FixedGainObserver, LinearModel
    >>> model = LinearModel([[1, 0.1], [0, 1]], C=[[1, 0]], Q=1e-4, R=1e-2, sampling_period=0.1)
    >>> observer = FixedGainObserver(model, [[0.5], [1.0]])
    >>> run = observer.run([0.0, 0.11, 0.19, 0.29], state=observer.init([0, 0]))
    >>> print(observer.poles.round(2), run["state"][-1].round(3))
    [0.7+0.1j 0.7-0.1j] [0.221 0.373]
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
        """The state before the first row, from what `GaussianFilter.init` takes.

        The ``covariance`` is only for those who read the variance; ``mean`` and ``u`` are as there.
        """
        return super().init(mean, covariance, u=u)


def luenberger(model: LinearModel, poles: ArrayLike) -> FixedGainObserver:
    """The Luenberger observer whose error has these poles [1], inside the unit circle.

    Parameters
    ----------
    model
        The linear model of the plant.
    poles
        n eigenvalues of (I - L C) A, complex ones in conjugate pairs.

    Raises
    ------
    InputError
        If the poles cannot be placed, `reobserve.synthesis.linear.place`; or they are not stable.

    Examples
    --------
    >>> from reobserve import LinearModel, luenberger
    >>> model = LinearModel([[1, 0.1], [0, 1]], C=[[1, 0]], Q=1e-4, R=1e-2)
    >>> print(luenberger(model, poles=[0.5, 0.6]).gain.round(3))
    [[0.7]
     [2. ]]
    """
    A, _, C, _, _, _ = as_kind("model", model, LinearModel).arrays
    # The corrected estimate depends on the state through C A: (I - L C) A = A - L (C A).
    gain = place(A, C @ A, poles)
    outside = np.abs(np.atleast_1d(poles)) >= 1.0
    if outside.any():
        problem = "must be of discrete time, inside the unit circle, is not"
        raise InputError("poles", f"{shown(np.atleast_1d(poles)[outside][0].item())} {problem}")
    return FixedGainObserver(model, gain)


def steady_kalman(model: LinearModel) -> FixedGainObserver:
    """The Kalman filter with its steady gain, from the first row on.

        P = A P A' + Q - A L C P A',    L = P C' (C P C' + R)^-1

    Parameters
    ----------
    model
        The linear model of the plant.

    Raises
    ------
    InputError
        If there is no such gain, `reobserve.synthesis.linear.steady_kalman_gain`.

    Examples
    --------
    >>> from reobserve import LinearModel, steady_kalman
    >>> model = LinearModel([[1, 0.1], [0, 1]], C=[[1, 0]], Q=1e-4, R=1e-2)
    >>> print(steady_kalman(model).gain.round(3))
    [[0.159]
     [0.092]]
    """
    return FixedGainObserver(model, steady_kalman_gain(as_kind("model", model, LinearModel)))


@own_gain_function
def _given_gain(
    cross: Array, factor: Array, innovation: Array, error: Array, parameters: Array, gain: Array
) -> None:
    n, m = gain.shape
    for a in range(n):
        for o in range(m):
            gain[a, o] = parameters[a * m + o]
