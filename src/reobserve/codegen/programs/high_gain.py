"""The standard high-gain observer."""

from __future__ import annotations

from reobserve.codegen.expressions import Expression
from reobserve.codegen.program import Program
from reobserve.codegen.programs.right_hand_sides import right_hand_sides
from reobserve.codegen.programs.sampling import RowBuffer, runge_kutta
from reobserve.observers.high_gain import HighGainObserver, HighGainState


def standard(observer: HighGainObserver, state: HighGainState) -> Program:
    """x^' = Lambda x^ + f(x^) + (0, ..., 0, G(y))^T u - K (x^1 - y), for u as it arrives."""
    n = observer.model.states
    program = Program("High-gain observer", 1, 1)
    rows = RowBuffer(program, state)
    assert rows.u_before is not None
    x = program.remember("x", state.estimate)
    K = program.constant("K", observer.gain)
    h = program.constant("h", observer.sampling_period)
    right_hand_sides(program, observer.model)
    at, out = program.local("point", (n,)), program.local("slope_out", (n,))
    measured, pushed = program.local("measured", (1,)), program.local("pushed", (1,))
    f = program.local("f", (n,))
    with program.function("slope", (at, measured, pushed), out):
        program.apply(f, "drift", at)
        for i in range(n):
            more: Expression = at[i + 1] if i + 1 < n else pushed[0]
            program.let(out[i], more + f[i] - K[i] * (at[0] - measured[0]))
    with rows.moves():
        stages = []
        for number, y in enumerate((rows.y_before, rows.y_middle(), program.y), start=1):
            gain = program.apply(program.local(f"gain_{number}", (1,)), "input_gain", y)
            drive = program.local(f"pushed_{number}", (1,))
            program.let(drive[0], gain[0] * rows.u_before[0])
            stages.append((y, drive))
        runge_kutta(program, "slope", x, stages, h)
    program.estimate("state", x)
    rows.keep()
    return program
