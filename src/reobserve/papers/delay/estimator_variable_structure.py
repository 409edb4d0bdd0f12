"""Delay estimation by a relay (variable structure): a RECONSTRUCTION.

Lechappe et al. 2018 compare with the variable-structure observer of their reference [12], which
they do not print and which we did not have. Of it they say that it needs the whole state and its
derivative, that it tracks a varying delay, and that it oscillates when the delay is constant, the
more the larger the delay. What stands here is not the one that they ran. With the estimate
theta, for the plant x' = -a x + b u(t - tau) with x and x' known:

    w = x' + a x = b u(t - tau)
    s = (w / b - u(t - theta)) u'(t - theta)
    relay on the delay:        theta' = -M sign(s)
    relay on its inverse:      v' = M sign(s),  v = 1 / theta;  hence theta' = -M theta^2 sign(s)

Derivation. w / b - u(t - theta) = -u'(z) (tau - theta) for a z between t - tau and t - theta, so
that, as long as u' keeps its sign in between, s has the sign of theta - tau: either law moves
theta towards tau, reaches a constant tau in the finite time |tau - theta(0)| / M (or |1 / tau -
1 / theta(0)| / M) and stays if the speed of theta, M or M theta^2, is above |tau'|.

The speed has an upper limit too. s goes down the slope of (w / b - u(t - theta))^2, and near an
extremum of u there is a second valley: the mirror of tau. While t - tau passes the extremum,
theta, chattering, may be on the wrong side and be drawn to the mirror, up to a bound of the delay.
The ridge between the valleys moves through theta with speed 1, so that a slower relay cannot stay
ahead of it and comes back at once. Hence |tau'| < M < 1, or |tau'| < M theta^2 < 1. A faster one
loses the delay at some extrema and not at others: which, depends on the phase of its chatter.

Sampled with the step h and held, as here, the relay does not slide but chatters around a constant
delay: peak to peak by M h, whatever the delay, in the first form, by M theta^2 h in the second.
Only the second has the growth with the delay that the paper's text tells of, and that is the one
reason to prefer it for a comparison: it was chosen AFTER, and because, it matches. Nothing that
agrees with the text for this reason is evidence for the text.

The held relay is integrated exactly: theta, or v, is linear over a step, which is an explicit
Euler step in that variable. A Runge-Kutta method makes no sense here: its order needs a smooth
right-hand side, and its stages would average over the sign and blur the chatter that is the point.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.core.kernel import kernel
from reobserve.papers.delay.estimator import DelayEstimator
from reobserve.papers.delay.estimator_loop import past_input

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class VariableStructureDelayEstimator(DelayEstimator):
    """A relay that moves a delay; a reconstruction, see the module.

    Lechappe et al. 2018, after (39).

    It measures x and x' [1/s]. Its only value is theta. The relay reads measurement
    and input at the start of each period and holds over it.

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
        """The delay alone.

        Raises
        ------
        InputError
            For the relay on the inverse if the delay is zero.
        """
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
    """Fill ``rows`` from its first one; return how many are finite."""
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
            # Held, 1 / theta is linear; at or below 1 / tau_max it has met that bound on the way.
            v = 1.0 / theta + relay_gain * step * s
            theta = bounds[1] if v * bounds[1] <= 1.0 else 1.0 / v
        else:
            theta -= relay_gain * step * s
        rows[k + 1, 0] = min(max(theta, bounds[0]), bounds[1])
    return len(rows)
