"""Operations that the Lie transform and brute force take to find T, over fractions.

Section 6 compares the Lie transform with `brute force`, comparing coefficients. Neither program is
printed. Coefficients of T can be compared degree by degree, or all at once. In the Lie transform
the coefficients of the gain can be eliminated at each degree, or left open to the end (Remark
4.22). Sums, products and quotients of fractions that are not zero are counted.

Linear equations are counted in one of three ways:

    elimination    dense elimination of all their unknowns
    division       in eigenvectors of F and A (Remark 4.18), an equation is a division for each
                   unknown; there and back, dense matrices change monomials and components
    real_division  the same, where each operation counts as four, since eigenvectors are complex:
                   a product takes six real operations, a sum two

What is left open or solved for all at once is found by Newton's method with the Jacobian at the
start. As each step makes one more degree exact, it takes degree - 1 steps:

    all at once   a step evaluates the equations for T, as the method degree by degree does once
    open gain     each evaluation is a recursion with given gains; the Jacobian takes one for each
                  unknown coefficient of the gain
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from reobserve.polynomials.arithmetic import Coefficients
from reobserve.polynomials.maps import PolynomialMap
from reobserve.polynomials.monomials import Monomials
from reobserve.synthesis.normal_form.direct_t import solve_t
from reobserve.synthesis.normal_form.problem import NormalFormProblem
from reobserve.synthesis.normal_form.solver import Solver, solver_for
from reobserve.systems.polynomial import PolynomialSystem
from reobserve_papers.papers.lie.lie_transform import lie_transform


@dataclass(frozen=True)
class Operations:
    """Operations of both methods, without those of linear equations, and the sizes of these."""

    of_t: int  # one evaluation of the equations for T
    recursion: int
    states: int
    sizes: tuple[int, ...]  # by degree
    gains: int  # unknown coefficients of L

    def brute_force(self, way: str, equations: str) -> int:
        """The operations of comparing coefficients, ``by_degree`` or ``all_at_once``."""
        if way == "by_degree":
            return self.of_t + self._solved(equations)
        steps = len(self.sizes)
        if equations == "elimination":
            return steps * self.of_t + _elimination(sum(self.sizes), steps)
        return steps * (self.of_t + self._solved(equations))

    def lie(self, gain: str, equations: str) -> int:
        """The operations of the Lie transform, with the gain ``eliminated`` or ``open``."""
        each, steps = self.recursion + self._solved(equations), len(self.sizes)
        if gain == "eliminated":
            return each
        return (self.gains + steps) * each + _elimination(self.gains, steps)

    def _solved(self, equations: str) -> int:
        """The operations of the equations of all degrees."""
        if equations == "elimination":
            return sum(_elimination(size, 1) for size in self.sizes)
        each = 4 if equations == "real_division" else 1
        return each * sum(_division(self.states, size // self.states) for size in self.sizes)


def operations(problem: NormalFormProblem) -> Operations:
    """Count the operations of both methods on an exact problem."""
    basis, n, steps = problem.basis, problem.system.states, problem.degree - 1
    sizes = tuple(n * (part.stop - part.start) for part in map(basis.part, range(2, steps + 2)))
    gains = n * n * (int(basis.first[steps + 1]) - 1)
    return Operations(_counted(problem, solve_t), _counted(problem, lie_transform), n, sizes, gains)


def _elimination(size: int, times: int) -> int:
    """Operations of a dense LU factorisation, used for so many right-hand sides."""
    return (4 * size**3 - 3 * size**2 - size) // 6 + times * (2 * size**2 - size)


def _division(states: int, width: int) -> int:
    """Operations with ``states`` series of ``width`` monomials: there, the divisions, and back."""
    change = width * (2 * states**2 - states) + states * (2 * width**2 - width)
    return 2 * change + states * width


class _Counted(Fraction):
    """A fraction that counts the operations done with it."""

    __slots__ = ()
    done = 0

    def __neg__(self) -> _Counted:
        return _Counted(super().__neg__())


def _counting(name: str) -> Callable[[_Counted, Any], Any]:
    plain = getattr(Fraction, name)

    def operation(self: _Counted, other: Any) -> Any:
        result = plain(self, other)
        if result is NotImplemented:
            return result
        _Counted.done += self != 0 and other != 0
        return _Counted(result)

    return operation


for _name in ("add", "sub", "mul", "truediv"):
    for _of in (f"__{_name}__", f"__r{_name}__"):
        setattr(_Counted, _of, _counting(_of))


def _counted(
    problem: NormalFormProblem, solve: Callable[[NormalFormProblem, Solver], object]
) -> int:
    """Operations of a method without those of its linear equations."""

    def counted(source: PolynomialMap) -> PolynomialMap:
        return PolynomialMap(source.basis, _as_counted(source.coefficients))

    plain = solver_for(problem)

    def solver(basis: Monomials, right: Coefficients, degree: int) -> Coefficients:
        return _as_counted(plain(basis, right, degree))

    system = PolynomialSystem(*map(counted, (problem.system.dynamics, problem.system.output)))
    counting = NormalFormProblem(system, counted(problem.injection), problem.degree)
    _ = counting.injected  # which all methods share
    before = _Counted.done
    solve(counting, solver)
    return _Counted.done - before


def _as_counted(values: Coefficients) -> Coefficients:
    array: Coefficients = np.vectorize(_Counted, otypes=[object])(values)
    return array
