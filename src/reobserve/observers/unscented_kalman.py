"""The unscented Kalman filter with scaled sigma points (Wan & van der Merwe 2000)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

from reobserve.core.errors import InputError
from reobserve.core.matrices import as_positive, as_scalar
from reobserve.observers.gaussian_filter import GaussianFilter
from reobserve.observers.gaussian_state import FilterSteps
from reobserve.observers.nonlinear_filter import NONLINEAR, TAKES
from reobserve.observers.unscented_kalman_loop import Weights
from reobserve.systems.nonlinear import NonlinearModel
from reobserve.systems.nonlinear_flow import Functions


@dataclass(frozen=True, eq=False, repr=False)
class UnscentedKalmanFilter(GaussianFilter):
    """Unscented Kalman filter with scaled sigma points, without Jacobians.

        X_0 = x,   X_i = x + c L_i,   X_(n+i) = x - c L_i,   P = L L',   c^2 = n + lambda
        lambda = alpha^2 (n + kappa) - n
        x = sum w_i f(X_i),   P = sum v_i (f(X_i) - x) (f(X_i) - x)' + Q

    The weights of all points but the first are 1 / (2 c^2); those of the first are lambda / c^2 in
    means and lambda / c^2 + 1 - alpha^2 + beta in covariances (Wan & van der Merwe 2000). The
    points are placed again after the prediction, and L is the lower Cholesky factor, as in
    filterpy.

    `init` takes mean and covariance; `run` and `step` take y, shape (k, m), nan where missing, and
    u, (k, p), and by name what `ExtendedKalmanFilter` takes. Estimates, in units of the model:
    ``state``, x, shape (k, n), ``covariance``, P, (k, n, n), and its diagonal ``variance``, (k, n);
    ``innovation``, (k, m), ``innovation_covariance``, (k, m, m), and ``log_likelihood``, (k,).

    Parameters
    ----------
    model
        The nonlinear model of the plant.
    alpha
        How far the points are spread, from above 0 to 1. Wan & van der Merwe name 0.001; filterpy's
        ``MerweScaledSigmaPoints`` has no default and uses 0.1 in its examples. Weights grow as
        1 / alpha^2, and so do rounding errors.
    beta
        Knowledge of the distribution's tails; 2 is best for a Gaussian one.
    kappa
        Second spread, above -n; 0 as in Wan & van der Merwe. filterpy's documentation names 3 - n.

    Raises
    ------
    InputError
        If ``alpha`` is not above 0 and up to 1, or n + ``kappa`` is not above 0.

    Examples
    --------
    >>> from reobserve import NonlinearModel, UnscentedKalmanFilter
    >>> pendulum = NonlinearModel.from_ode(
    ...     ["rate", "-9.81*sin(angle)"], ["angle"], Q=1e-6, R=1e-4,
    ...     state_names=["angle", "rate"], sampling_period=0.1,
    ... )
    >>> observer = UnscentedKalmanFilter(pendulum)
    >>> run = observer.run([0.3, 0.285, 0.243, 0.178, 0.095, 0.003], state=observer.init([0, 0], 1))
    >>> print(run["state_rate"][-1].round(2))
    -0.94
    """

    model: NonlinearModel
    alpha: float = 0.1
    beta: float = 2.0
    kappa: float = 0.0

    steps: ClassVar[FilterSteps] = NONLINEAR
    has_kalman_gain: ClassVar[bool] = True
    takes: ClassVar[tuple[str, ...]] = TAKES

    def __post_init__(self) -> None:
        super().__post_init__()
        alpha = as_positive("alpha", self.alpha)
        if not 1e-6 <= alpha <= 1:
            raise InputError("alpha", f"{alpha:g} must be from 1e-6 to 1")
        kappa = as_scalar("kappa", self.kappa)
        if self.model.states + kappa <= 0:
            raise InputError("kappa", f"{kappa:g} must be above -{self.model.states}, minus n")
        object.__setattr__(self, "alpha", alpha)
        object.__setattr__(self, "beta", as_scalar("beta", self.beta))
        object.__setattr__(self, "kappa", kappa)

    @property
    def functions(self) -> Functions:
        """The model's functions, without Jacobians."""
        return self.model.functions_alone

    @cached_property
    def method(self) -> Weights:
        """The weights of the sigma points."""
        n, alpha_squared = self.model.states, self.alpha**2
        square = alpha_squared * (n + self.kappa)
        first = (square - n) / square + 1.0 - alpha_squared + self.beta
        return Weights(math.sqrt(square), 0.5 / square, first)
