"""One entry of an expression as text that C and Python share; it has no products of matrices."""

from __future__ import annotations

from functools import singledispatch

from reobserve.codegen.expressions import (
    Call,
    Expression,
    Name,
    Number,
    Outer,
    Quotient,
    Scaled,
    Sum,
    Transposed,
)

Index = tuple[str, ...]


def text(name: Name) -> str:
    """A name with its index."""
    return name.name + _bracketed(name.index)


def signed(terms: list[tuple[int, str]]) -> str:
    """A sum of texts."""
    first, *rest = terms
    told = f"-{first[1]}" if first[0] < 0 else first[1]
    return told + "".join(f" {'-' if sign < 0 else '+'} {term}" for sign, term in rest)


@singledispatch
def element(part: Expression, index: Index) -> str:
    """The entry at an index, as many texts as the part has axes."""
    raise TypeError(f"{type(part).__name__} has no entries of its own")


@element.register
def _(part: Number, index: Index) -> str:
    return repr(part.value) if part.value >= 0 else f"({part.value!r})"


@element.register
def _(part: Name, index: Index) -> str:
    return text(part) + _bracketed(index)


@element.register
def _(part: Transposed, index: Index) -> str:
    return element(part.of, index[::-1])


@element.register
def _(part: Sum, index: Index) -> str:
    return f"({_plain(part, index)})"


@element.register
def _(part: Scaled, index: Index) -> str:
    return f"{_within(part.factor, index)} * {element(part.of, index)}"


@element.register
def _(part: Quotient, index: Index) -> str:
    below = _within(part.below, index)
    plain = isinstance(part.below, Name | Number | Sum | Call)
    return f"{element(part.above, index)} / {below if plain else f'({below})'}"


@element.register
def _(part: Outer, index: Index) -> str:
    size = len(part.left.shape)
    return f"{element(part.left, index[:size])} * {element(part.right, index[size:])}"


@element.register
def _(part: Call, index: Index) -> str:
    given = ", ".join(_plain(one, index) for one in part.arguments)
    return f"{part.function}({given})"


def _plain(part: Expression, index: Index) -> str:
    """A part that needs no parentheses around it."""
    if not isinstance(part, Sum):
        return _within(part, index)
    return signed([(sign, _within(term, index)) for sign, term in part.terms])


def _within(part: Expression, index: Index) -> str:
    """A part that may be a number among vectors."""
    return element(part, index if part.shape else ())


def _bracketed(index: Index) -> str:
    return "".join(f"[{one}]" for one in index)
