"""A linear observer of constant gain: Luenberger's, by poles, or the steady Kalman filter."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_kind, as_poles
from reobserve.core.balancing import output_scales, powers
from reobserve.core.errors import InputError
from reobserve.core.matrices import as_floats, spectral_radius
from reobserve.observers.gaussian_state import KalmanState
from reobserve.observers.kalman import Gain, LinearFilter, own_gain_function
from reobserve.synthesis.linear_gain import place, steady_kalman_gain
from reobserve.systems.linear import LinearModel

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class FixedGainObserver(LinearFilter):
    """Linear observer of constant gain L: a prediction and its correction.

        x-(k) = A x^(k-1) + B u(k-1)
        x^(k) = x-(k) + L [y(k) - C x-(k) - D u(k)]

    The error is multiplied by (I - L C) A each sample. This is the filter form, in which x^(k)
    knows y(k). Gains of the predictor form x-(k+1) = A x-(k) + B u(k) + Lp [y(k) - ...], as
    python-control's ``dlqe`` gives them, are Lp = A L: `filter_gain` finds L from those,
    `luenberger` and `steady_kalman` from the model. The covariance is that of any linear filter
    with this gain; the other estimates do not depend on Q and R.

    `init` takes the mean of x; `run` and `step` take y, shape (k, m), nan where missing, and u,
    (k, p), and by name what `KalmanFilter` takes, without S. Estimates, in units of the model:
    ``state``, x^, shape (k, n), ``covariance``, (k, n, n), and its diagonal ``variance``, (k, n);
    ``innovation``, (k, m), ``innovation_covariance``, (k, m, m), and ``log_likelihood``, (k,).

    Parameters
    ----------
    model
        The linear model of the plant.
    gain
        L of the filter form, shape (n, m): x^(k) = x-(k) + L [y(k) - C x-(k) - D u(k)]. For a gain
        of the predictor form, such as that of ``dlqe``, give ``filter_gain(model, Lp)``.
    gate, outliers
        As those of `KalmanFilter`.
    noise_memory
        Left out: R is estimated with Kalman's gain alone.

    Raises
    ------
    InputError
        If the gain has another shape, or the error does not decay.

    Examples
    --------
    >>> from reobserve import FixedGainObserver, LinearModel
    >>> model = LinearModel([[1, 0.1], [0, 1]], C=[[1, 0]], Q=1e-4, R=1e-2, sampling_period=0.1)
    >>> observer = FixedGainObserver(model, gain=[[0.5], [1.0]])
    >>> run = observer.run([0.0, 0.11, 0.19, 0.29], start=observer.init([0, 0]))
    >>> print(observer.poles.round(2), run["state"][-1].round(3))
    [0.7+0.1j 0.7-0.1j] [0.221 0.373]
    """

    model: LinearModel
    gain: Array = field(kw_only=True)

    if TYPE_CHECKING:  # what it takes is wider than what it then holds

        def __init__(
            self, model: LinearModel, *, gain: ArrayLike, gate: float | None = ...,
            outliers: Literal["skip", "inflate"] = ..., noise_memory: None = ...,
        ) -> None: ...  # fmt: skip

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
        """The state before the first row, from ``mean`` and ``u`` as `KalmanFilter.init` has them.

        Without a ``gate``, the estimates of the state do not depend on ``covariance``.
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
        If poles cannot be placed, `reobserve.synthesis.linear_gain.place`; or they are not stable.

    Examples
    --------
    >>> from reobserve import LinearModel, luenberger
    >>> model = LinearModel([[1, 0.1], [0, 1]], C=[[1, 0]], Q=1e-4, R=1e-2)
    >>> print(luenberger(model, poles=[0.5, 0.6]).gain.round(3))
    [[0.7]
     [2. ]]
    """
    A, _, C, _, _, _ = as_kind("model", model, LinearModel).arrays
    for pole in as_poles("poles", poles):
        if not abs(pole) < 1:
            said = "is not inside the unit circle: poles are of discrete time, z = exp(s T)"
            raise InputError("poles", f"{pole if pole.imag else pole.real:.6g} {said}")
    # The corrected estimate depends on the state through C A: (I - L C) A = A - L (C A).
    return FixedGainObserver(model, gain=place(A, C @ A, poles))


def steady_kalman(model: LinearModel) -> FixedGainObserver:
    """The Kalman filter with its steady gain, from the first row on.

        P = A P A' + Q - A L C P A',    L = P C' (C P C' + R)^-1

    L is of the filter form; ``dlqe`` of other packages gives A L.

    Parameters
    ----------
    model
        The linear model of the plant.

    Raises
    ------
    InputError
        If there is no such gain, `reobserve.synthesis.linear_gain.steady_kalman_gain`.

    Examples
    --------
    >>> from reobserve import LinearModel, steady_kalman
    >>> model = LinearModel([[1, 0.1], [0, 1]], C=[[1, 0]], Q=1e-4, R=1e-2)
    >>> print(steady_kalman(model).gain.round(3))
    [[0.159]
     [0.092]]
    """
    return FixedGainObserver(model, gain=steady_kalman_gain(as_kind("model", model, LinearModel)))


def filter_gain(model: LinearModel, predictor_gain: ArrayLike) -> Array:
    """L of the filter form, shape (n, m), from Lp = A L of the predictor form, that of ``dlqe``.

    Parameters
    ----------
    model
        The linear model of the plant.
    predictor_gain
        Lp, shape (n, m).

    Raises
    ------
    InputError
        If the gain has another shape, or no L has A L = Lp.

    Examples
    --------
    >>> from reobserve import LinearModel, filter_gain
    >>> model = LinearModel([[1, 0.1], [0, 1]], C=[[1, 0]], Q=1e-4, R=1e-2)
    >>> print(filter_gain(model, [[0.168], [0.092]]).round(3))
    [[0.159]
     [0.092]]
    """
    A, _, C, _, _, _ = as_kind("model", model, LinearModel).arrays
    gain, shape = as_floats("predictor_gain", predictor_gain), (len(A), len(C))
    if gain.shape != shape:
        raise InputError("predictor_gain", f"has shape {gain.shape}, must be {shape}")
    scales = output_scales(A, C).completed(A)
    even = scales.transition(A)
    wanted = powers(gain, scales.states[:, None] - scales.outputs)
    solution = np.asarray(np.linalg.lstsq(even, wanted, rcond=None)[0], dtype=np.float64)
    if np.abs(even @ solution - wanted).max() > 1e-9 * np.abs(wanted).max():
        raise InputError("predictor_gain", "is no A L: A is singular, and no filter has this gain")
    return scales.gain(solution)


@own_gain_function
def _given_gain(
    cross: Array, factor: Array, innovation: Array, error: Array, parameters: Array, gain: Array
) -> None:
    # K = L
    n, m = gain.shape
    for a in range(n):
        for o in range(m):
            gain[a, o] = parameters[a * m + o]
