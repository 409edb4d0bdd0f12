"""The robust exact differentiator."""

from __future__ import annotations

from reobserve.codegen.expressions import Expression, call
from reobserve.codegen.programs.sampling import Rows
from reobserve.codegen.statements import ONE, ZERO, Program
from reobserve.observers.levant import LevantDifferentiator, State


def differentiator(observer: LevantDifferentiator, state: State | None) -> Program:
    """Its homogeneous discretisation."""
    program = Program("Robust exact differentiator", 1, 0)
    begun = observer.init([0.0] * (observer.order + 1)) if state is None else state
    rows, law, lines = Rows(program, begun), observer._law, observer.order + 1
    z = program.remember("z", begun.derivatives)
    factors = program.constant("factor", law.factors, r"\Lambda", gain=True)
    powers = program.constant("power", law.exponents, r"\alpha")
    taylor = program.constant("taylor", law.taylor, "c")
    if state is None:
        with program.hidden(), program.when("started == 0"):
            program.let(z[0], program.y[0])
    with rows.moves():
        error = program.let(program.local("error", (), r"\epsilon"), z[0] - rows.y_before[0])
        sign = program.local("sign", (), r"\sigma")
        with program.hidden():
            program.let(sign, ZERO)
            with program.when("error > 0.0"):
                program.let(sign, ONE)
            with program.when("error < 0.0"):
                program.let(sign, -ONE)
        program.notes.append(r"$\sigma$ is the sign of $\epsilon$")
        size = program.let(program.local("size", (), "r"), call("fabs", error))
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
