"""Adaptive delay identification with filtered regressors: a RECONSTRUCTION.

Lechappe et al. 2018 compare with the adaptive identification of their reference [26], which they
do not print and which we did not have. This is not their method, but a gradient law with forgetting
on filtered signals. With the estimate theta of the delay and the filter F = 1 / (k s + 1), for the
plant x' = -a x + b u(t - tau):

    k x_f' = x - x_f                                        x_f = F x
    k g_f' = b [u(t - theta) + theta u'(t - theta)] - g_f
    k phi_f' = -b u'(t - theta) - phi_f
    y_f = (x - x_f) / k + a x_f - g_f
    P' = -l P + phi_f^2,    Q' = -l Q + phi_f y_f,          P(0) = Q(0) = 0
    theta' = -Gamma (P theta - Q)

Derivation. To first order u(t - tau) = u(t - theta) - u'(t - theta) (tau - theta), so that

    x' + a x - b [u(t - theta) + theta u'(t - theta)] = -b u'(t - theta) tau:

which is linear in tau at each instant, for any motion of theta. x' is not known, but its filtered
value is: F x' = (x - x_f) / k. Filtering both sides gives y_f = phi_f tau for a constant tau. The
integral of exp(-l (t - s)) (y_f - phi_f theta)^2 / 2 ds has the gradient P theta - Q in theta, and
theta follows the negative gradient. The initial values x_f = x(0), g_f = a x(0) and phi_f = 0 make
both sides equal at the start.

To first order Q = P tau, so the error decays at the rate Gamma P: exactly for a ramp and a constant
delay, with any history of P. Linearising at theta causes a disturbance of second order,
b u'' (tau - theta)^2 / 2, which P and Q forget with the time constant 1 / l. For a delay with a
constant rate r the lag is r (k + 1 / l + 1 / (Gamma P)). Without excitation P goes to zero and the
estimate stays constant: unlike least squares with forgetting this law does not wind up.
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
class AdaptiveDelayEstimator(DelayEstimator):
    """Adaptive identification of a delay, a reconstruction (see the module).

    Lechappe et al. 2018, after (39).

    It is integrated by the classical Runge-Kutta method.

    Parameters
    ----------
    filter_time
        k [s], greater than zero.
    forgetting
        l [1/s], greater than zero.
    adaptation_gain
        Gamma [s^2 per squared x], greater than zero.
    """

    filter_time: float
    forgetting: float
    adaptation_gain: float

    def __post_init__(self) -> None:
        check_rate("filter_time", 1.0 / self.filter_time, self.sampling_period)
        check_rate("forgetting", self.forgetting, self.sampling_period)

    def start(self, x: float, delay: float) -> Array:
        """theta, x_f, g_f, phi_f, P and Q."""
        return np.array([delay, x, self.decay * x, 0.0, 0.0, 0.0])

    def _fill(self, output: Array, inputs: Array, first: int, rows: Array) -> int:
        parameters = [
            self.decay,
            self.input_gain,
            self.filter_time,
            self.forgetting,
            self.adaptation_gain,
        ]
        return run_law(_law, parameters, self, output, inputs, first, rows)


def _derivative(
    values: Array, parameters: Array, x: float, u: float, rate: float, out: Array
) -> None:
    a, b, k, forgetting, gain = parameters
    theta, x_f, g_f, phi_f, P, Q = values
    y_f = (x - x_f) / k + a * x_f - g_f
    out[0] = -gain * (P * theta - Q)
    out[1] = (x - x_f) / k
    out[2] = (b * (u + theta * rate) - g_f) / k
    out[3] = (-b * rate - phi_f) / k
    out[4] = -forgetting * P + phi_f * phi_f
    out[5] = -forgetting * Q + phi_f * y_f


_law = law(_derivative)
