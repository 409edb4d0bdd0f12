"""Observers of a rigid body: learning, sampled and continuous, and adaptive."""

from __future__ import annotations

import numpy as np

from reobserve.codegen.expressions import Expression, Name
from reobserve.codegen.program import Program
from reobserve.codegen.programs.sampling import RowBuffer, runge_kutta
from reobserve.observers.adaptive import AdaptiveObserver
from reobserve.observers.ilo import ILO, SampledILO
from reobserve.observers.rigid_body_observer import RigidBodyObserver, RigidBodyState

_VECTOR = (3,)


class _Body:
    """Common parts of the observers: rates, inertia, the first row, the derivative of w^."""

    def __init__(
        self,
        title: str,
        observer: RigidBodyObserver,
        state: RigidBodyState | None,
        **gains: np.ndarray,
    ) -> None:
        self.program = program = Program(title, 3, 3)
        begun = observer.init(np.zeros(3)) if state is None else state
        self.memory, self.delayed = begun.memory, 0 if state is None else state.count
        self.rows = RowBuffer(program, begun)
        self.w = program.remember("w", begun.rate)
        body = observer.model
        self.J = program.constant("J", body.inertia)
        self.J_inverse = program.constant("J_inverse", body.inverse)
        self.B = program.constant("B", body.input_matrix)
        self.B_f = program.constant("B_f", body.fault_matrix)
        self.h = program.constant("h", observer.sampling_period)
        self.gains = {name: program.constant(name, values) for name, values in gains.items()}
        if state is None:
            self.rows.start_from(self.w, program.y)
        self.slope(self.gains["Injection"])

    def slope(self, injection: Name) -> None:
        """w^' for the rate that is measured and the torque that is known."""
        program = self.program
        x, rate = program.local("rate", _VECTOR), program.local("measured", _VECTOR)
        known, out = program.local("torque", _VECTOR), program.local("slope_out", _VECTOR)
        with program.function("slope", (x, rate, known), out):
            h = program.let(program.local("momentum", _VECTOR), self.J @ x)
            t = program.let(program.local("drive", _VECTOR), known + injection @ (rate - x))
            for i in range(3):  # t - w x J w
                j, k = (i + 1) % 3, (i + 2) % 3
                program.let(t[i], t[i] - (x[j] * h[k] - x[k] * h[j]))
            program.let(out, self.J_inverse @ t)

    def learn(self, past: Name, measured: Expression) -> Expression:
        """K1 v + K2 (w - w^)."""
        return self.gains["K1"] @ past + self.gains["K2"] @ (measured - self.w)

    @property
    def held(self) -> Expression:
        """B u of the row before."""
        assert self.rows.u_before is not None
        return self.B @ self.rows.u_before


def sampled(observer: SampledILO, state: RigidBodyState | None) -> Program:
    """v updated once an interval and held."""
    body = _Body(
        "Iterative learning observer, sampled", observer, state,
        Injection=observer.observer_gain, K1=observer.K1, K2=observer.K2,
    )  # fmt: skip
    program, w = body.program, body.w
    v = program.remember("v", body.memory)
    phase = program.counter("phase", body.delayed % observer.delay)
    with body.rows.moves():
        with program.when(f"{phase} == 0"):
            program.let(v, body.learn(v, body.rows.y_before))
        program.advance(phase, observer.delay)
        known = program.let(program.local("known", _VECTOR), body.held + body.B_f @ v)
        measured = (body.rows.y_before, body.rows.y_middle(), program.y)
        runge_kutta(program, "slope", w, [(y, known) for y in measured], body.h)
    fault = program.let(program.local("fault", _VECTOR), v)
    with program.when(f"{phase} == 0"):
        program.let(fault, body.learn(v, program.y))
    program.estimate("rate", w)
    program.estimate("fault", fault)
    body.rows.keep()
    return program


def continuous(observer: ILO, state: RigidBodyState | None) -> Program:
    """v learning at every instant: its values over the last interval are kept in a ring."""
    # Lambda, and what of B_f v multiplies w - w^.
    injection = observer.observer_gain + observer.model.fault_matrix @ observer.K2
    body = _Body(
        "Iterative learning observer, continuous", observer, state,
        Injection=injection, K1=observer.K1, K2=observer.K2,
    )  # fmt: skip
    program, w, K1, K2 = body.program, body.w, body.gains["K1"], body.gains["K2"]
    past = program.remember("past", body.memory)
    slot = program.counter("slot", body.delayed % observer.delay)
    with body.rows.moves():
        learned, known = [], []
        for i in range(3):  # at the start, the middle and the end of the step
            v = program.let(program.local(f"learned_{i + 1}", _VECTOR), K1 @ past[slot, i])
            d = program.local(f"known_{i + 1}", _VECTOR)
            learned.append(v)
            known.append(program.let(d, body.held + body.B_f @ v))
        measured = (body.rows.y_before, body.rows.y_middle(), program.y)
        first = program.let(program.local("w_before", _VECTOR), w)
        runge_kutta(program, "slope", w, list(zip(measured, known, strict=True)), body.h)
        last = program.local("slope_end", _VECTOR)
        program.apply(last, "slope", w, program.y, known[2])
        between = program.local("between", _VECTOR)
        slope_1 = Name("slope_1", _VECTOR)
        program.let(between, 0.5 * (first + w) + 0.125 * body.h * (slope_1 - last))
        for i, rate in enumerate((first, between, w)):
            program.let(past[slot, i], learned[i] + K2 @ (measured[i] - rate))
        program.advance(slot, observer.delay)
    program.estimate("rate", w)
    program.estimate("fault", body.learn(past[slot, 0], program.y))
    body.rows.keep()
    return program


def adaptive(observer: AdaptiveObserver, state: RigidBodyState | None) -> Program:
    """A fault estimate by an integrator, with or without a proportional part."""
    # Lambda, and what of B_f f^ multiplies w - w^.
    injection = observer.observer_gain + observer.model.fault_matrix @ observer.proportional_gain
    body = _Body(
        "Adaptive observer", observer, state, Injection=injection,
        Gamma=observer.integral_gain, Kp=observer.proportional_gain,
    )  # fmt: skip
    program, w = body.program, body.w
    z = program.remember("z", body.memory)
    rate, fault, measured, held = (
        program.local(name, _VECTOR) for name in ("w_part", "z_part", "measured", "held")
    )
    both, out = program.local("both", (6,)), program.local("both_out", (6,))
    with program.function("slopes", (both, measured, held), out):  # of w^ and z
        _copy(program, rate, both)
        _copy(program, fault, both, start=3)
        torque = program.let(program.local("torque", _VECTOR), held + body.B_f @ fault)
        first = program.apply(program.local("first", _VECTOR), "slope", rate, measured, torque)
        second = program.local("second", _VECTOR)
        program.let(second, body.gains["Gamma"] @ (measured - rate))
        _copy(program, out, first)
        _copy(program, out, second, to=3)
    with body.rows.moves():
        program.let(held, body.held)
        stages = [(y, held) for y in (body.rows.y_before, body.rows.y_middle(), program.y)]
        _copy(program, both, w)
        _copy(program, both, z, to=3)
        runge_kutta(program, "slopes", both, stages, body.h)
        _copy(program, w, both)
        _copy(program, z, both, start=3)
    program.estimate("rate", w)
    program.estimate("fault", z + body.gains["Kp"] @ (program.y - w))
    body.rows.keep()
    return program


def _copy(program: Program, target: Name, source: Name, to: int = 0, start: int = 0) -> None:
    """Three entries of a vector to places of another."""
    for i in range(3):
        program.let(target[to + i], source[start + i])
