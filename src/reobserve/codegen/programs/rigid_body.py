"""Observers of a rigid body: learning, sampled and continuous, and adaptive."""

from __future__ import annotations

import numpy as np

from reobserve.codegen.expressions import Expression, Name
from reobserve.codegen.programs.sampling import Rows, runge_kutta
from reobserve.codegen.statements import Program
from reobserve.observers.adaptive import AdaptiveObserver
from reobserve.observers.ilo import ILO
from reobserve.observers.ilo_sampled import SampledILO
from reobserve.observers.rigid_body_observer import RigidBodyObserver, State

_VECTOR = (3,)


class _Body:
    """What the three have in common: rates, inertia, the first row, the slope of w^."""

    def __init__(self, title: str, observer: RigidBodyObserver, state: State | None) -> None:
        self.program = program = Program(title, 3, 3)
        self.observer, self.state = observer, state
        begun = observer.init(np.zeros(3)) if state is None else state
        self.memory = begun.memory
        self.rows = Rows(program, begun)
        self.w = program.remember("w", begun.rate, r"\hat w")
        body = observer.model
        self.J = program.constant("J", body.inertia)
        self.J_inverse = program.constant("J_inverse", body.inverse, "J^{-1}")
        self.B = program.constant("B", body.input_matrix)
        self.B_f = program.constant("B_f", body.fault_matrix)
        if state is None:  # it starts from what it measures first
            with program.hidden(), program.when("started == 0"):
                program.let(self.w, program.y)

    def slope(self, injection: Name) -> None:
        """w^' for the rate that is measured and the torque that is known."""
        program = self.program
        x, rate = program.local("rate", _VECTOR, r"\hat w"), program.local("measured", _VECTOR, "w")
        known = program.local("torque", _VECTOR, "d")
        out = program.local("slope_out", _VECTOR, "s")
        with program.function("slope", (x, rate, known), out, "f"):
            h = program.let(program.local("momentum", _VECTOR, "p"), self.J @ x)
            t = program.let(program.local("drive", _VECTOR, "t"), known + injection @ (rate - x))
            for i in range(3):  # t - w x J w
                j, k = (i + 1) % 3, (i + 2) % 3
                program.let(t[i], t[i] - (x[j] * h[k] - x[k] * h[j]))
            program.let(out, self.J_inverse @ t)

    def learn(self, K1: Name, K2: Name, past: Name, measured: Expression, rate: Name) -> Expression:
        """K1 v + K2 (w - w^)."""
        return K1 @ past + K2 @ (measured - rate)

    def middle(self) -> Name:
        """The measurement half-way."""
        p = self.program
        return p.let(
            p.local("y_middle", _VECTOR, "y_{k-1/2}"), 0.5 * self.rows.y_before + 0.5 * p.y
        )

    @property
    def held(self) -> Expression:
        """B u of the row before."""
        assert self.rows.u_before is not None
        return self.B @ self.rows.u_before


def _gains(program: Program, observer: ILO | SampledILO) -> tuple[Name, Name]:
    return (
        program.constant("K1", observer.K1, "K_1", gain=True),
        program.constant("K2", observer.K2, "K_2", gain=True),
    )


def sampled(observer: SampledILO, state: State | None) -> Program:
    """v updated once an interval and held."""
    body = _Body("Iterative learning observer, sampled", observer, state)
    program, w = body.program, body.w
    K1, K2 = _gains(program, observer)
    damping = program.constant("Damping", observer.damping, r"\Lambda", gain=True)
    body.slope(damping)
    v = program.remember("v", body.memory, "v")
    phase = program.counter("phase", (0 if state is None else state.count) % observer.delay)
    with body.rows.moves():
        with program.when("phase == 0", r"k - 1 \text{ a multiple of } \tau"):
            program.let(v, body.learn(K1, K2, v, body.rows.y_before, w))
        with program.hidden():
            program.advance(phase, observer.delay)
        known = program.let(program.local("known", _VECTOR, "d"), body.held + body.B_f @ v)
        middle = body.middle()
        stages = ((body.rows.y_before, known), (middle, known), (program.y, known))
        runge_kutta(program, "slope", w, stages, observer.sampling_period, r"\hat w")
    told = program.local("fault", _VECTOR, "v")
    with program.hidden():
        program.let(told, v)
        with program.when("phase == 0"):
            program.let(told, body.learn(K1, K2, v, program.y, w))
    program.estimate("rate", w)
    program.estimate("fault", told)
    body.rows.keep()
    return program


def continuous(observer: ILO, state: State | None) -> Program:
    """v learning at every instant: its values over the last interval are remembered."""
    body = _Body("Iterative learning observer, continuous", observer, state)
    program, w = body.program, body.w
    K1, K2 = _gains(program, observer)
    # Lambda, and what of B_f v multiplies w - w^.
    injection = observer.damping + observer.model.fault_matrix @ observer.K2
    body.slope(program.constant("Injection", injection, r"(\Lambda + B_f K_2)", gain=True))
    past = program.remember("past", body.memory, "v")
    slot = program.counter("slot", (0 if state is None else state.count) % observer.delay)
    learned = [program.local(f"learned_{i}", _VECTOR, rf"K_1 v_{{{s}}}") for i, s in _STAGES]
    with body.rows.moves():
        known = []
        for place, (i, s) in enumerate(_STAGES):
            program.let(learned[place], K1 @ past["slot", place])
            each = program.local(f"known_{i}", _VECTOR, f"d_{{{s}}}")
            known.append(program.let(each, body.held + body.B_f @ learned[place]))
        middle = body.middle()
        first = program.let(program.local("w_before", _VECTOR, r"\hat w_{k-1}"), w)
        measured = (body.rows.y_before, middle, program.y)
        stages = tuple((y, d) for y, d in zip(measured, known, strict=True))
        assert len(stages) == 3
        runge_kutta(program, "slope", w, stages, observer.sampling_period, r"\hat w")
        last = program.local("slope_end", _VECTOR, "s_e")
        program.apply(last, "slope", w, program.y, known[2])
        between = program.local("between", _VECTOR, r"\hat w_{k-1/2}")
        s_1, h = Name("slope_1", _VECTOR), Name("h")
        program.let(between, 0.5 * (first + w) + 0.125 * h * (s_1 - last))
        for place, rate in enumerate((first, between, w)):
            value = learned[place] + K2 @ (measured[place] - rate)
            program.let(past["slot", place], value)
        with program.hidden():
            program.advance(slot, observer.delay)
        program.notes.append(
            f"$v_{{\\mathit{{slot}},i}}$ are kept for the last {observer.delay} periods in a ring"
        )
    program.estimate("rate", w)
    program.estimate("fault", K1 @ past["slot", 0] + K2 @ (program.y - w))
    body.rows.keep()
    return program


_STAGES = ((1, "k-1"), (2, "k-1/2"), (3, "k"))


def adaptive(observer: AdaptiveObserver, state: State | None) -> Program:
    """A fault estimate by an integrator, with or without a proportional part."""
    body = _Body("Adaptive observer", observer, state)
    program, w, y = body.program, body.w, body.program.y
    Gamma = program.constant("Gamma", observer.integral_gain, r"\Gamma", gain=True)
    Kp = program.constant("Kp", observer.proportional_gain, "K_p", gain=True)
    injection = observer.damping + observer.model.fault_matrix @ observer.proportional_gain
    body.slope(program.constant("Injection", injection, r"(\Lambda + B_f K_p)", gain=True))
    z = program.remember("z", body.memory, "z")
    h = program.constant("h", observer.sampling_period)
    with body.rows.moves():
        middle = body.middle()
        measured = (body.rows.y_before, middle, middle, y)
        slopes: list[Name] = []
        growths: list[Name] = []
        ahead, fault = w, z
        for stage, factor in enumerate((0.0, 0.5, 0.5, 1.0)):
            number = stage + 1
            if stage:
                size = h if factor == 1.0 else factor * h
                ahead = program.local(f"w_{number}", _VECTOR, rf"\hat w_{{({number})}}")
                program.let(ahead, w + size * slopes[-1])
                fault = program.local(f"z_{number}", _VECTOR, f"z_{{({number})}}")
                program.let(fault, z + size * growths[-1])
            known = program.local(f"known_{number}", _VECTOR, f"d_{number}")
            program.let(known, body.held + body.B_f @ fault)
            slope = program.local(f"slope_{number}", _VECTOR, f"s_{number}")
            slopes.append(program.apply(slope, "slope", ahead, measured[stage], known))
            growth = program.local(f"growth_{number}", _VECTOR, f"g_{number}")
            growths.append(program.let(growth, Gamma @ (measured[stage] - ahead)))
        for x, (a, b, c, d) in ((w, slopes), (z, growths)):
            program.let(x, x + h / 6.0 * (a + 2.0 * b + 2.0 * c + d))
    program.estimate("rate", w)
    program.estimate("fault", z + Kp @ (y - w))
    body.rows.keep()
    return program
