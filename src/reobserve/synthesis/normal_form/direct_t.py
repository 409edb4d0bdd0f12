"""Second method: x = T(z) from T'(z) (A z - l(h(T(z)))) = f(T(z)), degree by degree.

With w = l(h), whose linear part is L0 H, and g(z) = A z - w(T(z)), which begins with F z, the
terms of degree d that hold T_d leave on the right

    [f_2+(T)]_d + [w_2+(T)]_d - sum over k = 2..d-1 of T_k'(z) g_(d+1-k)(z),

where 2+ means the terms of degree 2 and above. Products of components of T are taken along.
"""

from __future__ import annotations

import numpy as np

from reobserve.polynomials.arithmetic import Coefficients, add_derivatives_along, zeros
from reobserve.polynomials.powers import Powers
from reobserve.synthesis.normal_form.problem import NormalFormProblem
from reobserve.synthesis.normal_form.solver import Solver, identity


def solve_t(problem: NormalFormProblem, solver: Solver) -> Coefficients:
    """The coefficients of T up to the degree of the problem, shape (n, N)."""
    basis, n = problem.basis, problem.system.states
    T = identity(problem)
    higher = np.concatenate([problem.dynamics, problem.injected])  # f, then w
    higher[:, : n + 1] = 0
    powers = Powers(basis, T, basis, np.flatnonzero(np.any(higher != 0, axis=0)))
    outer = higher[:, powers.places]
    injection = problem.A - problem.F  # L0 H
    g = zeros(T.shape, T)
    right = zeros(T.shape, T)
    for d in range(2, problem.degree + 1):
        part = basis.part(d)
        powers.extend(d)
        values = outer @ powers.table[:, part]
        right[:, part] = values[:n] + values[n:]
        add_derivatives_along(basis, T, g, 2, d - 1, d, -1, right)
        T[:, part] = solver(basis, right[:, part], d)
        g[:, part] = -values[n:] - injection @ T[:, part]
    return T
