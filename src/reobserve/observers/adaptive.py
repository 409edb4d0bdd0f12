"""Adaptive observer of a rigid body with a proportional-integral fault estimate.

With Kp = 0 this is the classical adaptive observer, whose fault estimate is an integrator: the
kind of law that Chen & Saif 2007 compare with in Fig. 4. They cite it and do not print it;
what stands here is a reconstruction. With Gamma = K2 / tau and Kp = K2 / 2 it is the limit of
an iterative learning observer with K1 = I and a small tau.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from reobserve.core.covariances import as_positive_definite
from reobserve.core.interrupts import FIRST, poll
from reobserve.core.kernel import kernel
from reobserve.core.matrices import Matrix, as_matrix
from reobserve.core.value import converter, for_loop
from reobserve.observers.rigid_body_observer import (
    Array,
    RigidBodyObserver,
    RigidBodyRecord,
    RigidBodyRows,
)
from reobserve.systems.rigid_body import RigidBody
from reobserve.systems.rigid_body_arithmetic import (
    Triple,
    acceleration,
    ahead,
    product,
    rk4_sum,
    row,
)


class AdaptiveConstants(NamedTuple):
    """Constants of the loop."""

    inertia: Matrix
    inverse: Matrix
    injection: Matrix
    input_matrix: Matrix
    fault_matrix: Matrix
    integral_gain: Matrix
    proportional_gain: Matrix
    step: float


@dataclass(frozen=True, eq=False, repr=False)
class AdaptiveObserver(RigidBodyObserver):
    """Fault estimation by an integrator, with or without a proportional part.

        J w^' = -w^ x J w^ + Lambda (w - w^) + B u + B_f f^
        f^ = z + Kp (w - w^),    z' = Gamma (w - w^)

    Chen & Saif 2007, Section 4, adaptive. `init` takes rate and fault; left out, a run starts from
    the first measurement. `run` and `step` take y, the rate w [rad/s], and u [N m], both of shape
    (k, 3). Estimates: ``rate``, w^ [rad/s], and ``fault``, f^ [N m], both (k, 3); `Run.before` has
    limits of ``fault`` from the left.

    Parameters
    ----------
    model
        The observer's model of the rigid body.
    observer_gain
        Lambda [N m s/rad]: a number (times the identity), a diagonal or 3 x 3; symmetric
        positive definite.
    integral_gain
        Gamma [N m/rad], likewise.
    proportional_gain
        Kp [N m s/rad], a number, a diagonal or 3 x 3; zero for the classical law.
    sampling_period
        [s], and the step of the method.

    Raises
    ------
    InputError
        If a shape is wrong, Lambda or Gamma is not positive definite or the step not positive.

    Examples
    --------
    >>> import numpy as np
    >>> from reobserve import AdaptiveObserver, RigidBody
    >>> observer = AdaptiveObserver(
    ...     RigidBody([36, 17, 26]), observer_gain=500.0, integral_gain=5000.0,
    ...     proportional_gain=50.0, sampling_period=0.01,
    ... )
    >>> rate = np.outer(0.01 * np.arange(200), [0.5 / 36, 0, 0])  # 0.5 N m about the first axis
    >>> run = observer.run(rate, np.zeros((200, 3)))
    >>> print(run["fault"][-1, 0].round(2))
    0.5
    """

    observer_gain: Matrix = field(kw_only=True, metadata=converter(as_positive_definite, 3))
    integral_gain: Matrix = field(kw_only=True, metadata=converter(as_positive_definite, 3))
    proportional_gain: Matrix = field(kw_only=True, metadata=converter(as_matrix, 3))

    if TYPE_CHECKING:  # what it takes is wider than what it then holds

        def __init__(
            self,
            model: RigidBody,
            *,
            observer_gain: ArrayLike,
            integral_gain: ArrayLike,
            proportional_gain: ArrayLike,
            sampling_period: float,
        ) -> None: ...

    @cached_property
    def _constants(self) -> AdaptiveConstants:
        model = self.model
        return AdaptiveConstants(
            for_loop(model.inertia),
            model.inverse,
            self.observer_gain + model.fault_matrix @ self.proportional_gain,
            for_loop(model.input_matrix),
            for_loop(model.fault_matrix),
            for_loop(self.integral_gain),
            for_loop(self.proportional_gain),
            self.sampling_period,
        )

    def _run(
        self, rate: Array, memory: Array, count: int, record: RigidBodyRecord, rows: RigidBodyRows
    ) -> int:
        return _run(self._constants, rate, memory, record, rows)


# One kernel for each derivative: a kernel that returns both as a pair makes the loop half as fast.
@kernel
def _slope(
    c: AdaptiveConstants, estimate: Triple, integral: Triple, rate: Triple, control: Triple
) -> Triple:
    """The derivative of w^."""
    # w^' = J^-1 (-w^ x J w^ + (Lambda + B_f Kp) (w - w^) + B u + B_f z)
    a, b, d = product(
        c.injection, rate[0] - estimate[0], rate[1] - estimate[1], rate[2] - estimate[2]
    )
    p, q, r = product(c.input_matrix, control[0], control[1], control[2])
    f, g, i = product(c.fault_matrix, integral[0], integral[1], integral[2])
    return acceleration(c.inertia, c.inverse, estimate, (a + p + f, b + q + g, d + r + i))


@kernel
def _growth(c: AdaptiveConstants, estimate: Triple, rate: Triple) -> Triple:
    """The derivative of z."""
    # z' = Gamma (w - w^)
    return product(
        c.integral_gain, rate[0] - estimate[0], rate[1] - estimate[1], rate[2] - estimate[2]
    )


@kernel
def _estimate(c: AdaptiveConstants, integral: Triple, rate: Triple, estimate: Triple) -> Triple:
    """The fault estimate."""
    # f^ = z + Kp (w - w^)
    x, y, z = product(
        c.proportional_gain, rate[0] - estimate[0], rate[1] - estimate[1], rate[2] - estimate[2]
    )
    return (integral[0] + x, integral[1] + y, integral[2] + z)


@kernel
def _run(
    c: AdaptiveConstants,
    estimate: Array,
    memory: Array,
    record: RigidBodyRecord,
    rows: RigidBodyRows,
) -> int:
    """Fill ``rows``, and leave w^ and z in place."""
    h, half = c.step, 0.5 * c.step
    steps = len(rows.rate) - 1
    w = (estimate[0], estimate[1], estimate[2])
    z = (memory[0], memory[1], memory[2])
    due = FIRST
    for k in range(steps + 1):
        if k >= due:
            due = poll(k)
        start = row(record.rate, 2 * k)
        rows.rate[k, 0], rows.rate[k, 1], rows.rate[k, 2] = w
        rows.fault[k, 0], rows.fault[k, 1], rows.fault[k, 2] = _estimate(c, z, start, w)
        before = _estimate(c, z, row(record.rate_before, 2 * k), w)
        rows.fault_before[k, 0], rows.fault_before[k, 1], rows.fault_before[k, 2] = before
        if k == steps:
            break
        middle, end = row(record.rate, 2 * k + 1), row(record.rate_before, 2 * k + 2)
        control_middle = row(record.control, 2 * k + 1)
        # w^(t + h) = w^(t) + h/6 (k1 + 2 k2 + 2 k3 + k4), and z likewise by l1 to l4
        k1 = _slope(c, w, z, start, row(record.control, 2 * k))
        l1 = _growth(c, w, start)
        w2 = ahead(w, k1, half)
        k2 = _slope(c, w2, ahead(z, l1, half), middle, control_middle)
        l2 = _growth(c, w2, middle)
        w3 = ahead(w, k2, half)
        k3 = _slope(c, w3, ahead(z, l2, half), middle, control_middle)
        l3 = _growth(c, w3, middle)
        w4 = ahead(w, k3, h)
        k4 = _slope(c, w4, ahead(z, l3, h), end, row(record.control_before, 2 * k + 2))
        l4 = _growth(c, w4, end)
        after = rk4_sum(w, k1, k2, k3, k4, h)
        if not np.isfinite(after[0] + after[1] + after[2]):
            return k + 1
        w = after
        z = rk4_sum(z, l1, l2, l3, l4, h)
    for i in range(3):
        estimate[i] = w[i]
        memory[i] = z[i]
    return steps + 1
