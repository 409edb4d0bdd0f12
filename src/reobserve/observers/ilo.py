"""Iterative learning observers of a rigid body (Chen & Saif 2007, (3)).

The ILO input v of `ILO` is updated at every instant from its value one interval earlier. The paper
also lets the updating interval tau be the sampling interval of a sampled-data system: `SampledILO`
updates v once an interval and holds it in between.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from reobserve.core.arguments import as_flag
from reobserve.core.covariances import as_positive_definite
from reobserve.core.errors import InputError
from reobserve.core.interrupts import FIRST, poll
from reobserve.core.kernel import kernel
from reobserve.core.matrices import Matrix, as_matrix, as_positive
from reobserve.core.value import converter, for_loop
from reobserve.observers.rigid_body_observer import (
    Array,
    RigidBodyObserver,
    RigidBodyRecord,
    RigidBodyRows,
    whole_steps,
)
from reobserve.synthesis.ilo_error_system import LearningLaw
from reobserve.synthesis.ilo_sampled_stability import sampled_limit_gain, sampled_stability
from reobserve.synthesis.ilo_stability import continuous_stability
from reobserve.systems.rigid_body import RigidBody
from reobserve.systems.rigid_body_arithmetic import (
    Triple,
    acceleration,
    ahead,
    product,
    rk4_sum,
    row,
)


class IloConstants(NamedTuple):
    """Constants of the loop, where ``injection`` multiplies w - w^: Lambda and part of B_f v."""

    inertia: Matrix
    inverse: Matrix
    injection: Matrix
    input_matrix: Matrix
    fault_matrix: Matrix
    K1: Matrix
    K2: Matrix
    step: float


@dataclass(frozen=True, eq=False, repr=False)
class LearningObserver(RigidBodyObserver):
    """An observer whose estimate of the fault torque learns from its value one interval earlier.

    Its parameters are those of `ILO`.
    """

    K1: Matrix = field(kw_only=True, metadata=converter(as_matrix, 3))
    K2: Matrix = field(kw_only=True, metadata=converter(as_matrix, 3))
    observer_gain: Matrix = field(kw_only=True, metadata=converter(as_positive_definite, 3))
    update_interval: float = field(kw_only=True, metadata=converter(as_positive))
    allow_unstable: bool = field(default=False, kw_only=True, metadata=converter(as_flag))

    if TYPE_CHECKING:  # what it takes is wider than what it then holds

        def __init__(
            self,
            model: RigidBody,
            *,
            K1: ArrayLike,
            K2: ArrayLike,
            observer_gain: ArrayLike,
            update_interval: float,
            allow_unstable: bool = ...,
            sampling_period: float,
        ) -> None: ...

    def __post_init__(self) -> None:
        super().__post_init__()
        _ = self.delay  # refuses an interval that is no multiple of the step
        if not self.allow_unstable:
            self._check_stability()

    @abstractmethod
    def _check_stability(self) -> None:
        """Refuse gains whose linearised error dynamics grow."""

    @cached_property
    def delay(self) -> int:
        """The updating interval in steps."""
        return whole_steps(self.update_interval, self.sampling_period)

    @property
    def law(self) -> LearningLaw:
        """The learning law as the synthesis takes it, for its stability and its accuracy."""
        body, gains = self.model, (self.K1, self.K2)
        return LearningLaw(
            body.inertia, self.observer_gain, body.fault_matrix, *gains, self.update_interval
        )

    def _constants_with(self, injection: Matrix) -> IloConstants:
        model = self.model
        return IloConstants(
            for_loop(model.inertia),
            model.inverse,
            for_loop(injection),
            for_loop(model.input_matrix),
            for_loop(model.fault_matrix),
            for_loop(self.K1),
            for_loop(self.K2),
            self.sampling_period,
        )


@dataclass(frozen=True, eq=False, repr=False, init=False)
class ILO(LearningObserver):
    """Iterative learning observer with v learning at every instant: a delay system.

        J w^' = -w^ x J w^ + Lambda (w - w^) + B u + B_f v(t)
        v(t)  = K1 v(t - tau) + K2 [w(t) - w^(t)]

    Chen & Saif 2007, (3). v, the ILO input, estimates the fault torque. The method of steps is of
    order 4 in ``sampling_period``, at the jumps of v at multiples of tau, too: the values of v at
    the start, the middle and the end of each step are kept apart, and the middle comes from cubic
    Hermite interpolation of w^.

    `init` takes rate and fault; left out, a run starts from the first measurement. `run` and `step`
    take y, the rate w [rad/s], and u [N m], both of shape (k, 3). Estimates: ``rate``, w^ [rad/s],
    and ``fault``, v [N m], both (k, 3); `Run.before` has limits of ``fault`` from the left.

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
        of the step; K1 has a spectral radius above 1 or K2 destabilises, which is refused
        with the growth that it causes, or is so large that growing modes cannot be counted.

    Examples
    --------
    >>> import numpy as np
    >>> from reobserve import ILO, RigidBody
    >>> observer = ILO(RigidBody([36, 17, 26]), K1=1.0, K2=50.0, observer_gain=500.0,
    ...                update_interval=0.01, sampling_period=0.01)
    >>> rate = np.outer(0.01 * np.arange(200), [0.5 / 36, 0, 0])  # 0.5 N m about the first axis
    >>> run = observer.run(rate, np.zeros((200, 3)))
    >>> print(run["fault"][-1, 0].round(2))
    0.5
    """

    def _check_stability(self) -> None:
        verdict = continuous_stability(self.law)
        if verdict.verdict == "unstable" or verdict.unstable_roots is None:
            raise InputError("K1, K2", f"must give stable error dynamics, but {verdict.reason}")

    @cached_property
    def _constants(self) -> IloConstants:
        return self._constants_with(self.observer_gain + self.model.fault_matrix @ self.K2)

    @property
    def _memory_shape(self) -> tuple[int, ...]:
        # v at the start, the middle and the end of each step of the last interval.
        return (self.delay, 3, 3)

    def _run(
        self, rate: Array, memory: Array, count: int, record: RigidBodyRecord, rows: RigidBodyRows
    ) -> int:
        return _run_continuous(self._constants, rate, memory, count, record, rows)


@kernel
def _slope(c: IloConstants, estimate: Triple, rate: Triple, known: Triple) -> Triple:
    """The right-hand side for w^, with the torque of `_known_torque` (Chen & Saif 2007, (3))."""
    # J w^' = -w^ x J w^ + (Lambda + B_f K2) (w - w^) + B u + B_f K1 v(t - tau), or for a held v
    # J w^' = -w^ x J w^ + Lambda (w - w^) + B u + B_f v_k
    x, y, z = product(
        c.injection, rate[0] - estimate[0], rate[1] - estimate[1], rate[2] - estimate[2]
    )
    return acceleration(c.inertia, c.inverse, estimate, (known[0] + x, known[1] + y, known[2] + z))


@kernel
def _known_torque(c: IloConstants, control: Triple, learned: Triple) -> Triple:
    """The torque without what w - w^ adds (Chen & Saif 2007, (3))."""
    # B u + B_f K1 v(t - tau), or B u + B_f v_k for a held v
    x, y, z = product(c.input_matrix, control[0], control[1], control[2])
    f, g, h = product(c.fault_matrix, learned[0], learned[1], learned[2])
    return (x + f, y + g, z + h)


@kernel
def _learn(c: IloConstants, learned: Triple, rate: Triple, estimate: Triple) -> Triple:
    """The law by which v learns (Chen & Saif 2007, (3))."""
    # v(t) = K1 v(t - tau) + K2 (w(t) - w^(t))
    x, y, z = product(c.K2, rate[0] - estimate[0], rate[1] - estimate[1], rate[2] - estimate[2])
    return (learned[0] + x, learned[1] + y, learned[2] + z)


@kernel
def _run_continuous(
    c: IloConstants,
    estimate: Array,
    history: Array,
    count: int,
    record: RigidBodyRecord,
    rows: RigidBodyRows,
) -> int:
    """Fill ``rows``, and leave w^ and v of the last interval in place (Chen & Saif 2007, (3))."""
    h, half = c.step, 0.5 * c.step
    steps = len(rows.rate) - 1
    w = (estimate[0], estimate[1], estimate[2])
    slot = count % len(history)
    due = FIRST
    for k in range(steps):
        if k >= due:
            due = poll(k)
        past = history[slot]
        start, middle, end = (
            row(record.rate, 2 * k),
            row(record.rate, 2 * k + 1),
            row(record.rate_before, 2 * k + 2),
        )
        # K1 v(t - tau), and B u + B_f K1 v(t - tau): at the start, the middle and the end
        learned_start = product(c.K1, past[0, 0], past[0, 1], past[0, 2])
        learned_middle = product(c.K1, past[1, 0], past[1, 1], past[1, 2])
        learned_end = product(c.K1, past[2, 0], past[2, 1], past[2, 2])
        known_start = _known_torque(c, row(record.control, 2 * k), learned_start)
        known_middle = _known_torque(c, row(record.control, 2 * k + 1), learned_middle)
        known_end = _known_torque(c, row(record.control_before, 2 * k + 2), learned_end)

        # w^(t + h) = w^(t) + h/6 (k1 + 2 k2 + 2 k3 + k4)
        k1 = _slope(c, w, start, known_start)
        k2 = _slope(c, ahead(w, k1, half), middle, known_middle)
        k3 = _slope(c, ahead(w, k2, half), middle, known_middle)
        k4 = _slope(c, ahead(w, k3, h), end, known_end)
        after = rk4_sum(w, k1, k2, k3, k4, h)

        # Cubic Hermite interpolation of w^ inside the step keeps the delayed v of order 4.
        # w^(t + h/2) = (w^(t) + w^(t + h)) / 2 + h/8 (w^'(t) - w^'(t + h))
        last = _slope(c, after, end, known_end)
        between = (
            0.5 * (w[0] + after[0]) + 0.125 * h * (k1[0] - last[0]),
            0.5 * (w[1] + after[1]) + 0.125 * h * (k1[1] - last[1]),
            0.5 * (w[2] + after[2]) + 0.125 * h * (k1[2] - last[2]),
        )
        # v(t) = K1 v(t - tau) + K2 (w(t) - w^(t)), in place of v(t - tau)
        past[0, 0], past[0, 1], past[0, 2] = _learn(c, learned_start, start, w)
        past[1, 0], past[1, 1], past[1, 2] = _learn(c, learned_middle, middle, between)
        past[2, 0], past[2, 1], past[2, 2] = _learn(c, learned_end, end, after)
        for i in range(3):
            rows.rate[k, i] = w[i]
            rows.fault[k, i] = past[0, i]
            rows.fault_before[k + 1, i] = past[2, i]
        if not np.isfinite(after[0] + after[1] + after[2]):
            return k + 1
        w = after
        slot = slot + 1 if slot + 1 < len(history) else 0
    estimate[0], estimate[1], estimate[2] = w
    past = history[slot]
    learned = product(c.K1, past[0, 0], past[0, 1], past[0, 2])
    rows.fault[steps, 0], rows.fault[steps, 1], rows.fault[steps, 2] = _learn(
        c, learned, row(record.rate, 2 * steps), w
    )
    rows.rate[steps, 0], rows.rate[steps, 1], rows.rate[steps, 2] = w
    return steps + 1


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
        return _run_sampled(self._constants, self.delay, rate, memory, count, record, rows)


@kernel
def _run_sampled(
    c: IloConstants,
    delay: int,
    estimate: Array,
    held: Array,
    count: int,
    record: RigidBodyRecord,
    rows: RigidBodyRows,
) -> int:
    """Fill ``rows``, and leave w^ and the v in force in place (Chen & Saif 2007, (3))."""
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
            v = _learn(c, product(c.K1, v[0], v[1], v[2]), start, w)
        phase = phase + 1 if phase + 1 < delay else 0
        # w^(t + h) = w^(t) + h/6 (k1 + 2 k2 + 2 k3 + k4), with B u + B_f v_k known
        known_middle = _known_torque(c, row(record.control, 2 * k + 1), v)
        k1 = _slope(c, w, start, _known_torque(c, row(record.control, 2 * k), v))
        k2 = _slope(c, ahead(w, k1, half), middle, known_middle)
        k3 = _slope(c, ahead(w, k2, half), middle, known_middle)
        k4 = _slope(
            c, ahead(w, k3, h), end, _known_torque(c, row(record.control_before, 2 * k + 2), v)
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
        v = _learn(c, product(c.K1, v[0], v[1], v[2]), row(record.rate, 2 * steps), w)
    for i in range(3):
        rows.rate[steps, i] = w[i]
        rows.fault[steps, i] = v[i]
    return steps + 1
