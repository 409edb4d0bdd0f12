"""Expressions on numbers, vectors and matrices of fixed shape: what statements compute."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Union

Shape = tuple[int, ...]
Operand = Union["Expression", float]


class Expression:
    """What has a shape: () of a number, (n,) of a vector, (n, m) of a matrix."""

    shape: Shape

    def mapped(self, change: Callable[[Expression], Expression]) -> Expression:
        """The same of changed parts."""
        return self

    def __add__(self, other: Operand) -> Expression:
        return Sum((*_terms(self), *_terms(of(other))))

    def __radd__(self, other: Operand) -> Expression:
        return of(other) + self

    def __sub__(self, other: Operand) -> Expression:
        return Sum((*_terms(self), *((-sign, term) for sign, term in _terms(of(other)))))

    def __neg__(self) -> Expression:
        return Sum(tuple((-sign, term) for sign, term in _terms(self)))

    def __mul__(self, other: Operand) -> Expression:
        return Scaled(of(other), self) if of(other).shape == () else Scaled(self, of(other))

    def __rmul__(self, other: Operand) -> Expression:
        return Scaled(of(other), self)

    def __truediv__(self, other: Operand) -> Expression:
        return Quotient(self, of(other))

    def __rtruediv__(self, other: Operand) -> Expression:
        return Quotient(of(other), self)

    def __matmul__(self, other: Expression) -> Expression:
        return Product(self, other)

    @property
    def T(self) -> Expression:
        """Transposed."""
        return Transposed(self)


@dataclass(frozen=True, eq=False)
class Name(Expression):
    """A variable or constant, or a part of one: ``index`` are numbers or variables of loops."""

    name: str
    shape: Shape = ()
    index: tuple[str, ...] = ()

    def __getitem__(self, place: int | str | tuple[int | str, ...]) -> Name:
        places = place if isinstance(place, tuple) else (place,)
        more = tuple(str(one) for one in places)
        return Name(self.name, self.shape[len(more) :], self.index + more)


@dataclass(frozen=True, eq=False)
class Number(Expression):
    """A number."""

    value: float
    shape: Shape = ()


@dataclass(frozen=True, eq=False)
class Sum(Expression):
    """A sum of terms of one shape, each with its sign."""

    terms: tuple[tuple[int, Expression], ...]

    @property
    def shape(self) -> Shape:  # type: ignore[override]
        """That of all terms."""
        return self.terms[0][1].shape

    def mapped(self, change: Callable[[Expression], Expression]) -> Expression:
        """The same of changed parts."""
        return Sum(tuple((sign, change(term)) for sign, term in self.terms))


@dataclass(frozen=True, eq=False)
class Scaled(Expression):
    """A number times something."""

    factor: Expression
    of: Expression

    @property
    def shape(self) -> Shape:  # type: ignore[override]
        """That of what is scaled."""
        return self.of.shape

    def mapped(self, change: Callable[[Expression], Expression]) -> Expression:
        """The same of changed parts."""
        return Scaled(change(self.factor), change(self.of))


@dataclass(frozen=True, eq=False)
class Quotient(Expression):
    """Something divided by a number."""

    above: Expression
    below: Expression

    @property
    def shape(self) -> Shape:  # type: ignore[override]
        """That of what is divided."""
        return self.above.shape

    def mapped(self, change: Callable[[Expression], Expression]) -> Expression:
        """The same of changed parts."""
        return Quotient(change(self.above), change(self.below))


@dataclass(frozen=True, eq=False)
class Product(Expression):
    """A product of matrices and vectors."""

    left: Expression
    right: Expression

    @property
    def shape(self) -> Shape:  # type: ignore[override]
        """What matrix multiplication leaves."""
        return self.left.shape[:-1] + self.right.shape[1:]

    def mapped(self, change: Callable[[Expression], Expression]) -> Expression:
        """The same of changed parts."""
        return Product(change(self.left), change(self.right))


@dataclass(frozen=True, eq=False)
class Outer(Expression):
    """A column times a row."""

    left: Expression
    right: Expression

    @property
    def shape(self) -> Shape:  # type: ignore[override]
        """A matrix."""
        return self.left.shape + self.right.shape

    def mapped(self, change: Callable[[Expression], Expression]) -> Expression:
        """The same of changed parts."""
        return Outer(change(self.left), change(self.right))


@dataclass(frozen=True, eq=False)
class Transposed(Expression):
    """A matrix with rows for columns."""

    of: Expression

    @property
    def shape(self) -> Shape:  # type: ignore[override]
        """The other way round."""
        return self.of.shape[::-1]

    def mapped(self, change: Callable[[Expression], Expression]) -> Expression:
        """The same of changed parts."""
        return Transposed(change(self.of))


@dataclass(frozen=True, eq=False)
class Call(Expression):
    """A function of numbers, by its name in C, which Python's ``math`` has too."""

    function: str
    arguments: tuple[Expression, ...]
    shape: Shape = ()

    def mapped(self, change: Callable[[Expression], Expression]) -> Expression:
        """The same of changed parts."""
        return Call(self.function, tuple(map(change, self.arguments)), self.shape)


def of(value: Operand) -> Expression:
    """A number as an expression."""
    return value if isinstance(value, Expression) else Number(float(value))


def call(function: str, *arguments: Operand) -> Call:
    """A function of numbers."""
    return Call(function, tuple(map(of, arguments)))


def total(terms: Iterable[Expression]) -> Expression:
    """The sum of several; zero of none."""
    among = tuple(part for term in terms for part in _terms(term))
    return Sum(among) if among else Number(0.0)


def _terms(expression: Expression) -> tuple[tuple[int, Expression], ...]:
    return expression.terms if isinstance(expression, Sum) else ((1, expression),)
