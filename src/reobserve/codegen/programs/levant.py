"""The robust exact differentiator."""

from __future__ import annotations

from reobserve.codegen.expressions import Expression, call
from reobserve.codegen.program import ONE, ZERO, Program
from reobserve.codegen.programs.sampling import Rows
from reobserve.observers.levant import LevantDifferentiator, State


def differentiator(observer: LevantDifferentiator, state: State | None) -> Program:
    """Its homogeneous discretisation."""
    program = Program("Robust exact differentiator", 1, 0)
    begun = observer.init([0.0] * (observer.order + 1)) if state is None else state
    rows, law, lines = Rows(program, begun), observer._law, observer.order + 1
    z = program.remember("z", begun.derivatives)
    factors = program.constant("factor", law.factors)
    powers = program.constant("power", law.exponents)
    taylor = program.constant("taylor", law.taylor)
    if state is None:
        rows.start_from(z[0], program.y[0])
    with rows.moves():
        error = program.let(program.local("error"), z[0] - rows.y_before[0])
        sign = program.let(program.local("sign"), ZERO)
        with program.when(f"{error} > 0.0"):
            program.let(sign, ONE)
        with program.when(f"{error} < 0.0"):
            program.let(sign, -ONE)
        size = program.let(program.local("size"), call("fabs", error))
        for i in range(lines):
            more: Expression = call("pow", size, powers[i]) if i + 1 < lines else ONE
            program.let(size, factors[i] * more)
            moved: Expression = z[i]
            for j in range(1, lines - i):
                moved = moved + taylor[j] * z[i + j]
            # z[i] is read by no later line.
            program.let(z[i], moved - taylor[1] * size * sign)
    program.estimate("derivatives", z)
    rows.keep()
    return program
