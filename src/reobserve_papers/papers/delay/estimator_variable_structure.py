"""Delay estimation by a relay (variable structure): a RECONSTRUCTION.

Lechappe et al. 2018 compare with the variable-structure observer of their reference [12], which
they do not print and which we did not have. They say that it needs the whole state and its
derivative, that it tracks a varying delay, and that it oscillates while the delay is constant, more
strongly for a larger delay. This is not their method. With the estimate theta, for the plant
x' = -a x + b u(t - tau) with x and x' known:

    w = x' + a x = b u(t - tau)
    s = (w / b - u(t - theta)) u'(t - theta)
    relay on the delay:        theta' = -M sign(s)
    relay on its inverse:      v' = M sign(s),  v = 1 / theta;  hence theta' = -M theta^2 sign(s)

Derivation. w / b - u(t - theta) = -u'(z) (tau - theta) for a z between t - tau and t - theta. So
s has the sign of theta - tau as long as u' keeps its sign in between, and both relays move theta
towards tau. theta reaches a constant tau in the finite time |tau - theta(0)| / M (or |1 / tau -
1 / theta(0)| / M) and stays there if its speed, M or M theta^2, is above |tau'|.

The speed also has an upper limit. The relay descends along (w / b - u(t - theta))^2, which has a
second minimum near an extremum of u: the mirror image of tau. While t - tau passes the extremum,
the chattering theta may be on the wrong side and move to the mirror image, up to a bound of the
delay. The maximum between the two minima moves in theta with speed 1; it overtakes a slower relay,
which then returns at once. Hence |tau'| < M < 1, or |tau'| < M theta^2 < 1. A faster relay loses
the delay at some extrema, depending on the phase of its chatter.

Sampled with the step h and held, as here, the relay does not slide but chatters around a constant
delay: peak to peak by M h in the first form, for any delay, and by M theta^2 h in the second. Only
the second grows with the delay, as the paper says. This is the only reason to use it for the
comparison: it was chosen AFTER, and because, it matches. An agreement with the text that has this
cause is no evidence for the text.

The held relay is integrated exactly: theta, or v, is linear over a step, which is an explicit
Euler step in that variable. A Runge-Kutta method is unsuitable: its order needs a smooth
right-hand side, and its stages would average over the sign and hide the chatter.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.core.kernel import kernel
from reobserve_papers.papers.delay.estimator import DelayEstimator
from reobserve_papers.papers.delay.estimator_loop import past_input

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class VariableStructureDelayEstimator(DelayEstimator):
    """Relay that moves a delay, a reconstruction (see the module).

    Lechappe et al. 2018, after (39).

    It measures x and x' [1/s]. Its only value is theta. The relay samples measurement and input
    at the start of each period and is constant over it.

    Parameters
    ----------
    relay_gain
        M, greater than zero; [1] for the relay on the delay, [1/s^2] for that on its inverse.
    relay_on
        ``delay`` or ``inverse``. The second was chosen because it matches the paper's text.
    """

    relay_gain: float
    relay_on: str

    measurements: ClassVar[int] = 2

    def start(self, x: float, delay: float) -> Array:
        """The delay alone."""
        if self.relay_on == "inverse" and delay == 0:
            raise InputError(
                "initial_delay", "0 s must be greater than zero for a relay on its inverse"
            )
        return np.array([delay])

    def _fill(self, output: Array, inputs: Array, first: int, rows: Array) -> int:
        plant = self.decay, self.input_gain
        relay = self.relay_gain, self.relay_on == "inverse"
        bounds, step = self.delay_bounds, self.sampling_period
        return _run(plant, relay, bounds, step, output, inputs, first, rows)


@kernel
def _run(
    plant: tuple[float, float],
    relay: tuple[float, bool],
    bounds: tuple[float, float],
    step: float,
    output: Array,
    inputs: Array,
    first: int,
    rows: Array,
) -> int:
    """Fill ``rows`` from its first one, and return how many are finite."""
    decay, input_gain = plant
    relay_gain, inverse = relay
    for k in range(len(rows) - 1):
        theta = rows[k, 0]
        u, rate = past_input(inputs, first + 2 * k, 0.0, theta / step, step)
        w = output[2 * k, 1] + decay * output[2 * k, 0]
        s = np.sign((w / input_gain - u) * rate)
        if not np.isfinite(s):
            return k + 1
        if inverse:
            # 1 / theta is linear over a step; at or below 1 / tau_max theta is at its bound.
            v = 1.0 / theta + relay_gain * step * s
            theta = bounds[1] if v * bounds[1] <= 1.0 else 1.0 / v
        else:
            theta -= relay_gain * step * s
        rows[k + 1, 0] = min(max(theta, bounds[0]), bounds[1])
    return len(rows)
