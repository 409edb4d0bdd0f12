"""Polynomials in a program: monomials one from another, and sums of them."""

from __future__ import annotations

from reobserve.codegen.expressions import Expression, Name, Number, total
from reobserve.codegen.program import ONE, Program
from reobserve.polynomials.evaluation_kernels import polynomials
from reobserve.polynomials.maps import PolynomialMap


def polynomial(program: Program, name: str, source: PolynomialMap) -> int:
    """A function of the program that evaluates a map, and its number of components."""
    table = polynomials(source)
    x = program.local(f"{name}_at", (source.variables,))
    out = program.local(f"{name}_out", (source.components,))
    higher = [k for k, parent in enumerate(table.parent) if k and parent]
    m = program.local(f"{name}_powers", (len(higher),))

    def monomial(k: int) -> Expression:
        if k == 0:
            return ONE
        return m[higher.index(k)] if k in higher else x[int(table.variable[k])]

    def term(coefficient: float, k: int) -> Expression:
        size: Expression = Number(abs(coefficient))
        if k:
            size = monomial(k) if abs(coefficient) == 1.0 else size * monomial(k)
        return size if coefficient > 0 else -size

    with program.function(name, (x,), out):
        for place, k in enumerate(higher):
            program.let(m[place], monomial(int(table.parent[k])) * x[int(table.variable[k])])
        for c in range(source.components):
            among = range(table.start[c], table.start[c + 1])
            each = (term(float(table.coefficient[j]), int(table.term[j])) for j in among)
            program.let(out[c], total(each))
    return source.components


def evaluated(program: Program, name: str, size: int, at: Name, into: str) -> Name:
    """The value of such a function at a point, in a variable of the step."""
    return program.apply(program.local(into, (size,)), name, at)
