"""The extended Kalman filter: a Kalman filter on the model linearised about each estimate.

    x = f(x, u),            P = A P A' + Q                           A = df/dx
    S = C P C' + R,         K = P C' S^-1                            C = dh/dx
    x = x + K (y - h(x, u)),  P = (I - K C) P (I - K C)' + K R K'

Jazwinski 1970, Stochastic Processes and Filtering Theory, theorem 8.1.
"""

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
    """The extended Kalman filter; its estimates are those of `GaussianFilter`.

    Parameters
    ----------
    model
        The nonlinear model that it trusts; its Jacobians are given there, derived from text, or
        found by differences.
    """

    model: NonlinearModel

    steps: ClassVar[FilterSteps] = NONLINEAR
    takes: ClassVar[tuple[str, ...]] = TAKES

    @property
    def method(self) -> None:
        """None: it has no sigma points."""
        return

    @property
    def functions(self) -> Functions:
        """The model's functions, with Jacobians."""
        return self.model.functions
