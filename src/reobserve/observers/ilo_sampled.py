"""Iterative learning observer of a rigid body, sampled and held (Chen & Saif 2007, (3)).

The paper lets the updating interval tau be the sampling interval of a sampled-data system.
Then v is updated once an interval,

    v_k = K1 v_(k-1) + K2 [w(k tau) - w^(k tau)],

and held in between, while w^ follows the first line of (3).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from reobserve.core.errors import InputError
from reobserve.core.interrupts import FIRST, poll
from reobserve.core.kernel import kernel
from reobserve.observers.ilo import IloConstants, LearningObserver, known_torque, learn, slope
from reobserve.observers.rigid_body_observer import Array, RigidBodyRecord, RigidBodyRows
from reobserve.synthesis.ilo_sampled_stability import sampled_limit_gain, sampled_stability
from reobserve.systems.rigid_body_arithmetic import ahead, product, rk4_sum, row


@dataclass(frozen=True, eq=False, repr=False, init=False)
class SampledILO(LearningObserver):
    """Iterative learning observer with v updated at multiples of tau and held in between.

        J w^' = -w^ x J w^ + Lambda (w - w^) + B u + B_f v_k,    k tau <= t < (k + 1) tau
        v_k = K1 v_(k-1) + K2 [w(k tau) - w^(k tau)]

    Chen & Saif 2007, (3). `init` takes rate and fault; left out, a run starts from the first
    measurement. `run` and `step` take y, the rate w [rad/s], and u [N m], both of shape (k, 3).
    Estimates: ``rate``, w^ [rad/s], and ``fault``, v [N m], both (k, 3); `Run.before` has limits of
    ``fault`` from the left, which differ at updates.

    Parameters
    ----------
    model
        The observer's model of the rigid body.
    K1, K2
        Learning gains [1] and [N m s/rad]: a number (times the identity), a diagonal or 3 x 3.
    observer_gain
        Lambda [N m s/rad], likewise; symmetric positive definite.
    update_interval
        tau [s], the updating interval, a multiple of ``sampling_period``.
    allow_unstable
        Accept gains whose linearised error dynamics grow: to study divergence.
    sampling_period
        [s], and the step of the method.

    Raises
    ------
    InputError
        If a shape is wrong, Lambda is not positive definite, tau is not positive or no multiple
        of the step; v and w - w^ grow from one update to the next, which is refused with
        the largest K2 for which they do not.

    Examples
    --------
    >>> import numpy as np
    >>> from reobserve import RigidBody, SampledILO
    >>> observer = SampledILO(RigidBody([36, 17, 26]), K1=1.0, K2=500.0, observer_gain=500.0,
    ...                       update_interval=0.01, sampling_period=0.01)
    >>> rate = np.outer(0.01 * np.arange(200), [0.5 / 36, 0, 0])  # 0.5 N m about the first axis
    >>> run = observer.run(rate, np.zeros((200, 3)))
    >>> print(run["fault"][-1, 0].round(2))
    0.5
    """

    def _check_stability(self) -> None:
        verdict = sampled_stability(self.law)
        if verdict.verdict == "unstable":
            raise InputError(
                "K1, K2",
                f"must give stable error dynamics, but {verdict.reason}; "
                f"the limit is {sampled_limit_gain(self.law):.6g} times this K2",
            )

    @cached_property
    def _constants(self) -> IloConstants:
        return self._constants_with(self.observer_gain)

    def _run(
        self, rate: Array, memory: Array, count: int, record: RigidBodyRecord, rows: RigidBodyRows
    ) -> int:
        return _run(self._constants, self.delay, rate, memory, count, record, rows)


@kernel
def _run(
    c: IloConstants,
    delay: int,
    estimate: Array,
    held: Array,
    count: int,
    record: RigidBodyRecord,
    rows: RigidBodyRows,
) -> int:
    """Fill ``rows``, and leave w^ and the v in force in place."""
    h, half = c.step, 0.5 * c.step
    steps = len(rows.rate) - 1
    w = (estimate[0], estimate[1], estimate[2])
    v = (held[0], held[1], held[2])
    phase = count % delay
    due = FIRST
    for k in range(steps):
        if k >= due:
            due = poll(k)
        start, middle, end = (
            row(record.rate, 2 * k),
            row(record.rate, 2 * k + 1),
            row(record.rate_before, 2 * k + 2),
        )
        # v_k = K1 v_(k-1) + K2 (w(k tau) - w^(k tau))
        if phase == 0:
            v = learn(c, product(c.K1, v[0], v[1], v[2]), start, w)
        phase = phase + 1 if phase + 1 < delay else 0
        # w^(t + h) = w^(t) + h/6 (k1 + 2 k2 + 2 k3 + k4), with B u + B_f v_k known
        known_middle = known_torque(c, row(record.control, 2 * k + 1), v)
        k1 = slope(c, w, start, known_torque(c, row(record.control, 2 * k), v))
        k2 = slope(c, ahead(w, k1, half), middle, known_middle)
        k3 = slope(c, ahead(w, k2, half), middle, known_middle)
        k4 = slope(
            c, ahead(w, k3, h), end, known_torque(c, row(record.control_before, 2 * k + 2), v)
        )
        after = rk4_sum(w, k1, k2, k3, k4, h)
        for i in range(3):
            rows.rate[k, i] = w[i]
            rows.fault[k, i] = v[i]
            rows.fault_before[k + 1, i] = v[i]
        if not np.isfinite(after[0] + after[1] + after[2]):
            return k + 1
        w = after
    for i in range(3):
        estimate[i] = w[i]
        held[i] = v[i]
    # An update due at the very end shows in the last row; the next run takes it into force.
    if phase == 0:
        v = learn(c, product(c.K1, v[0], v[1], v[2]), row(record.rate, 2 * steps), w)
    for i in range(3):
        rows.rate[steps, i] = w[i]
        rows.fault[steps, i] = v[i]
    return steps + 1
