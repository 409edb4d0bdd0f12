"""Expressions on numbers, vectors and matrices of fixed shape, and their entries in C."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import TypeAlias

Shape = tuple[int, ...]
Index = tuple[str, ...]
Operand: TypeAlias = "Expression | float"


class Expression:
    """Something with a shape: () of a number, (n,) of a vector, (n, m) of a matrix."""

    shape: Shape = ()
    parts: tuple[Expression, ...] = ()

    def at(self, index: Index) -> str:
        """The entry at an index in C, which an expression with a `Product` inside has not."""
        return self._at(index if self.shape else ())

    def inside(self, index: Index) -> str:
        """The same where no parentheses are needed around a sum."""
        return self.at(index)[1:-1] if isinstance(self, Sum) else self.at(index)

    def _at(self, index: Index) -> str:
        raise NotImplementedError

    def mapped(self, change: Callable[[Expression], Expression]) -> Expression:
        """The same operation on changed parts."""
        return replace(self, parts=tuple(map(change, self.parts))) if self.parts else self  # type: ignore[type-var]

    def __add__(self, other: Operand) -> Expression:
        return summed([(1, self), (1, of(other))])

    def __radd__(self, other: Operand) -> Expression:
        return of(other) + self

    def __sub__(self, other: Operand) -> Expression:
        return summed([(1, self), (-1, of(other))])

    def __neg__(self) -> Expression:
        return summed([(-1, self)])

    def __mul__(self, other: Operand) -> Expression:
        return times(of(other), self) if of(other).shape == () else times(self, of(other))

    def __rmul__(self, other: Operand) -> Expression:
        return times(of(other), self)

    def __truediv__(self, other: Operand) -> Expression:
        below = of(other)
        form = "{} / ({})" if isinstance(below, Elementwise) and not below.call else "{} / {}"
        return Elementwise(form, (self, below), self.shape)

    def __rtruediv__(self, other: Operand) -> Expression:
        return of(other) / self

    def __matmul__(self, other: Expression) -> Expression:
        return Product((self, other), self.shape[:-1] + other.shape[1:])

    @property
    def T(self) -> Expression:
        """Transposed."""
        return Transposed((self,), self.shape[::-1])


@dataclass(frozen=True, eq=False)
class Name(Expression):
    """A variable or constant, or a part of one: ``index`` holds numbers or loop variables."""

    name: str
    shape: Shape = ()
    index: Index = ()

    def __getitem__(self, place: int | str | Name | tuple[int | str | Name, ...]) -> Name:
        places = place if isinstance(place, tuple) else (place,)
        more = tuple(str(entry) for entry in places)
        return Name(self.name, self.shape[len(more) :], self.index + more)

    def __str__(self) -> str:
        return self.at(())

    def _at(self, index: Index) -> str:
        return self.name + bracketed((*self.index, *index))


@dataclass(frozen=True, eq=False)
class Number(Expression):
    """A number, or an array that holds it everywhere."""

    value: float
    shape: Shape = ()

    def _at(self, index: Index) -> str:
        return repr(self.value) if self.value >= 0 else f"({self.value!r})"


@dataclass(frozen=True, eq=False)
class Sum(Expression):
    """A sum of terms of one shape, each with its sign."""

    signs: tuple[int, ...]
    parts: tuple[Expression, ...]
    shape: Shape

    def _at(self, index: Index) -> str:
        terms = zip(self.signs, self.parts, strict=True)
        return f"({joined([(sign, part.at(index)) for sign, part in terms])})"


@dataclass(frozen=True, eq=False)
class Elementwise(Expression):
    """An operation on each entry, in which numbers stand beside arrays. ``form`` is its C."""

    form: str
    parts: tuple[Expression, ...]
    shape: Shape = ()
    call: bool = False

    def _at(self, index: Index) -> str:
        if self.call:
            return self.form.format(", ".join(part.inside(index) for part in self.parts))
        return self.form.format(*(part.at(index) for part in self.parts))


@dataclass(frozen=True, eq=False)
class Product(Expression):
    """A product of matrices and vectors."""

    parts: tuple[Expression, ...]
    shape: Shape


@dataclass(frozen=True, eq=False)
class Outer(Expression):
    """A column times a row."""

    parts: tuple[Expression, ...]
    shape: Shape

    def _at(self, index: Index) -> str:
        left, right = self.parts
        return f"{left.at(index[: len(left.shape)])} * {right.at(index[len(left.shape) :])}"


@dataclass(frozen=True, eq=False)
class Transposed(Expression):
    """A matrix with rows for columns."""

    parts: tuple[Expression, ...]
    shape: Shape

    def _at(self, index: Index) -> str:
        return self.parts[0].at(index[::-1])


def of(value: Operand) -> Expression:
    """A number as an expression."""
    return value if isinstance(value, Expression) else Number(float(value))


def times(factor: Expression, value: Expression) -> Expression:
    """A number times something."""
    return Elementwise("{} * {}", (factor, value), value.shape)


def call(function: str, *arguments: Operand) -> Expression:
    """A function of numbers, by its name in C."""
    return Elementwise(f"{function}({{}})", tuple(map(of, arguments)), call=True)


def total(terms: Iterable[Expression]) -> Expression:
    """The sum of several, or zero of none."""
    among = [(1, term) for term in terms]
    return summed(among) if among else Number(0.0)


def outer(left: Expression, right: Expression) -> Expression:
    """A column times a row."""
    return Outer((left, right), left.shape + right.shape)


def summed(terms: Iterable[tuple[int, Expression]]) -> Expression:
    """The sum of signed terms. Sums among them are written out."""
    flat = [(sign * own, part) for sign, term in terms for own, part in signed(term)]
    signs, parts = zip(*flat, strict=True)
    return Sum(signs, parts, parts[0].shape)


def signed(expression: Expression) -> list[tuple[int, Expression]]:
    """The terms of a sum with their signs, where anything else is one term."""
    if isinstance(expression, Sum):
        return list(zip(expression.signs, expression.parts, strict=True))
    return [(1, expression)]


def joined(terms: list[tuple[int, str]]) -> str:
    """A sum of texts."""
    (sign, first), *rest = terms
    start = f"-{first}" if sign < 0 else first
    return start + "".join(f" {'-' if sign < 0 else '+'} {term}" for sign, term in rest)


def bracketed(index: Index) -> str:
    """An index in C."""
    return "".join(f"[{place}]" for place in index)
