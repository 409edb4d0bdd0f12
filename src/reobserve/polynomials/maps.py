"""Maps whose components are polynomials, or power series truncated at a degree."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.errors import InputError, located
from reobserve.core.value import read_only
from reobserve.polynomials.arithmetic import Coefficients, jacobian_part, zeros
from reobserve.polynomials.monomials import Monomials, monomials
from reobserve.polynomials.powers import Powers


@dataclass(frozen=True, eq=False, repr=False)
class PolynomialMap:
    """m polynomials in n variables, terms up to a degree.

    Parameters
    ----------
    basis
        From `monomials`.
    coefficients
        Shape (m, N), of floats, complex numbers or (dtype object) exact fractions.

    Raises
    ------
    InputError
        If the shape does not fit the basis, or the type is none of these.
    """

    basis: Monomials
    coefficients: Coefficients

    def __post_init__(self) -> None:
        if self.coefficients.dtype.kind not in "fcO":
            raise InputError(
                "coefficients",
                f"are of type {self.coefficients.dtype}, must be floats, complex or fractions",
            )
        wanted = len(self.basis.exponents)
        if self.coefficients.ndim != 2 or self.coefficients.shape[1] != wanted:
            raise InputError(
                "coefficients",
                f"has shape {self.coefficients.shape}, must have {wanted} columns, one for each "
                f"monomial in {self.variables} variables up to degree {self.degree}",
            )
        object.__setattr__(self, "coefficients", read_only(self.coefficients))

    def __repr__(self) -> str:
        sizes = f"{self.components} of {self.variables} variables, degree {self.degree}"
        return f"{type(self).__name__}({sizes})"

    @classmethod
    def from_terms(
        cls,
        name: str,
        terms: Iterable[Mapping[str, Any]],
        components: int,
        variables: int,
        *,
        exact: bool = False,
    ) -> PolynomialMap:
        """The map of terms ``{component: from 1, powers: [..], coefficient: ..}``, as in a config.

        With ``exact`` the coefficients are kept as fractions: integers, decimals and text such
        as ``"1/3"`` without rounding.

        Raises
        ------
        InputError
            That names the term of ``name``, its key, the value and what is allowed.
        """
        read = [_term(f"{name}[{k}]", term, components, variables) for k, term in enumerate(terms)]
        with located(name):
            highest = max((sum(powers) for _, powers, _ in read), default=1)
            basis = monomials(variables, max(1, highest))
        table = np.zeros((components, len(basis.exponents)), dtype=object if exact else np.float64)
        if exact:
            table += Fraction(0)
        for component, powers, coefficient in read:
            table[component, basis.place(powers)] += coefficient if exact else float(coefficient)
        return cls(basis, table)

    @classmethod
    def linear(cls, matrix: ArrayLike) -> PolynomialMap:
        """The map x -> M x, M of shape (m, n), of floats or (dtype object) of fractions."""
        given = np.asarray(matrix)
        # Integers would truncate what is added to them, and overflow when multiplied.
        rows = given + Fraction(0) if given.dtype == object else given.astype(np.float64)
        basis = monomials(rows.shape[1], 1)
        return cls(basis, np.concatenate([zeros((len(rows), 1), rows), rows], axis=1))

    @property
    def components(self) -> int:
        """The number of polynomials m."""
        return len(self.coefficients)

    @property
    def variables(self) -> int:
        """The number of variables n."""
        return self.basis.variables

    @property
    def degree(self) -> int:
        """The degree up to which terms are kept, whether or not there are any."""
        return self.basis.degree

    @property
    def exact(self) -> bool:
        """True if the coefficients are fractions."""
        return self.coefficients.dtype == object

    @property
    def matrix(self) -> Coefficients:
        """The linear part, shape (m, n)."""
        return self.coefficients[:, self.basis.part(1)]

    def terms(self) -> Iterator[tuple[int, tuple[int, ...], Any]]:
        """Component (from 0), exponents and coefficient of each term that is not zero."""
        for component, place in zip(*np.nonzero(self.coefficients), strict=True):
            powers = tuple(int(power) for power in self.basis.exponents[place])
            yield int(component), powers, self.coefficients[component, place]

    def upto(self, degree: int) -> PolynomialMap:
        """Truncated, or filled with zeros, at another degree."""
        basis = monomials(self.variables, degree)
        table = zeros((self.components, len(basis.exponents)), self.coefficients)
        kept = min(table.shape[1], self.coefficients.shape[1])
        table[:, :kept] = self.coefficients[:, :kept]
        return PolynomialMap(basis, table)

    def as_floats(self) -> PolynomialMap:
        """The same with floats for fractions."""
        return PolynomialMap(self.basis, self.coefficients.astype(np.float64))

    def __call__(self, points: ArrayLike) -> NDArray[Any]:
        """The values, shape (..., m), at points, shape (..., n)."""
        values = self._monomials(points)
        if values.ndim == 1:  # what an integrator asks for; `tensordot` takes longer to find it out
            return np.asarray(np.dot(self.coefficients, values))
        return np.moveaxis(np.tensordot(self.coefficients, values, axes=1), 0, -1)

    def parts(self, points: ArrayLike) -> NDArray[Any]:
        """The values of each homogeneous part: shape (degree + 1, ..., m)."""
        values = self._monomials(points)
        return np.array(
            [
                np.moveaxis(np.tensordot(self.coefficients[:, part], values[part], axes=1), 0, -1)
                for part in map(self.basis.part, range(self.degree + 1))
            ]
        )

    def _monomials(self, points: ArrayLike) -> NDArray[Any]:
        """All monomials at points, shape (N, ...)."""
        x = np.asarray(points)
        kind = np.result_type(x, self.coefficients)
        values = np.empty((len(self.basis.exponents), *x.shape[:-1]), kind)
        values[0] = 1
        for m in range(1, len(values)):
            values[m] = values[self.basis.parent[m]] * x[..., self.basis.variable[m]]
        return values

    def jacobian(self) -> PolynomialMap:
        """The derivatives, one degree less: component n c + i is that of component c by x_i."""
        basis = monomials(self.variables, max(1, self.degree - 1))
        size = len(self.basis.exponents)
        table = zeros((self.components * self.variables, size), self.coefficients)
        for d in range(1, self.degree + 1):
            jacobian_part(self.basis, self.coefficients, d, table)
        return PolynomialMap(basis, table[:, : len(basis.exponents)])

    def after(self, inner: PolynomialMap, degree: int) -> PolynomialMap:
        """The composition self(inner(x)), truncated at ``degree``, of inner without constant terms.

        Raises
        ------
        InputError
            If the number of inner components is wrong or inner has constant terms.
        """
        if inner.components != self.variables:
            raise InputError(
                "inner", f"has {inner.components} components, must have {self.variables}"
            )
        if np.any(inner.coefficients[:, 0] != 0):
            raise InputError("inner", "has constant terms, must be zero at the origin")
        series = inner.upto(degree)
        outer = self.upto(min(self.degree, degree))
        wanted = np.flatnonzero(np.any(outer.coefficients != 0, axis=0))
        powers = Powers(series.basis, series.coefficients, outer.basis, wanted)
        for d in range(2, degree + 1):
            powers.extend(d)
        powers.close()
        return PolynomialMap(series.basis, outer.coefficients[:, powers.places] @ powers.table)

    def inverse(self) -> PolynomialMap:
        """The power series of the inverse map, of which the linear part must be the identity.

        Raises
        ------
        InputError
            If there are constant terms or the linear part is another.
        """
        n = self.variables
        identity = np.concatenate([np.zeros((self.components, 1)), np.eye(self.components, n)], 1)
        if self.components != n or np.any(self.coefficients[:, : n + 1] != identity):
            raise InputError("map", "must be the identity up to terms of degree 2 and above")
        inverse = zeros(self.coefficients.shape, self.coefficients)
        inverse[:, : n + 1] = self.coefficients[:, : n + 1]
        higher = self.coefficients.copy()
        higher[:, : n + 1] = 0
        powers = Powers(self.basis, inverse, self.basis, np.arange(len(self.basis.exponents)))
        for d in range(2, self.degree + 1):
            powers.extend(d)
            inverse[:, self.basis.part(d)] = -powers.part(higher, d)
        return PolynomialMap(self.basis, inverse)


def stacked(maps: Sequence[PolynomialMap]) -> PolynomialMap:
    """The components of several maps of the same variables, one after the other."""
    degree = max(part.degree for part in maps)
    tables = [part.upto(degree).coefficients for part in maps]
    return PolynomialMap(monomials(maps[0].variables, degree), np.concatenate(tables))


def _term(
    place: str, term: Mapping[str, Any], components: int, variables: int
) -> tuple[int, tuple[int, ...], Fraction]:
    keys = ("component", "powers", "coefficient")
    if not isinstance(term, Mapping) or set(term) != set(keys):
        raise InputError(place, f"{term!r} must have the keys {', '.join(keys)} and no others")
    component, powers = term["component"], term["powers"]
    if not _is_count(component) or not 1 <= component <= components:
        raise InputError(f"{place}.component", f"{component!r} must be from 1 to {components}")
    if not _are_powers(powers, variables):
        raise InputError(
            f"{place}.powers", f"{powers!r} must be {variables} whole numbers, none negative"
        )
    given = term["coefficient"]
    try:
        if isinstance(given, bool):
            raise TypeError
        value = Fraction(str(given) if isinstance(given, float) else given)
        float(value)
    except (TypeError, ValueError, OverflowError, ZeroDivisionError):
        raise InputError(
            f"{place}.coefficient",
            f"{given!r} must be a finite number or a fraction such as 1/3",
        ) from None
    return component - 1, tuple(powers), value


def _is_count(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def _are_powers(value: Any, variables: int) -> bool:
    return (
        isinstance(value, Sequence)
        and not isinstance(value, str)
        and len(value) == variables
        and all(map(_is_count, value))
    )
