"""Normal-form observers, in identity and in transformed form."""

from __future__ import annotations

import numpy as np

from reobserve.codegen.expressions import Name
from reobserve.codegen.program import Program
from reobserve.codegen.programs.polynomial import evaluated, polynomial
from reobserve.codegen.programs.sampling import RowBuffer, runge_kutta
from reobserve.core.errors import InputError
from reobserve.observers.normal_form import (
    IdentityObserver,
    NormalFormObserver,
    NormalFormState,
    TransformedObserver,
)


def _begun(observer: NormalFormObserver, state: NormalFormState | None) -> NormalFormState:
    if state is not None:
        return state
    return observer.init(np.zeros(observer.normal_form.problem.system.states))


def _known(program: Program, rows: RowBuffer, injected: int) -> list[Name]:
    """l(y) - beta(y, u) at the start, the middle and the end of a step."""
    p, m = program.measurements, program.inputs
    row = program.local("known", (p + m,))
    values = []
    for number in (1, 2, 3):
        for i in range(p):
            before, now = rows.y_before[i], program.y[i]
            program.let(row[i], (before, 0.5 * before + 0.5 * now, now)[number - 1])
        if rows.u_before is not None:
            for i in range(m):
                program.let(row[p + i], rows.u_before[i])
        values.append(evaluated(program, "injected", injected, row, f"injected_{number}"))
    return values


def identity(observer: IdentityObserver, state: NormalFormState | None) -> Program:
    """x^' = f + L (l(h) - l(y) + beta)."""
    if observer.gain != "series" and observer.order:
        raise InputError(
            "observer",
            f"of the gain {observer.gain} cannot be exported, only series: it solves or composes "
            "again at each stage",
        )
    form = observer.normal_form
    n, p = form.problem.system.states, form.problem.system.outputs
    program = Program(f"Normal-form observer of order {observer.order}", p, observer.inputs)
    begun = _begun(observer, state)
    rows = RowBuffer(program, begun)
    x = program.remember("x", begun.values)
    h = program.constant("h", observer.sampling_period)
    system, injection = form.problem.system, form.problem.injection
    fed = injection.after(system.output, injection.degree * system.output.degree)
    gain = form.S.upto(1).jacobian() if observer.order == 0 else form.gain.upto(observer.order)
    polynomial(program, "field", system.dynamics.as_floats())
    polynomial(program, "fed", fed.as_floats())
    polynomial(program, "gain", gain.as_floats())
    injected = polynomial(program, "injected", form.injected.as_floats())
    at, known = program.local("point", (n,)), program.local("given", (n,))
    out = program.local("slope_out", (n,))
    with program.function("slope", (at, known), out):
        f = evaluated(program, "field", n, at, "f")
        own = evaluated(program, "fed", n, at, "own")
        flat = evaluated(program, "gain", n * n, at, "flat")
        apart = program.let(program.local("apart", (n,)), own - known)
        L = program.local("L", (n, n))
        for i, j in np.ndindex(n, n):
            program.let(L[i, j], flat[i * n + j])
        program.let(out, f + L @ apart)
    with rows.moves():
        stages = [(each,) for each in _known(program, rows, injected)]
        runge_kutta(program, "slope", x, stages, h)
    program.estimate("state", x)
    rows.keep()
    return program


def transformed(observer: TransformedObserver, state: NormalFormState | None) -> Program:
    """Step of z' = A z - l(y) + beta, discretised exactly, with x^ = T(z)."""
    form = observer.normal_form
    n, p = form.problem.system.states, form.problem.system.outputs
    title = f"Normal-form observer of order {observer.order}, transformed"
    program = Program(title, p, observer.inputs)
    begun = _begun(observer, state)
    rows = RowBuffer(program, begun)
    z = program.remember("z", begun.values)
    transition, weights = observer._transition
    Phi = program.constant("Phi", transition)
    W = [program.constant(f"W_{i + 1}", weights[i]) for i in range(3)]
    polynomial(program, "series", observer.T.as_floats())
    injected = polynomial(program, "injected", form.injected.as_floats())
    with rows.moves():
        start, middle, end = _known(program, rows, injected)
        program.let(z, Phi @ z - W[0] @ start - W[1] @ middle - W[2] @ end)
    program.estimate("state", evaluated(program, "series", n, z, "x"))
    program.estimate("coordinates", z)
    rows.keep()
    return program
