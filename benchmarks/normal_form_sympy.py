"""The methods by brute force in sympy: unknown coefficients, compared monomial by monomial.

All methods share the arithmetic, sympy's polynomials over QQ[unknowns] truncated at a degree, and
sympy's solvers. A map is a list of n polynomials in x1..xn.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import factorial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sympy import QQ, linsolve, ring, solve, symbols

from reobserve.polynomials.arithmetic import Coefficients
from reobserve.polynomials.monomials import Monomials
from reobserve.synthesis.normal_form.problem import NormalFormProblem

Map = list[Any]  # of sympy's polynomials


def brute_s(problem: NormalFormProblem) -> Map:
    """All coefficients of S from one linear system."""
    n, degrees = problem.system.states, range(2, problem.degree + 1)
    space = _Space(problem, _count(problem.basis, degrees, n))
    S = _plus(space.x, space.unknown(n, degrees))
    moved = space.along(S, space.f, problem.degree)
    equations = _minus(_minus(space.applied(problem.A, S), space.w), moved)
    return space.put(S, space.linear(equations, degrees))


def direct_t(problem: NormalFormProblem) -> Map:
    """T degree by degree, a linear system for each."""
    n, degrees = problem.system.states, range(2, problem.degree + 1)
    space = _Space(problem, _count(problem.basis, degrees, n))
    T: Map = space.x
    for d in degrees:
        T = _plus(T, space.unknown(n, [d]))
        T = space.put(T, space.linear(_rest_of_t(space, T, d), [d]))
    return T


def t_at_once(problem: NormalFormProblem) -> Map:
    """All coefficients of T from one system, which is not linear."""
    n, degrees = problem.system.states, range(2, problem.degree + 1)
    space = _Space(problem, _count(problem.basis, degrees, n))
    T = _plus(space.x, space.unknown(n, degrees))
    equations = space.listed(_rest_of_t(space, T, problem.degree), degrees)
    return space.put(T, solve(equations, space.taken, dict=True)[0])


def _rest_of_t(space: _Space, T: Map, degree: int) -> Map:
    """f(T) - T'(z) (A z - w(T)), which is zero."""
    field = _minus(space.applied(space.problem.A, space.x), space.after(space.w, T, degree))
    return _minus(space.after(space.f, T, degree), space.along(T, field, degree))


def lie(problem: NormalFormProblem, *, gain_open: bool = False) -> Map:
    """T by the Lie recursion, a linear system for each generator.

    With ``gain_open``, as in the paper, the coefficients of the gain stay unknown to the end.
    """
    n, last = problem.system.states, problem.degree
    generators = _count(problem.basis, range(2, last + 1), n)
    open_gains = _count(problem.basis, range(1, last), n * n) if gain_open else 0
    space = _Space(problem, open_gains + generators)
    x, w1 = space.x, space.part(space.w, 1)
    if gain_open:
        gain = _plus(space.identity(), space.unknown(n * n, range(1, last)))
    unknown_gains = space.taken
    f = linear = space.applied(problem.A, x)
    T: Map = x
    p = [_minus(x, x)] * last
    for k in range(1, last):
        d = k + 1
        if not gain_open:
            gain = space.gain(T, k)
        fed = _plus(space.part(space.f, d), space.part(space.fed(gain, d), d))
        for m in range(1, k):
            p[m] = _plus(p[m], _scaled(space.part(p[m - 1], d), k - m))
            p[m] = _plus(p[m], space.part(space.along(p[m - 1], p[0], d), d))
        q = _scaled(space.part(p[k - 1], d), QQ(1, factorial(k - 1)))
        u = space.unknown(n, [d])
        T_new = _scaled(_plus(u, q), QQ(1, k))
        if not gain_open:  # the unknown part of the gain, by the unknown part of T
            fed = _plus(fed, space.along(T_new, w1, d))
        bracket = _minus(space.along(p[0], f, d), space.along(f, p[0], d))
        bracket = space.part(bracket, d)
        homological = _minus(space.along(u, linear, d), space.applied(problem.A, u))
        equations = _minus(_plus(homological, bracket), _scaled(fed, k))
        found = space.linear(equations, [d], unknown_gains)
        for m in range(k):
            part = _scaled(u, factorial(k - 1) // factorial(k - 1 - m))
            p[m] = space.put(_plus(p[m], part), found)
        T, f = space.put(_plus(T, T_new), found), space.put(_plus(f, fed), found)
    if gain_open:
        equations = space.listed(_minus(gain, space.gain(T, last - 1)), range(1, last))
        T = space.put(T, solve(equations, unknown_gains, dict=True)[0])
    return T


def coefficients(found: Map, basis: Monomials) -> NDArray[np.float64]:
    """As floats, shape (n, N)."""
    places = [tuple(map(int, powers)) for powers in basis.exponents]
    return np.array(
        [
            [float(p.ring.domain.to_sympy(p.get(m, p.ring.domain.zero))) for m in places]
            for p in found
        ]
    )


class _Space:
    """Polynomials in x over QQ[so many unknowns], and those of the unknowns in use so far."""

    def __init__(self, problem: NormalFormProblem, unknowns: int) -> None:
        self.problem, self.n = problem, problem.system.states
        self._symbols = list(symbols(f"c:{unknowns}"))
        self.taken: list[Any] = []
        self.domain = QQ[self._symbols]
        self.ring, *self.x = ring([f"x{i}" for i in range(self.n)], self.domain)
        self._monomials = [tuple(map(int, powers)) for powers in problem.basis.exponents]
        self.f, self.w = self._series(problem.dynamics), self._series(problem.injected)

    def _series(self, rows: Coefficients) -> Map:
        return [
            self.ring.from_dict(
                {
                    m: self.domain(QQ(value.numerator, value.denominator))
                    for m, value in zip(self._monomials, row, strict=True)
                    if value != 0
                }
            )
            for row in rows
        ]

    def identity(self) -> Map:
        """The unit matrix, row by row."""
        return [self.ring(int(i == j)) for i in range(self.n) for j in range(self.n)]

    def unknown(self, components: int, degrees: Iterable[int]) -> Map:
        """Polynomials with unknown coefficients at all monomials of these degrees."""
        chosen = [m for m in self._monomials if sum(m) in degrees]
        found = []
        for _ in range(components):
            begin = len(self.taken)
            fresh = self._symbols[begin : begin + len(chosen)]
            self.taken = self._symbols[: begin + len(chosen)]
            values = map(self.domain.from_sympy, fresh)
            found.append(self.ring.from_dict(dict(zip(chosen, values, strict=True))))
        return found

    def times(self, a: Any, b: Any, degree: int) -> Any:
        """The product, truncated at a degree."""
        found: dict[Any, Any] = {}
        for m, one in a.items():
            for k, other in b.items():
                if sum(m) + sum(k) <= degree:
                    place = tuple(i + j for i, j in zip(m, k, strict=True))
                    found[place] = found.get(place, self.domain.zero) + one * other
        return self.ring.from_dict({m: value for m, value in found.items() if value})

    def along(self, p: Map, v: Map, degree: int) -> Map:
        """The derivative p'(x) v(x)."""
        pairs = list(zip(self.x, v, strict=True))
        return [
            sum((self.times(one.diff(x), s, degree) for x, s in pairs), self.ring.zero) for one in p
        ]

    def after(self, outer: Map, inner: Map, degree: int) -> Map:
        """The composition outer(inner(x))."""
        powers = {self._monomials[0]: self.ring.one}
        for m in self._monomials[1:]:
            i = next(i for i, power in enumerate(m) if power)
            shorter = (*m[:i], m[i] - 1, *m[i + 1 :])
            powers[m] = self.times(powers[shorter], inner[i], degree)
        return [sum((powers[m] * value for m, value in p.items()), self.ring.zero) for p in outer]

    def gain(self, T: Map, degree: int) -> Map:
        """T'(S(x)) row by row, S the inverse of T."""
        S, higher = self.x, _minus(T, self.x)
        for d in range(2, degree + 1):
            S = _minus(self.x, self.after(higher, S, d))
        return self.after([one.diff(x) for one in T for x in self.x], S, degree)

    def fed(self, gain: Map, degree: int) -> Map:
        """The gain times w."""
        return [
            sum(
                (self.times(g, s, degree) for g, s in zip(row, self.w, strict=True)), self.ring.zero
            )
            for row in (gain[i * self.n : (i + 1) * self.n] for i in range(self.n))
        ]

    def applied(self, matrix: Coefficients, p: Map) -> Map:
        """A matrix of numbers times a map."""
        rows = [[QQ(a.numerator, a.denominator) for a in row] for row in matrix]
        return [sum((s * a for a, s in zip(row, p, strict=True)), self.ring.zero) for row in rows]

    def part(self, p: Map, degree: int) -> Map:
        """The part of one degree."""
        return [
            self.ring.from_dict({m: value for m, value in one.items() if sum(m) == degree})
            for one in p
        ]

    def listed(self, p: Map, degrees: Iterable[int]) -> list[Any]:
        """The coefficients of these degrees, which have to be zero."""
        return [
            self.domain.to_sympy(value)
            for one in p
            for m, value in one.items()
            if sum(m) in degrees
        ]

    def linear(self, p: Map, degrees: Iterable[int], but: Sequence[Any] = ()) -> dict[Any, Any]:
        """The unknowns in use, but for some, from linear equations."""
        equations = self.listed(p, degrees)
        present = set().union(*(equation.free_symbols for equation in equations))
        wanted = [c for c in self.taken[len(but) :] if c in present]
        (solution,) = linsolve(equations, wanted)
        return dict(zip(wanted, solution, strict=True))

    def put(self, p: Map, values: dict[Any, Any]) -> Map:
        """With the values of unknowns put in."""
        known = [tuple(map(self.domain.from_sympy, pair)) for pair in values.items()]
        return [
            self.ring.from_dict({m: v for m, c in one.items() if (v := c.compose(known))})
            for one in p
        ]


def _count(basis: Monomials, degrees: Iterable[int], components: int) -> int:
    return components * sum(int(basis.first[d + 1] - basis.first[d]) for d in degrees)


def _plus(a: Map, b: Map) -> Map:
    return [one + other for one, other in zip(a, b, strict=True)]


def _minus(a: Map, b: Map) -> Map:
    return [one - other for one, other in zip(a, b, strict=True)]


def _scaled(a: Map, factor: Any) -> Map:
    return [one * factor for one in a]
