"""Statements on matrices as loops over numbers, in words that C and Python share.

A line is text such as ``total += A[i][k] * x[k]``: what C and Python write alike. Printers add what
they do not, and put the places of constants, memory and estimates for their names.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

from reobserve.codegen.entries import element, signed, text
from reobserve.codegen.expressions import (
    Expression,
    Name,
    Outer,
    Product,
    Scaled,
    Shape,
    Sum,
    Transposed,
)
from reobserve.codegen.statements import (
    Advance,
    Apply,
    Assign,
    Cholesky,
    ForEach,
    SetCounter,
    SolveLower,
    SolveRight,
    Statement,
    When,
)

_LOOPS = ("i", "j", "k")


@dataclass(frozen=True)
class Line:
    """An assignment, or a call; ``declares`` if a number is first named here."""

    text: str
    declares: bool = False


@dataclass(frozen=True)
class Loop:
    """Lines for each ``variable`` from ``first`` to below ``end``."""

    variable: str
    first: str
    end: str
    body: tuple[Lowered, ...]


@dataclass(frozen=True)
class Branch:
    """Lines under a condition."""

    condition: str
    then: tuple[Lowered, ...]
    otherwise: tuple[Lowered, ...]


Lowered: TypeAlias = "Line | Loop | Branch"


@dataclass
class Block:
    """Lines, and the variables that they need: shapes by name."""

    lines: list[Lowered] = field(default_factory=list)
    variables: dict[str, Shape] = field(default_factory=dict)


def lowered(statements: Sequence[Statement], known: Mapping[str, Shape]) -> Block:
    """The statements as lines; ``known`` are the shapes of variables that need room."""
    maker = _Maker(known)
    lines = maker.all(statements)
    return Block(lines, maker.variables)


class _Maker:
    def __init__(self, known: Mapping[str, Shape]) -> None:
        self.known, self.variables = known, dict[str, Shape]()
        self.temporaries = 0

    def all(self, statements: Sequence[Statement]) -> list[Lowered]:
        return [line for statement in statements for line in self.one(statement)]

    def one(self, statement: Statement) -> Iterator[Lowered]:
        if not isinstance(statement, When | ForEach):
            name = statement.target.name
            if name in self.known:
                self.variables[name] = self.known[name]
        if isinstance(statement, Assign):
            yield from self.assign(statement.target, statement.value, statement.symmetric)
        elif isinstance(statement, Apply):
            given = ", ".join(map(text, (*statement.arguments, statement.target)))
            yield Line(f"{statement.function}({given})")
        elif isinstance(statement, When):
            then, otherwise = self.all(statement.then), self.all(statement.otherwise)
            yield Branch(statement.condition, tuple(then), tuple(otherwise))
        elif isinstance(statement, ForEach):
            body = tuple(self.all(statement.body))
            yield Loop(statement.variable, "0", str(statement.count), body)
        elif isinstance(statement, SetCounter):
            yield Line(f"{text(statement.target)} = {statement.value}")
        elif isinstance(statement, Advance):
            yield Line(f"{text(statement.target)} += 1")
            if statement.period is not None:
                start = (Line(f"{text(statement.target)} = 0"),)
                yield Branch(f"{text(statement.target)} >= {statement.period}", start, ())
        else:
            yield from _SOLVERS[type(statement)](statement)

    def temporary(self, shape: Shape) -> Name:
        self.temporaries += 1
        name = Name(f"part_{self.temporaries}", shape)
        self.variables[name.name] = shape
        return name

    def assign(self, target: Name, value: Expression, symmetric: bool = False) -> Iterator[Lowered]:
        terms: list[tuple[int, Expression]] = []
        for sign, term in value.terms if isinstance(value, Sum) else ((1, value),):
            made, kept = self.operands(term) if isinstance(term, Product) else self.simple(term)
            yield from made
            terms.append((sign, kept))
        read = any(
            _reads(term, target.name) for _, term in terms if isinstance(term, Product | Outer)
        ) or any(_turned(term, target.name) for _, term in terms)
        into = self.temporary(target.shape) if read and target.shape else target
        if symmetric:
            mirrored = Line(f"{text(into)}[j][i] = {text(into)}[i][j]")
            lines = (*_entry(into, terms, "[i][j]"), mirrored)
            yield Loop("i", "0", str(target.shape[0]), (Loop("j", "0", "i + 1", lines),))
        else:
            yield from nest(target.shape, lambda at: _entry(into, terms, at))
        if into is not target:
            copy = f"{text(target)}{{at}} = {text(into)}{{at}}"
            yield from nest(target.shape, lambda at: [Line(copy.format(at=at))])

    def operands(self, term: Product) -> tuple[list[Lowered], Expression]:
        """A product of two matrices, each of them a name or one transposed."""
        made: list[Lowered] = []
        sides = []
        for side in (term.left, term.right):
            plain = side.of if isinstance(side, Transposed) else side
            if isinstance(plain, Name):
                sides.append(side)
                continue
            name = self.temporary(plain.shape)
            made += self.assign(name, plain)
            sides.append(Transposed(name) if isinstance(side, Transposed) else name)
        return made, Product(sides[0], sides[1])

    def simple(self, term: Expression) -> tuple[list[Lowered], Expression]:
        """A term without products of matrices in it."""
        made: list[Lowered] = []

        def walk(part: Expression) -> Expression:
            if isinstance(part, Product):
                name = self.temporary(part.shape)
                made.extend(self.assign(name, part))
                return name
            if isinstance(part, Transposed) and not isinstance(part.of, Name):
                name = self.temporary(part.of.shape)
                made.extend(self.assign(name, part.of))
                return Transposed(name)
            return part.mapped(walk)

        return made, walk(term)


def nest(shape: Shape, body: Callable[[str], Sequence[Lowered]]) -> Iterator[Lowered]:
    """Loops over all entries; ``body`` gives the lines of one, for its index in brackets."""
    index = "".join(f"[{name}]" for name in _LOOPS[: len(shape)])
    lines = tuple(body(index))
    for name, size in reversed(list(zip(_LOOPS, shape, strict=False))):
        lines = (Loop(name, "0", str(size), lines),)
    yield from lines


def _entry(target: Name, terms: list[tuple[int, Expression]], at: str) -> list[Lowered]:
    """The lines of one entry: what is plain, then products by a loop each."""
    index = tuple(at[1:-1].split("][")) if at else ()
    plain = [(sign, term) for sign, term in terms if not isinstance(term, Product)]
    products = [(sign, term) for sign, term in terms if isinstance(term, Product)]
    start = signed([(sign, element(term, index)) for sign, term in plain]) if plain else "0.0"
    if not products:
        return [Line(f"{text(target)}{at} = {start}")]
    lines: list[Lowered] = [Line(f"total = {start}", declares=True)]
    for sign, product in products:
        left, right = product.left, product.right
        row, column = index[: len(left.shape) - 1], index[len(left.shape) - 1 :]
        size, k = left.shape[-1], _LOOPS[len(index)]
        one = f"{element(left, (*row, k))} * {element(right, (k, *column))}"
        more = Line(f"total {'+' if sign > 0 else '-'}= {one}")
        if size:
            lines.append(Loop(k, "0", str(size), (more,)))
    return [*lines, Line(f"{text(target)}{at} = total")]


def _reads(part: Expression, name: str) -> bool:
    if isinstance(part, Name):
        return part.name == name
    if isinstance(part, Product | Outer):
        return _reads(part.left, name) or _reads(part.right, name)
    return isinstance(part, Transposed) and _reads(part.of, name)


def _turned(part: Expression, name: str) -> bool:
    """Whether a part reads a matrix transposed, entry by entry."""
    if isinstance(part, Transposed):
        return _reads(part.of, name)
    if isinstance(part, Sum):
        return any(_turned(term, name) for _, term in part.terms)
    return isinstance(part, Scaled) and _turned(part.of, name)


def _cholesky(statement: Statement) -> Iterator[Lowered]:
    assert isinstance(statement, Cholesky)
    L, S = text(statement.target), text(statement.matrix)
    m = str(statement.matrix.shape[0])
    less = Loop("k", "0", "j", (Line(f"total -= {L}[i][k] * {L}[j][k]"),))
    root = Branch(
        "total > 0.0", (Line(f"{L}[i][j] = sqrt(total)"),), (Line(f"{L}[i][j] = NAN"),)
    )  # fmt: skip
    other = (Line(f"{L}[i][j] = total / {L}[j][j]"), Line(f"{L}[j][i] = 0.0"))
    column = (
        Line(f"total = {S}[i][j]", declares=True), less, Branch("i == j", (root,), other),
    )  # fmt: skip
    yield Loop("i", "0", m, (Loop("j", "0", "i + 1", column),))


def _solve_right(statement: Statement) -> Iterator[Lowered]:
    assert isinstance(statement, SolveRight)
    K, C, L = text(statement.target), text(statement.right), text(statement.factor)
    n, m = statement.right.shape
    down = (
        Line(f"total = {C}[i][j]", declares=True),
        Loop("k", "0", "j", (Line(f"total -= {L}[j][k] * {K}[i][k]"),)),
        Line(f"{K}[i][j] = total / {L}[j][j]"),
    )
    back = f"{m - 1} - j"
    up = (
        Line(f"total = {K}[i][{back}]", declares=True),
        Loop("k", f"{m} - j", str(m), (Line(f"total -= {L}[k][{back}] * {K}[i][k]"),)),
        Line(f"{K}[i][{back}] = total / {L}[{back}][{back}]"),
    )
    yield Loop("i", "0", str(n), (Loop("j", "0", str(m), down), Loop("j", "0", str(m), up)))


def _solve_lower(statement: Statement) -> Iterator[Lowered]:
    assert isinstance(statement, SolveLower)
    w, L, e = text(statement.target), text(statement.factor), text(statement.right)
    body = (
        Line(f"total = {e}[i]", declares=True),
        Loop("k", "0", "i", (Line(f"total -= {L}[i][k] * {w}[k]"),)),
        Line(f"{w}[i] = total / {L}[i][i]"),
    )
    yield Loop("i", "0", str(statement.right.shape[0]), body)


_SOLVERS = {Cholesky: _cholesky, SolveRight: _solve_right, SolveLower: _solve_lower}
