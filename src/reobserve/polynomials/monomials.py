"""All monomials up to a degree, and where their products, quotients and multiples stand."""

from __future__ import annotations

from functools import lru_cache
from itertools import combinations_with_replacement
from math import comb
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError

Index = NDArray[np.int32]

MOST_BYTES = 2**30  # of the tables of one basis, or of the powers of one series

# Beyond this many numbers in a table nobody counts bytes any more.
_MOST_DIGITS = 1e18


class Monomials(NamedTuple):
    """The monomials in n variables up to a degree, N of them, and the tables of their products.

    They are ordered by degree and within a degree from x1^d down to xn^d, so that a series is one
    row of N coefficients whose first entries are also those of a shorter series.

    ``exponents`` has shape (N, n). Those of degree d stand from ``first[d]`` to ``first[d + 1]``.
    ``lowered[m, i]`` is the place of the m-th one divided by x_i (-1 if that is none), and
    ``raised[m, i]`` of its product with x_i, for all below the highest degree. Each but 1 is
    ``parent[m]`` times the variable ``variable[m]``. The product of the a-th monomial of degree r
    and the b-th of degree s stands at ``products[block[r, s] + a * N_s + b]``.
    """

    exponents: Index
    first: Index
    raised: Index
    lowered: Index
    parent: Index
    variable: Index
    products: Index
    block: NDArray[np.int64]

    @property
    def variables(self) -> int:
        """The number of variables n."""
        return int(self.exponents.shape[1])

    @property
    def degree(self) -> int:
        """The highest degree."""
        return len(self.first) - 2

    def part(self, degree: int) -> slice:
        """The places of one degree."""
        return slice(int(self.first[degree]), int(self.first[degree + 1]))

    def place(self, powers: tuple[int, ...]) -> int:
        """The place of the monomial with these exponents."""
        place = 0
        for variable, power in enumerate(powers):
            for _ in range(power):
                place = int(self.raised[place, variable])
        return place


@lru_cache(maxsize=32)
def monomials(variables: int, degree: int) -> Monomials:
    """The basis of the series in so many variables up to a degree."""
    if variables < 1 or degree < 1:
        raise InputError("degree", f"{degree} in {variables} variables; both must be 1 or more")
    check_size(variables, degree, comb(2 * variables + degree, degree), "products of monomials")
    return _tables(variables, degree)


def check_size(variables: int, degree: int, entries: int, what: str, size: int = 4) -> None:
    """Refuse a table of so many entries of ``size`` bytes if it would not fit into memory."""
    if entries * size <= MOST_BYTES:
        return
    needed = f"{entries * size / 2**30:.3g} GiB" if entries < _MOST_DIGITS else "more than memory"
    raise InputError(
        "degree",
        f"{degree} in {variables} variables needs {needed} for the {what}, "
        f"must be at most {MOST_BYTES / 2**30:g} GiB",
    )


def _tables(n: int, degree: int) -> Monomials:
    # count[d, k]: monomials of degree d in k variables, and none of a negative degree.
    count = np.array(
        [[comb(d + k - 1, d) if k else 0 for k in range(n + 1)] for d in range(degree + 1)]
    )
    count[0] = 1
    first = np.concatenate([[0], np.cumsum(count[:, n])])
    exponents = np.zeros((first[-1], n), dtype=np.int32)
    variable = np.full(first[-1], -1, dtype=np.int32)
    for d in range(1, degree + 1):
        for place, factors in enumerate(combinations_with_replacement(range(n), d), first[d]):
            variable[place] = factors[0]
            for factor in factors:
                exponents[place, factor] += 1

    def places(powers: NDArray[np.int32]) -> Index:
        """The rank among those of the same degree: for each variable, higher powers of it."""
        rest = powers.sum(axis=-1)
        rank = first[rest]
        for k in range(n - 1):
            higher = rest - powers[..., k] - 1
            rank = rank + np.where(higher >= 0, count[np.maximum(higher, 0), n - k], 0)
            rest = rest - powers[..., k]
        ranks: Index = rank.astype(np.int32)
        return ranks

    unit = np.eye(n, dtype=np.int32)
    raised = places(exponents[: first[degree], None, :] + unit)
    lowered = np.full((first[-1], n), -1, dtype=np.int32)
    lowered[raised, np.arange(n)] = np.arange(len(raised))[:, None]
    parent = np.where(variable < 0, -1, lowered[np.arange(first[-1]), variable]).astype(np.int32)

    block = np.full((degree + 1, degree + 1), -1, dtype=np.int64)
    products, size = [], 0
    for r in range(degree + 1):
        for s in range(degree + 1 - r):
            block[r, s] = size
            left, right = (exponents[first[d] : first[d + 1]] for d in (r, s))
            products.append(places(left[:, None, :] + right).ravel())
            size += products[-1].size
    return Monomials(
        exponents, first.astype(np.int32), raised, lowered, parent, variable,
        np.concatenate(products), block,
    )  # fmt: skip
