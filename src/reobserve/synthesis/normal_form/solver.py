"""Linear equations that all methods solve, and the first terms of the series."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from reobserve.polynomials.arithmetic import Coefficients, zeros
from reobserve.polynomials.monomials import Monomials
from reobserve.synthesis.normal_form.homological import SchurSolver
from reobserve.synthesis.normal_form.homological_exact import RationalSolver
from reobserve.synthesis.normal_form.problem import NormalFormProblem

# (basis, right-hand side, degree) -> the solution of that degree
Solver = Callable[[Monomials, Coefficients, int], Coefficients]


def solver_for(problem: NormalFormProblem) -> Solver:
    """The solver for the numbers of the problem: exact for fractions, by Schur forms for floats."""
    if problem.system.dynamics.exact:
        return RationalSolver(problem.F, problem.A)
    return SchurSolver(problem.F, problem.A)


def identity(problem: NormalFormProblem) -> Coefficients:
    """The series x, of the numbers of the problem."""
    n = problem.system.states
    start = zeros((n, len(problem.basis.exponents)), problem.dynamics)
    start[:, problem.basis.part(1)] = np.eye(n, dtype=int)
    return start
