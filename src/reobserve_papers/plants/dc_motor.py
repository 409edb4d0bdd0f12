"""DC motor under speed control, with faults (Indriawati, Agustinah & Jazidie, Section IV, motor).

    x' = A x + B (u + fa) + Dd d,    y = x + Dw w + Fs fs,    x = [speed, current]
    u = -Kc x + Ki v,    v' = y1 - r

or u = -Kc y + Ki v, which acts on what is measured, faults and noise included. With v' = y1 - r, as
printed, Ki must be negative. The paper prints A with +Ke/L in its second row: a back electromotive
force that drives the current.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_flag, as_function, as_kind, as_poles
from reobserve.core.discretisation import interpolating_hold
from reobserve.core.errors import DivergenceError, InputError
from reobserve.core.kernel import kernel
from reobserve.core.matrices import as_floats, as_positive, as_rows, as_scalar, as_vector
from reobserve.synthesis.linear_gain import ackermann

Array = NDArray[np.float64]

# Called like a `reobserve_papers.signals.inputs.Signal`: with increasing times [s], and ``before``
# for limits.
VectorSignal = Callable[..., Array]


@dataclass(frozen=True)
class DCMotor:
    """The linear model of a motor, from its physical constants.

    Indriawati, Agustinah & Jazidie, Section IV, motor.

    Parameters
    ----------
    inertia, friction
        J [kg m^2] and b [N m s] of the rotor.
    torque_constant, emf_constant
        Kt [N m/A] and Ke [V s/rad].
    resistance, inductance
        R [Ohm] and L [H].
    printed
        Take Ke/L with the sign that the paper prints.
    """

    inertia: float
    friction: float
    torque_constant: float
    emf_constant: float
    resistance: float
    inductance: float
    printed: bool = False

    def __post_init__(self) -> None:
        for name in [each.name for each in fields(self)][:-1]:
            object.__setattr__(self, name, as_positive(name, getattr(self, name)))
        object.__setattr__(self, "printed", as_flag("printed", self.printed))

    @property
    def A(self) -> Array:
        """The matrix A of x' = A x + B u, x = [speed [rad/s], current [A]], shape (2, 2)."""
        emf = self.emf_constant if self.printed else -self.emf_constant
        speed = np.array([-self.friction, self.torque_constant]) / self.inertia
        return np.vstack([speed, np.array([emf, -self.resistance]) / self.inductance])

    @property
    def B(self) -> Array:
        """The matrix B of the voltage, shape (2, 1)."""
        return np.array([[0.0], [1.0 / self.inductance]])


@dataclass(frozen=True, eq=False)
class SpeedControl:
    """The law u = -Kc x + Ki v, or -Kc y + Ki v, with v' = y1 - r.

    Indriawati, Agustinah & Jazidie, Section IV, control.

    Parameters
    ----------
    feedback
        Kc, of speed [V s/rad] and current [V/A], shape (2,).
    integral
        Ki [V/rad].
    """

    feedback: Array
    integral: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "feedback", as_vector("feedback", self.feedback, 2))
        object.__setattr__(self, "integral", as_scalar("integral", self.integral))

    @classmethod
    def placed(
        cls, motor: DCMotor, poles: Sequence[complex] | NDArray[np.complex128]
    ) -> SpeedControl:
        """The law that gives the loop three poles [1/s], by Ackermann's formula."""
        as_kind("motor", motor, DCMotor)
        chosen = as_poles("poles", poles)
        if chosen.shape != (3,) or not chosen.real.max() < 0 or np.any(np.poly(chosen).imag):
            raise InputError("poles", f"{chosen.tolist()} must be 3, stable, complex ones in pairs")
        A, B = np.zeros((3, 3)), np.vstack([motor.B, [[0.0]]])
        A[:2, :2], A[2, 0] = motor.A, 1.0
        gains = ackermann(A, B, chosen)[0]
        return cls(gains[:2], -gains[2])


class Limits(NamedTuple):
    """y (k, 2), u (k, 1), fa (k, 1) and fs (k, q), from one side."""

    output: Array
    control: Array
    actuator_fault: Array
    sensor_fault: Array


@dataclass(frozen=True, eq=False)
class MotorRun:
    """Motion of a simulated motor, at multiples of the step.

    ``state`` x (k, 2) does not jump; for what does there are limits from the left, ``before``, and
    from the right, ``after``. In the first row they are the same.
    """

    state: Array
    before: Limits
    after: Limits


@dataclass(frozen=True, eq=False)
class ControlledMotor:
    """A motor in its speed control, with what disturbs it.

    Parameters
    ----------
    motor, control
        The plant and the law.
    Dd
        How disturbances enter the dynamics, shape (2, kd).
    Dw, Fs
        How noise and sensor faults enter the output, shapes (2, kw) and (2, q).
    state_feedback
        Whether the law takes x for Kc and not y.
    """

    motor: DCMotor
    control: SpeedControl
    Dd: Array
    Dw: Array
    Fs: Array
    state_feedback: bool = False

    def __post_init__(self) -> None:
        as_kind("motor", self.motor, DCMotor)
        as_kind("control", self.control, SpeedControl)
        for name in ("Dd", "Dw", "Fs"):
            matrix = as_floats(name, getattr(self, name))
            if matrix.ndim != 2 or len(matrix) != 2:
                raise InputError(name, f"has shape {matrix.shape}, must have 2 rows")
            object.__setattr__(self, name, matrix)
        as_flag("state_feedback", self.state_feedback)

    def simulate(
        self,
        reference: VectorSignal,
        actuator_fault: VectorSignal,
        sensor_fault: VectorSignal,
        disturbance: ArrayLike,
        noise: ArrayLike,
        step: float,
        initial_state: ArrayLike = (0.0, 0.0),
    ) -> MotorRun:
        """The loop from ``initial_state`` and v = 0, by exact sampling.

        Disturbance and noise are held over each step. Reference and faults are parabolas through
        their values at both ends, from inside, and in the middle of each step: what jumps on the
        grid or is a polynomial up to order 2 in between costs no accuracy, and the error for
        other smooth ones falls with the fourth power of the step.

        Parameters
        ----------
        reference, actuator_fault, sensor_fault
            r [rad/s], fa [V] and fs, of 1, 1 and q axes. They must not jump inside a step.
        disturbance, noise
            d, shape (steps, kd), and w, shape (steps, kw): a row a step.
        step, initial_state
            [s], and x(0), two numbers.
        """
        as_function("reference", reference)
        as_function("actuator_fault", actuator_fault)
        as_function("sensor_fault", sensor_fault)
        d, w = as_rows("disturbance", disturbance), as_rows("noise", noise)
        steps = len(d)
        for name, rows, matrix in (("disturbance", d, self.Dd), ("noise", w, self.Dw)):
            if rows.shape != (wanted := (max(steps, 1), matrix.shape[1])):
                raise InputError(name, f"has shape {rows.shape}, must be {wanted}: a row a step")
        time = np.arange(steps + 1, dtype=np.float64) * as_positive("step", step)

        def driven(instants: Array, before: bool) -> Array:
            parts = (actuator_fault, sensor_fault, reference)
            return np.hstack([part(instants, before=before) for part in parts])

        right, left = driven(time, False), driven(time, True)
        left[0] = right[0]
        if (axes := right.shape[1] - 2) != (q := self.Fs.shape[1]):
            raise InputError("sensor_fault", f"has {axes} axes, must have {q} as Fs has columns")
        loop, held, varying = self._loop
        transition, (effect,) = interpolating_hold(loop, held, step, (0.0,))
        forcing = np.hstack([d, w]) @ effect.T
        _, effects = interpolating_hold(loop, varying, step, (0.0, 0.5, 1.0))
        middle = driven(time[:-1] + 0.5 * step, False)
        for values, effect in zip((right[:-1], middle, left[1:]), effects, strict=True):
            forcing += values @ effect.T
        states = np.zeros((steps + 1, 3))
        states[0, :2] = as_vector("initial_state", initial_state, 2)
        finite = _run(transition, forcing, states)
        if finite <= steps:
            raise DivergenceError("motor", (finite - 1) * step)
        return MotorRun(
            states[:, :2],
            self._signals(states, np.vstack([w[:1], w]), left[:, :-1]),
            self._signals(states, np.vstack([w, w[-1:]]), right[:, :-1]),
        )

    @property
    def _loop(self) -> tuple[Array, Array, Array]:
        """The matrix of the loop of [x, v], and how [d, w] and [fa, fs, r] enter."""
        A, B, Kc = self.motor.A, self.motor.B, self.control.feedback[None]
        kd, kw, q = (matrix.shape[1] for matrix in (self.Dd, self.Dw, self.Fs))
        loop, held, varying = np.zeros((3, 3)), np.zeros((3, kd + kw)), np.zeros((3, q + 2))
        loop[:2], loop[2, 0] = np.hstack([A - B @ Kc, B * self.control.integral]), 1.0
        measured = np.zeros((2, 2)) if self.state_feedback else -B @ Kc  # of y - x
        held[:2], held[2, kd:] = np.hstack([self.Dd, measured @ self.Dw]), self.Dw[0]
        varying[:2, :-1], varying[2, 1:] = np.hstack([B, measured @ self.Fs]), [*self.Fs[0], -1.0]
        return loop, held, varying

    def _signals(self, states: Array, noise: Array, faults: Array) -> Limits:
        """The signals that follow from [x, v], w and [fa, fs]."""
        output = states[:, :2] + noise @ self.Dw.T + faults[:, 1:] @ self.Fs.T
        fed = states[:, :2] if self.state_feedback else output
        control = self.control.integral * states[:, 2:] - fed @ self.control.feedback[:, None]
        return Limits(output, control, faults[:, :1], faults[:, 1:])


@kernel
def _run(transition: Array, forcing: Array, states: Array) -> int:
    """Fill ``states`` from the first row on, and return the number of finite rows."""
    for k in range(len(forcing)):
        # z(k+1) = Phi z(k) + forcing(k),   z = [x, v]
        total = 0.0
        for i in range(3):
            states[k + 1, i] = forcing[k, i]
            for j in range(3):
                states[k + 1, i] += transition[i, j] * states[k, j]
            total += states[k + 1, i]
        if not np.isfinite(total):
            return k + 1
    return len(states)
