"""Delay estimation by output-error recursive least squares: a RECONSTRUCTION.

Lechappe et al. 2018 compare with the continuous recursive least squares of their reference [9],
which they do not print and which we did not have. This is not their method, but the simplest
estimator of that kind. With the estimate theta of the delay, for the plant
x' = -a x + b u(t - tau):

    x_m' = -a x_m + b u(t - theta)                        parallel model, x_m(0) = x(0)
    phi' = -a phi - b u'(t - theta)                       phi = d x_m / d theta, phi(0) = 0
    R'   = -f R + phi^2,  R(0) = 1 / P(0)                 information; f: forgetting
    theta' = phi (x - x_m) / R

Derivation. For a constant theta, u(t - tau) = u(t - theta) - u'(t - theta) (tau - theta)
to first order, so that the error e = x - x_m obeys e' = -a e - b u'(t - theta) (tau - theta). The
same equation drives phi, hence e = phi (tau - theta): a linear regression on one unknown. Least
squares with a weight that decays by f,

    min over tau of  (tau - theta(0))^2 exp(-f t) / P(0)
                     + the integral of exp(-f (t - s)) (e + phi theta - phi tau)^2 ds,

has the recursion above; with P = 1 / R it is the usual P' = f P - P^2 phi^2, theta' = P phi e. R
replaces P because its equation is linear and not stiff for any P(0).

The regression neglects the motion of theta, which adds phi theta' to the right-hand side of
e - phi (tau - theta). For a ramp, where everything else is exact, the error decays with the roots
of s^2 + a s + a f = 0 once R is steady: at the rate f if f is far below a, and at most at a / 2,
with f = a / 4. For a delay with a constant rate r the lag is r / f. Without forgetting R only
grows, and the estimator stops adapting. With forgetting and a constant input R goes to zero and
the gain phi / R may grow without bound: the estimator winds up, noise moves it between the bounds
of the delay, and finally it diverges. The model has no correction: a wrong x_m(0) disturbs it until
exp(-a t) has decayed, and longer without forgetting. This agrees with the paper's remark that [9]
needs exactly known initial conditions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reobserve.observers.fixed_step import check_rate
from reobserve_papers.papers.delay.estimator import DelayEstimator
from reobserve_papers.papers.delay.estimator_loop import law, run_law

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LeastSquaresDelayEstimator(DelayEstimator):
    """Output-error recursive least squares for a delay, a reconstruction (see the module).

    Lechappe et al. 2018, after (39).

    It is integrated by the classical Runge-Kutta method.

    Parameters
    ----------
    initial_covariance
        P(0) [s per squared x], greater than zero: the uncertainty of the initial estimate.
    forgetting
        f [1/s], zero or more.
    """

    initial_covariance: float
    forgetting: float

    def __post_init__(self) -> None:
        check_rate("decay", self.decay, self.sampling_period)
        check_rate("forgetting", self.forgetting, self.sampling_period)

    def start(self, x: float, delay: float) -> Array:
        """theta, x_m, phi and R."""
        return np.array([delay, x, 0.0, 1.0 / self.initial_covariance])

    def _fill(self, output: Array, inputs: Array, first: int, rows: Array) -> int:
        parameters = [self.decay, self.input_gain, self.forgetting]
        return run_law(_law, parameters, self, output, inputs, first, rows)


def _derivative(
    values: Array, parameters: Array, x: float, u: float, rate: float, out: Array
) -> None:
    a, b, forgetting = parameters
    _, model, phi, information = values
    out[0] = phi * (x - model) / information
    out[1] = -a * model + b * u
    out[2] = -a * phi - b * rate
    out[3] = -forgetting * information + phi * phi


_law = law(_derivative)
