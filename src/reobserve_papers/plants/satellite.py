"""Rigid satellite with thrusters that can fail (Chen & Saif 2007, (1) and (2))."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from reobserve.core.arguments import MOST_STEPS, as_kind, as_whole
from reobserve.core.errors import DivergenceError, InputError
from reobserve.core.kernel import kernel
from reobserve.core.matrices import Matrix, as_positive, as_vector
from reobserve.core.value import for_loop
from reobserve.systems.rigid_body import RigidBody
from reobserve.systems.rigid_body_arithmetic import acceleration, ahead, rk4_sum, row
from reobserve_papers.signals.inputs import Array, Signal


class Satellite(RigidBody):
    """A rigid body under a control torque u and a fault torque u_f, both signals in N m.

    Chen & Saif 2007, (2).
    """

    def simulate(
        self, initial_rate: ArrayLike, control: Signal, fault: Signal, step: float, steps: int
    ) -> Matrix:
        """Angular rate w [rad/s], shape (steps + 1, 3), at multiples of ``step`` [s].

        Classical Runge-Kutta of order 4. The torque is taken in closed form at both ends
        and the middle of each step, at the ends from inside the step, so that a jump on
        the grid costs no accuracy.

        Raises
        ------
        InputError
            If ``initial_rate`` is not three numbers or ``step`` is not positive.
        DivergenceError
            If the rate leaves the range of floating-point numbers.
        """
        start = as_vector("initial_rate", initial_rate, 3)
        step = as_positive("step", step)
        steps = as_whole("steps", steps, 1, MOST_STEPS)
        for name, signal in (("control", control), ("fault", fault)):
            if as_kind(name, signal, Signal).axes != 3:
                raise InputError(name, f"has {signal.axes} axes, must have 3")
        index = np.arange(steps, dtype=np.float64)

        def torque(time: Array, *, before: bool = False) -> Array:
            return (
                control(time, before=before) @ self.input_matrix.T
                + fault(time, before=before) @ self.fault_matrix.T
            )

        rate = np.empty((steps + 1, 3))
        rate[0] = start
        finite = _simulate(
            for_loop(self.inertia),
            self.inverse,
            torque(index * step),
            torque((index + 0.5) * step),
            torque((index + 1.0) * step, before=True),
            step,
            rate,
        )
        if finite < steps:
            raise DivergenceError("satellite", finite * step)
        return rate


@kernel
def _simulate(
    inertia: Matrix,
    inverse: Matrix,
    torque_start: Matrix,
    torque_middle: Matrix,
    torque_end: Matrix,
    step: float,
    rate: Matrix,
) -> int:
    """Fill ``rate`` from its first row, and return the last index with a finite rate."""
    w = row(rate, 0)
    half = 0.5 * step
    for k in range(len(rate) - 1):
        start, middle, end = row(torque_start, k), row(torque_middle, k), row(torque_end, k)
        # J w' = -w x J w + torque,   w(t + h) = w(t) + h/6 (k1 + 2 k2 + 2 k3 + k4)
        k1 = acceleration(inertia, inverse, w, start)
        k2 = acceleration(inertia, inverse, ahead(w, k1, half), middle)
        k3 = acceleration(inertia, inverse, ahead(w, k2, half), middle)
        k4 = acceleration(inertia, inverse, ahead(w, k3, step), end)
        w = rk4_sum(w, k1, k2, k3, k4, step)
        if not np.isfinite(w[0] + w[1] + w[2]):
            return k
        rate[k + 1, 0], rate[k + 1, 1], rate[k + 1, 2] = w
    return len(rate) - 1
