"""The standard high-gain observer."""

from __future__ import annotations

from reobserve.codegen.expressions import Expression
from reobserve.codegen.programs.right_hand_sides import right_hand_sides
from reobserve.codegen.programs.sampling import Rows, runge_kutta
from reobserve.codegen.statements import Program
from reobserve.observers.high_gain import HighGainObserver, State


def standard(observer: HighGainObserver, state: State) -> Program:
    """x^' = Lambda x^ + f(x^) + (0, ..., 0, G(y))^T u - K (x^1 - y), for u as it arrives."""
    n = observer.model.states
    program = Program("High-gain observer", 1, 1)
    rows = Rows(program, state)
    assert rows.u_before is not None
    x = program.remember("x", state.estimate, r"\hat x")
    K = program.constant("K", observer.gain, gain=True)
    right_hand_sides(program, observer.model)
    at, out = program.local("point", (n,), "x"), program.local("slope_out", (n,), "s")
    measured, pushed = program.local("measured", (1,), "y"), program.local("pushed", (1,), "g")
    f = program.local("f", (n,))
    with program.function("slope", (at, measured, pushed), out, "F"):
        program.apply(f, "drift", at)
        for i in range(n):
            more: Expression = at[i + 1] if i + 1 < n else pushed[0]
            program.let(out[i], more + f[i] - K[i] * (at[0] - measured[0]))
    with rows.moves():
        middle = program.local("y_middle", (1,), "y_{k-1/2}")
        program.let(middle, 0.5 * rows.y_before + 0.5 * program.y)
        stages = []
        for number, y in enumerate((rows.y_before, middle, program.y), start=1):
            gain = program.local(f"gain_{number}", (1,), f"G_{number}")
            program.apply(gain, "input_gain", y)
            drive = program.local(f"pushed_{number}", (1,), f"g_{number}")
            program.let(drive[0], gain[0] * rows.u_before[0])
            stages.append((y, drive))
        start, half, end = stages
        runge_kutta(program, "slope", x, (start, half, end), observer.sampling_period)
    program.estimate("state", x)
    rows.keep()
    return program
