"""The extended Kalman filter: a Kalman filter on the model linearised about each estimate."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from reobserve.observers.gaussian_filter import GaussianFilter
from reobserve.observers.gaussian_state import FilterSteps
from reobserve.observers.nonlinear_filter import NONLINEAR, TAKES
from reobserve.systems.nonlinear import NonlinearModel
from reobserve.systems.nonlinear_flow import Functions


@dataclass(frozen=True, eq=False, repr=False)
class ExtendedKalmanFilter(GaussianFilter):
    """Extended Kalman filter: Kalman's on the model linearised about each estimate.

        x = f(x, u),              P = A P A' + Q                           A = df/dx
        S = C P C' + R,           K = P C' S^-1                            C = dh/dx
        x = x + K (y - h(x, u)),  P = (I - K C) P (I - K C)' + K R K'

    Jazwinski 1970, Stochastic Processes and Filtering Theory, theorem 8.1. `init` takes mean and
    covariance; `run` and `step` take y, shape (k, m), nan where missing, and u, (k, p), and by name
    Q, R, ``parameters``, ``dt`` and ``keep``, see `GaussianFilter`. Estimates, in units of the
    model: ``state``, x, shape (k, n), ``covariance``, P, (k, n, n), and its diagonal ``variance``,
    (k, n); ``innovation``, y - h(x, u), (k, m), ``innovation_covariance``, S, (k, m, m), and
    ``log_likelihood``, (k,).

    Parameters
    ----------
    model
        The nonlinear model of the plant; its Jacobians are given there, derived from text, or
        found by differences.

    Raises
    ------
    InputError
        If the model is of another kind.

    Examples
    --------
    >>> from reobserve import ExtendedKalmanFilter, NonlinearModel
    >>> pendulum = NonlinearModel.from_ode(
    ...     ["rate", "-9.81*sin(angle)"], ["angle"], Q=1e-6, R=1e-4,
    ...     state_names=["angle", "rate"], sampling_period=0.1,
    ... )
    >>> observer = ExtendedKalmanFilter(pendulum)
    >>> run = observer.run([0.3, 0.285, 0.243, 0.178, 0.095, 0.003], state=observer.init([0, 0], 1))
    >>> print(run["state_rate"][-1].round(2))
    -0.94
    """

    model: NonlinearModel

    steps: ClassVar[FilterSteps] = NONLINEAR
    has_kalman_gain: ClassVar[bool] = True
    takes: ClassVar[tuple[str, ...]] = TAKES

    @property
    def method(self) -> None:
        """None: it has no sigma points."""
        return

    @property
    def functions(self) -> Functions:
        """The model's functions, with Jacobians."""
        return self.model.functions
