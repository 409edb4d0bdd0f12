"""Third method: the Lie transform of Section 4, with the unknown gain solved along the way.

The observer's right-hand side is f(x) + L(x) w(x) - L(x) l(y), with w = l(h) and the gain
L = I + L_1 + L_2 + ..., and the transformation x = T(z, eps) flows along a generator U with
parts U_0, U_1, ..., where U_i has degree i + 2. The parts of (8) are

    f_k / k! = F_(k+1) + w_(k+1) + L_1 w_k + ... + L_k w_1,

so f_k contains the unknown L_k, which is the part of degree k of dT/dz at z = S(x). The paper
leaves its coefficients open to the end; here they are eliminated. By the triangle (22)

    T_(k+1) = (U_(k-1) + q_k) / k!,      L_k = T_(k+1)' + c_k,

where q_k is what (22) gives with U_(k-1) = 0 and c_k is the part of degree k of T'(S(x)) with the
terms known before. Then (20), whose ad_{Ax} U = U' A x - A U holds A = F + L0 H, becomes

    U_(k-1)' F x - A U_(k-1) = R_k + q_k' L0 H x + k! c_k L0 H x,

with the known terms R_k = k! (F_(k+1) + w_(k+1) + ... + L_(k-1) w_2) - sum C ad_{f} U of (20):
the equation of all methods. The bracket is ad_f U = U' f - f' U, and in (22) L_p U means p' U, the
derivative of p along U.

The code divides this by (k - 1)! and stores f_k / k!, U_i / i! and p_i^(m) / i!. No binomials
remain then, and a sum over indices is one product of series.
"""

from __future__ import annotations

from math import factorial
from typing import NamedTuple

import numpy as np

from reobserve.polynomials.arithmetic import (
    Coefficients,
    add_applied,
    add_derivatives_along,
    jacobian_part,
    zeros,
)
from reobserve.polynomials.powers import Powers
from reobserve.synthesis.normal_form.problem import NormalFormProblem
from reobserve.synthesis.normal_form.solver import Solver, identity


class LieTransform(NamedTuple):
    """Results of the recursion: U, T and S of shape (n, N), the gain L of shape (n n, N).

    The part of degree i + 2 of ``U`` is U_i; row n c + i of ``L`` is its entry (c, i).
    """

    U: Coefficients
    T: Coefficients
    S: Coefficients
    L: Coefficients


def lie_transform(problem: NormalFormProblem, solver: Solver) -> LieTransform:
    """The generator, the transformation, its inverse and the gain of the Lie transform.

    Thomas, Kwatny & Chang, (8), (18), (20) to (22), after (8), after (14), Propositions 4.16 and
    4.20, Remark 4.22.
    """
    basis, n = problem.basis, problem.system.states
    w = problem.injected
    T, S = identity(problem), identity(problem)
    gain = zeros((n * n, T.shape[1]), T)
    gain[:: n + 1, 0] = 1
    known_gain = zeros(gain.shape, T)  # c_k, and in the end c_k only
    T_jacobian = zeros(gain.shape, T)
    T_jacobian[:: n + 1, 0] = 1
    higher = zeros(T.shape, T)  # T without its linear part
    # Part k + 1 of f is f_k / k!; part i + m + 2 of p[m] is p_i^(m) / i! of (22).
    f = zeros(T.shape, T)
    f[:, basis.part(1)] = problem.A
    p = [zeros(T.shape, T) for _ in range(problem.degree)]
    U = p[0]
    powers = Powers(basis, S, basis, np.arange(len(basis.exponents)))
    for k in range(1, problem.degree):
        part = basis.part(k + 1)
        if k > 1:
            powers.extend(k)
            S[:, basis.part(k)] = -powers.part(higher, k)
            powers.close()
        known_gain[:, basis.part(k)] = powers.part(T_jacobian, k)

        # f_k / k! as far as it is known
        fed = zeros(T.shape, T)
        fed[:, part] = problem.dynamics[:, part] + w[:, part]
        for j in range(1, k):
            add_applied(basis, gain, w, j, k + 1 - j, fed)
        add_applied(basis, known_gain, w, k, 1, fed)
        # the triangle (22) for U_(k-1) = 0: i + m = k - 1
        for m in range(1, k):
            p[m][:, part] += (k - m) * p[m - 1][:, part]  # p_(i+1)^(m-1)
            add_derivatives_along(basis, p[m - 1], U, m + 1, k, k + 1, 1, p[m])
        q = p[k - 1] / factorial(k - 1)
        right = k * fed
        add_derivatives_along(basis, U, f, 2, k, k + 1, -1, right)
        add_derivatives_along(basis, f, U, 2, k, k + 1, 1, right)
        add_derivatives_along(basis, q, w, k + 1, k + 1, k + 1, 1, right)

        generator = solver(basis, right[:, part], k + 1)
        for m in range(k):
            p[m][:, part] += factorial(k - 1) // factorial(k - 1 - m) * generator
        T[:, part] = (generator + q[:, part]) / k
        higher[:, part] = T[:, part]
        jacobian_part(basis, T, k + 1, T_jacobian)
        gain[:, basis.part(k)] = T_jacobian[:, basis.part(k)] + known_gain[:, basis.part(k)]
        add_derivatives_along(basis, T, w, k + 1, k + 1, k + 1, 1, fed)
        f[:, part] = fed[:, part]
    last = problem.degree
    if last > 1:
        powers.extend(last)
        S[:, basis.part(last)] = -powers.part(higher, last)
    for i in range(last - 1):
        U[:, basis.part(i + 2)] *= factorial(i)
    return LieTransform(U, T, S, gain)
