"""Second road: x = T(z) from T'(z) (A z - l(h(T(z)))) = f(T(z)), degree by degree.

With w = l(h), whose linear part is L0 H, and g(z) = A z - w(T(z)), which begins with F z, the
terms of degree d that hold T_d leave on the right

    [f_2+(T)]_d + [w_2+(T)]_d - sum over k = 2..d-1 of T_k'(z) g_(d+1-k)(z),

where 2+ means the terms of degree 2 and above. Products of components of T are taken along.
"""

from __future__ import annotations

import numpy as np

from reobserve.power_series.arithmetic import Coefficients, add_derivative_along, zeros
from reobserve.power_series.powers import Powers
from reobserve.synthesis.normal_form.problem import NormalFormProblem
from reobserve.synthesis.normal_form.solver import Solver, identity


def solve_t(problem: NormalFormProblem, solver: Solver) -> Coefficients:
    """The coefficients of T up to the degree of the problem, shape (n, N)."""
    basis, linear = problem.basis, problem.system.states + 1
    T = identity(problem)
    f, w = problem.dynamics.copy(), problem.injected.copy()
    f[:, :linear] = 0
    w[:, :linear] = 0
    wanted = np.flatnonzero(np.any(f != 0, axis=0) | np.any(w != 0, axis=0))
    powers = Powers(basis, T, basis, wanted)
    injection = problem.A - problem.F  # L0 H
    g = zeros(T.shape, T)
    right = zeros(T.shape, T)
    for d in range(2, problem.degree + 1):
        part = basis.part(d)
        powers.extend(d)
        fed = powers.part(w, d)
        right[:, part] += powers.part(f, d) + fed
        for k in range(2, d):
            add_derivative_along(basis, T, g, k, d + 1 - k, -1, right)
        T[:, part] = solver(basis, right[:, part], d)
        g[:, part] = -fed - injection @ T[:, part]
    return T
