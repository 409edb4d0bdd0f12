"""Rules of filters beside their model: angles, outliers, and a measurement noise that is estimated.

The compiled steps of all filters call these with their scratch, ``work``: a `LinearWork` of
`reobserve.observers.linear_steps`, which holds the `Rules`.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from reobserve.core.kernel import inlined_kernel

Array = NDArray[np.float64]


class Rules(NamedTuple):
    """Settings of a filter beside its model.

    ``state_periods`` (n,) and ``output_periods`` (m,) are those of angles, 0 for none. Innovations
    beyond ``gate`` deviations are left out, or ``inflates`` their variance; inf is no gate. R is
    estimated with the weight ``forgetting`` of a row, 0 if it is known.
    """

    state_periods: Array
    output_periods: Array
    gate: float
    inflates: bool
    forgetting: float


def forgetting(memory: float | None, period: float) -> float:
    """The weight of a row in an estimate of R with a memory [s], 0 if R is known (None)."""
    return 0.0 if memory is None else min(1.0, period / memory)


@inlined_kernel
def shortest(difference: float, period: float) -> float:
    """A difference of angles the shortest way round, as it is where the period is 0."""
    if period > 0.0:
        return difference - period * math.floor(difference / period + 0.5)
    return difference


@inlined_kernel
def wrap_states(mean: Array, work: Any) -> None:
    """Move angles among the states to within half a period around zero."""
    for a in range(len(work.states)):
        mean[a] = shortest(mean[a], work.rules.state_periods[a])


@inlined_kernel
def noise_of_row(R: Array, variances: Array, work: Any) -> None:
    """Write R as it is used at a row to ``work.noise``: with the estimated variances, if any.

    Correlations are those of R.
    """
    noise, estimated = work.noise, work.rules.forgetting > 0.0
    for o in range(len(work.outputs)):
        work.outlier[o] = 0.0
        for q in range(len(work.outputs)):
            noise[o, q] = R[o, q]
            if estimated and o == q:
                noise[o, q] = variances[o]
            elif estimated:
                noise[o, q] *= math.sqrt(variances[o] / R[o, o] * (variances[q] / R[q, q]))


@inlined_kernel
def gate(innovation: Array, work: Any) -> None:
    """Leave out innovations beyond the gate, or inflate their variance so that they are on it.

    ``work.factor`` is the lower half of S, whose diagonal and that of R are inflated.
    """
    factor, gate = work.factor, work.rules.gate
    if gate == math.inf:
        return
    for o in range(len(work.outputs)):
        # |e_o| > gate sqrt(S_oo)
        deviations = innovation[o] / math.sqrt(factor[o, o])
        if abs(deviations) > gate:
            work.outlier[o] = deviations
            if work.rules.inflates:
                # R_oo = R_oo + e_o^2 / gate^2 - S_oo
                wider = (innovation[o] / gate) ** 2
                work.noise[o, o] += wider - factor[o, o]
                factor[o, o] = wider
            else:
                innovation[o] = math.nan


@inlined_kernel
def learn_noise(innovation: Array, weight: float, work: Any) -> None:
    """Write to ``work.change`` what a row changes of the variances of R, with its weight g.

    The expectation of v v' after the measurement, whose mean is R S^-1 e and whose covariance is
    R - R S^-1 R: a step of expectation maximisation (Shumway & Stoffer 1982) that forgets.
    """
    # R = R + g diag(R S^-1 (e e' - S) S^-1 R)
    m, column, factor = len(work.outputs), work.column, work.factor
    for o in range(m):
        work.change[o] = 0.0
        if math.isnan(innovation[o]) or work.outlier[o] != 0.0:
            continue
        mean, spread = 0.0, 0.0
        for q in range(m):
            # L w = R_o
            total = 0.0 if math.isnan(innovation[q]) else work.noise[q, o]
            for i in range(q):
                total -= factor[q, i] * column[i]
            column[q] = total / factor[q, q]
            mean += column[q] * work.scaled[q]
            spread += column[q] * column[q]
        work.change[o] = weight * (mean * mean - spread)
