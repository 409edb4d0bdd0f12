"""First method: z = S(x) from S'(x) f(x) = A S(x) - l(h(x)), degree by degree.

The equation is linear in S, so the right-hand side of degree d is known at once:

    S_d'(x) F x - A S_d(x) = -[l(h(x))]_d - sum over r = 2..d of S_(d+1-r)'(x) f_r(x).
"""

from __future__ import annotations

from reobserve.polynomials.arithmetic import Coefficients, add_derivatives_along
from reobserve.synthesis.normal_form.problem import NormalFormProblem
from reobserve.synthesis.normal_form.solver import Solver, identity


def solve_s(problem: NormalFormProblem, solver: Solver) -> Coefficients:
    """The coefficients of S up to the degree of the problem, shape (n, N)."""
    basis, f = problem.basis, problem.dynamics
    S = identity(problem)
    right = -problem.injected
    for d in range(2, problem.degree + 1):
        part = basis.part(d)
        add_derivatives_along(basis, S, f, 1, d - 1, d, -1, right)
        S[:, part] = solver(basis, right[:, part], d)
    return S
