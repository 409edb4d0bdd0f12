"""Systems for the tests of series, with independent arithmetic to compute answers.

A system is written in polynomials of sympy over the rationals. Nothing here uses the series of the
package; only `to_map` and `to_polynomials` convert between them.
"""

from __future__ import annotations

import random
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from typing import Any

from sympy import QQ
from sympy.polys.matrices import DomainMatrix
from sympy.polys.rings import PolyElement, ring

from reobserve.polynomials.maps import PolynomialMap
from reobserve.synthesis.normal_form.problem import NormalFormProblem
from reobserve.systems.polynomial import PolynomialSystem

Polynomials = list[PolyElement]


def variables(n: int) -> Polynomials:
    return list(ring([f"x{i + 1}" for i in range(n)], QQ)[1:])


def powers_of(n: int, degree: int) -> list[tuple[int, ...]]:
    """The exponents of one degree, from x1^d down to xn^d."""
    every = (m for m in product(range(degree, -1, -1), repeat=n) if sum(m) == degree)
    return sorted(every, reverse=True)


def monomial(x: Polynomials, powers: Iterable[int]) -> PolyElement:
    return x[0].ring({tuple(powers): QQ(1)})


def fraction(value: Any) -> Fraction:
    return Fraction(int(value.numerator), int(value.denominator))


def parts(p: PolyElement, lowest: int, highest: int) -> PolyElement:
    """The terms of p from one degree to another."""
    kept = {m: c for m, c in p.terms() if lowest <= sum(m) <= highest}
    return p.ring(kept)


def lowest_degree(polynomials: Iterable[PolyElement]) -> float:
    """The lowest degree with a term, infinity if there is none."""
    return min((sum(m) for p in polynomials for m in p.monoms()), default=float("inf"))


def largest(polynomials: Iterable[PolyElement]) -> float:
    """The largest coefficient in size."""
    return max((abs(float(fraction(c))) for p in polynomials for c in p.coeffs()), default=0.0)


def difference(left: Polynomials, right: Polynomials) -> Polynomials:
    return [a - b for a, b in zip(left, right, strict=True)]


def along(p: Polynomials, v: Polynomials) -> Polynomials:
    """p'(x) v(x)."""
    x = p[0].ring.gens
    zero = p[0].ring.zero
    return [sum((c.diff(x[i]) * v[i] for i in range(len(x))), zero) for c in p]


def bracket(f: Polynomials, U: Polynomials) -> Polynomials:
    """ad_f U = U' f - f' U."""
    return difference(along(U, f), along(f, U))


def times(matrix: Sequence[Sequence[Any]], v: Polynomials) -> Polynomials:
    zero = v[0].ring.zero
    return [sum((entry * c for entry, c in zip(row, v, strict=True)), zero) for row in matrix]


def multiplied(p: PolyElement, q: PolyElement, degree: int) -> PolyElement:
    """p q up to a degree, without the terms above it."""
    found: dict[tuple[int, ...], Any] = {}
    rest = sorted((sum(m), m, c) for m, c in q.terms())
    for m, c in p.terms():
        for d, other, factor in rest:
            if sum(m) + d > degree:
                break
            place = tuple(i + j for i, j in zip(m, other, strict=True))
            found[place] = found.get(place, 0) + c * factor
    return p.ring({m: c for m, c in found.items() if c})


def composed(outer: Polynomials, inner: Polynomials, degree: int) -> Polynomials:
    """outer(inner(x)) up to a degree, by multiplying out each term."""
    known = {(0,) * len(inner): inner[0].ring.one}

    def power(m: tuple[int, ...]) -> PolyElement:
        if m not in known:
            i = next(i for i, e in enumerate(m) if e)
            shorter = power(tuple(e - (j == i) for j, e in enumerate(m)))
            known[m] = multiplied(shorter, inner[i], degree)
        return known[m]

    zero = inner[0].ring.zero
    return [sum((c * power(m) for m, c in p.terms()), zero) for p in outer]


def inverted(T: Polynomials, degree: int) -> Polynomials:
    """The inverse of T = x + higher terms: S = x - higher(S), one more degree each time."""
    x = list(T[0].ring.gens)
    S = x
    for d in range(2, degree + 1):
        higher = [parts(p, 2, d) for p in T]
        S = difference(x, composed(higher, S, d))
    return S


def linear_part(p: Polynomials) -> list[list[Any]]:
    n = p[0].ring.ngens
    return [[c.coeff(p[0].ring.gens[j]) for j in range(n)] for c in p]


def solved(matrix: list[list[Any]], right: list[Any]) -> list[Any]:
    """The solution of a square system over the rationals."""
    n = len(right)
    left = DomainMatrix(matrix, (n, n), QQ)
    column = left.lu_solve(DomainMatrix([[value] for value in right], (n, 1), QQ))
    return [row[0] for row in column.to_list()]


def to_map(polynomials: Polynomials, *, exact: bool = True) -> PolynomialMap:
    terms = [
        {"component": k + 1, "powers": list(m), "coefficient": str(fraction(c))}
        for k, p in enumerate(polynomials)
        for m, c in p.terms()
    ]
    return PolynomialMap.from_terms(
        "map", terms, len(polynomials), polynomials[0].ring.ngens, exact=exact
    )


def to_polynomials(series: PolynomialMap) -> Polynomials:
    x = variables(series.variables)
    found = [x[0].ring.zero] * series.components
    for component, powers, c in series.terms():
        value = Fraction(c)
        rational = QQ(int(value.numerator), int(value.denominator))
        found[component] += rational * monomial(x, powers)
    return found


@dataclass(frozen=True)
class Case:
    """x' = f(x), y = h(x) with the output injection l(y)."""

    f: Polynomials
    h: Polynomials
    l: Polynomials  # noqa: E741

    @property
    def w(self) -> Polynomials:
        """l(h(x)), in full."""
        highest = max(p.degree(i) for p in self.l for i in range(len(self.h)))
        top = max(sum(m) for p in self.h for m in p.monoms())
        return composed(self.l, self.h, len(self.h) * highest * top)

    @property
    def F(self) -> list[list[Any]]:
        return linear_part(self.f)

    @property
    def A(self) -> list[list[Any]]:
        fed = linear_part(self.w)
        return [
            [a + b for a, b in zip(*rows, strict=True)] for rows in zip(self.F, fed, strict=True)
        ]

    def problem(self, degree: int, *, exact: bool = True) -> NormalFormProblem:
        f, h, l = (to_map(p, exact=exact) for p in (self.f, self.h, self.l))  # noqa: E741
        return NormalFormProblem(PolynomialSystem(f, h), l, degree)

    def residual_of_s(self, S: Polynomials) -> Polynomials:
        """S' f - A S + l(h), in full."""
        left = difference(along(S, self.f), times(self.A, S))
        return [a + b for a, b in zip(left, self.w, strict=True)]

    def residual_of_t(self, T: Polynomials, degree: int) -> Polynomials:
        """T' (A z - l(h(T))) - f(T), up to a degree."""
        x = list(T[0].ring.gens)
        g = difference(times(self.A, x), composed(self.w, T, degree))
        moved = [parts(p, 0, degree) for p in along(T, g)]
        return difference(moved, composed(self.f, T, degree))


def van_der_pol(injection: tuple[int, int] = (-2, -4)) -> Case:
    x1, x2 = variables(2)
    (y,) = variables(1)
    return Case([x2, (1 - x1**2) * x2 - x1], [x1], [c * y for c in injection])


def random_case(seed: int, n: int, p: int, *, degree: int = 3) -> Case:
    """Rational coefficients; f, h and l have terms of even degrees, and A is stable.

    A has negative diagonals that dominate their rows, and F = A - L0 H.
    """
    draw = random.Random(seed)
    x, y = variables(n), variables(p)

    def some() -> Any:
        return QQ(draw.choice([-3, -2, -1, 1, 2, 3]), draw.choice([2, 3, 4]))

    def higher(v: Polynomials, highest: int) -> PolyElement:
        total = some() * v[0] ** 2  # a term of even degree at least
        for d in range(2, highest + 1):
            for m in powers_of(len(v), d):
                if draw.random() < 0.3:
                    total += some() * monomial(v, m)
        return total

    A = [[some() / 4 - (QQ(i + 7, 3) if i == j else 0) for j in range(n)] for i in range(n)]
    H = [[some() for _ in range(n)] for _ in range(p)]
    L0 = [[some() for _ in range(p)] for _ in range(n)]
    F = [[A[i][j] - sum(L0[i][k] * H[k][j] for k in range(p)) for j in range(n)] for i in range(n)]
    f = [a + higher(x, degree) for a in times(F, x)]
    h = [a + higher(x, 2) for a in times(H, x)]
    l = [a + higher(y, 2) for a in times(L0, y)]  # noqa: E741
    return Case(f, h, l)


def built_from(
    S: Polynomials,
    T: Polynomials,
    A: list[list[Any]],
    h: Polynomials,
    l: Polynomials,  # noqa: E741
) -> Case:
    """The system that S takes to z' = A z - l(y): f = T'(S) (A S - l(h)), all polynomials."""
    x = list(S[0].ring.gens)
    right = difference(times(A, S), composed(l, h, 10**6))
    f = []
    for row in T:
        gradient = composed([row.diff(v) for v in x], S, 10**6)
        f.append(sum((a * b for a, b in zip(gradient, right, strict=True)), S[0].ring.zero))
    return Case(f, h, l)


def increments(n: int, d: int) -> Iterator[tuple[int, tuple[int, ...]]]:
    """The unit vectors of the homogeneous maps of degree d: a component and a monomial."""
    for component in range(n):
        for powers in powers_of(n, d):
            yield component, powers
