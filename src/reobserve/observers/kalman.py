"""The Kalman filter (Kalman 1960), in predictor-corrector form with Joseph's covariance."""

from __future__ import annotations

from dataclasses import dataclass

from reobserve.observers.linear_filter import LinearFilter


@dataclass(frozen=True, eq=False, repr=False)
class KalmanFilter(LinearFilter):
    """The linear filter of minimum variance: K = P C' S^-1.

    Parameters
    ----------
    model
        The linear model that it trusts.
    """

    @property
    def gain_function(self) -> None:
        """None: the Kalman gain is the one that the loops have built in."""
        return
