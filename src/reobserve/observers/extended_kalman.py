"""The extended Kalman filter: a Kalman filter on the model linearised about each estimate.

    x = f(x, u),            P = A P A' + Q                           A = df/dx
    S = C P C' + R,         K = P C' S^-1                            C = dh/dx
    x = x + K (y - h(x, u)),  P = (I - K C) P (I - K C)' + K R K'

Jazwinski 1970, Stochastic Processes and Filtering Theory, theorem 8.1.
"""

from __future__ import annotations

from dataclasses import dataclass

from reobserve.observers.nonlinear_filter import NonlinearFilter


@dataclass(frozen=True, eq=False, repr=False)
class ExtendedKalmanFilter(NonlinearFilter):
    """The extended Kalman filter.

    Parameters
    ----------
    model
        The nonlinear model that it trusts; its Jacobians are given there, derived from text, or
        found by differences.
    """

    @property
    def weights(self) -> None:
        """None: it has no sigma points."""
        return
