"""Baselines, which must fail what a claim asks of an SVSF."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from reobserve.observers.kalman import Gain, LinearFilter, own_gain_function
from reobserve.systems.linear import LinearModel

Array = NDArray[np.float64]

# Observers of metrics: filters with random gains, and the measurement as it is.
RANDOM_GAIN, MEASUREMENT = "random_gain", "measurement"


@dataclass(frozen=True, eq=False, repr=False)
class RandomGainFilter(LinearFilter):
    """Filter that corrects a random share, from 0 to 1, of each innovation.

        K = C^+ diag(s),    s uniform

    C^+ is the pseudo-inverse. The shares are those of the innovations' digits, so that a run can be
    repeated; they do not depend on the size of an innovation or on its sign.
    """

    model: LinearModel

    @cached_property
    def method(self) -> Gain:
        """The gain function, and the pseudo-inverse of C, row by row."""
        return Gain(
            _random_gain.compiled,
            np.asarray(np.linalg.pinv(self.model.arrays.C), np.float64).ravel(),
        )


@own_gain_function
def _random_gain(
    cross: Array, factor: Array, innovation: Array, error: Array, parameters: Array, gain: Array
) -> None:
    n, m = gain.shape
    for o in range(m):
        # The first six digits of the innovation, and a step of a linear congruential generator
        digits = int(abs(math.frexp(innovation[o])[0]) * 1e6)
        share = float((1103515245 * digits + 12345) % 2147483648) / 2147483648.0
        for a in range(n):
            gain[a, o] = parameters[a * m + o] * share


def random_shares(innovation: Array) -> Array:
    """The shares of innovations that are corrected, by the digits of each."""
    digits = (np.abs(np.frexp(innovation)[0]) * 1e6).astype(np.int64)
    return (1103515245 * digits + 12345) % 2147483648 / 2147483648.0
