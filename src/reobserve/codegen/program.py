"""One step of an observer, built as C from statements on matrices of fixed shape.

A builder adds constants, memory and estimates by name, and statements in their order. Statements
that name a shape become loops over its entries.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from textwrap import wrap
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.codegen.expressions import (
    Expression,
    Name,
    Number,
    Operand,
    Outer,
    Product,
    Shape,
    Transposed,
    joined,
    of,
    signed,
)

Array = NDArray[np.float64]

WIDTH = 100
_LOOPS = ("i", "j", "k")

# L L' = S for the lower triangular L; NAN where S is not positive definite.
_CHOLESKY = """\
for (int32_t i = 0; i < {m}; ++i) {{
    for (int32_t j = 0; j < i + 1; ++j) {{
        double total = {S}[i][j];
        for (int32_t k = 0; k < j; ++k) {{
            total -= {L}[i][k] * {L}[j][k];
        }}
        if (i == j) {{
            if (total > {least} * {S}[i][i]) {{
                {L}[i][j] = sqrt(total);
            }} else {{
                {L}[i][j] = NAN;
            }}
        }} else {{
            {L}[i][j] = total / {L}[j][j];
            {L}[j][i] = 0.0;
        }}
    }}
}}
"""

# K L L' = C, row by row of K: down with L, up with L'.
_SOLVE_RIGHT = """\
for (int32_t i = 0; i < {n}; ++i) {{
    for (int32_t j = 0; j < {m}; ++j) {{
        double total = {C}[i][j];
        for (int32_t k = 0; k < j; ++k) {{
            total -= {L}[j][k] * {K}[i][k];
        }}
        {K}[i][j] = total / {L}[j][j];
    }}
    for (int32_t j = 0; j < {m}; ++j) {{
        double total = {K}[i][{last} - j];
        for (int32_t k = {m} - j; k < {m}; ++k) {{
            total -= {L}[k][{last} - j] * {K}[i][k];
        }}
        {K}[i][{last} - j] = total / {L}[{last} - j][{last} - j];
    }}
}}
"""

# L w = e.
_SOLVE_LOWER = """\
for (int32_t i = 0; i < {m}; ++i) {{
    double total = {e}[i];
    for (int32_t k = 0; k < i; ++k) {{
        total -= {L}[i][k] * {w}[k];
    }}
    {w}[i] = total / {L}[i][i];
}}
"""


@dataclass(frozen=True, eq=False)
class Variable:
    """A value that a step remembers, with its start, or an estimate.

    ``size`` is the smallest size that errors of an estimate are compared with.
    """

    initial: Array
    counter: bool = False
    size: float = 0.0


@dataclass
class Block:
    """Lines of C, and the shapes of the variables that they assign."""

    lines: list[str] = field(default_factory=list)
    variables: dict[str, Shape] = field(default_factory=dict)
    temporaries: int = 0


@dataclass(frozen=True, eq=False)
class Function:
    """A function of vectors that the step calls more than once."""

    name: str
    arguments: tuple[Name, ...]
    result: Name
    block: Block


class Program:
    """One step: from ``y`` and ``u`` of a row, and the memory, to the estimates."""

    def __init__(self, title: str, measurements: int, inputs: int) -> None:
        self.title, self.measurements, self.inputs = title, measurements, inputs
        self.y, self.u = Name("y", (measurements,)), Name("u", (inputs,))
        self.constants: dict[str, Array] = {}
        self.memory: dict[str, Variable] = {}
        self.estimates: dict[str, Variable] = {}
        self.functions: list[Function] = []
        self.body = Block()
        self._locals: dict[str, Shape] = {}
        self._block, self._depth = self.body, 1

    # --- Names ---

    def constant(self, name: str, values: ArrayLike) -> Name:
        """A number or array that does not change."""
        self.constants[name] = np.array(values, dtype=np.float64)
        return Name(name, self.constants[name].shape)

    def remember(self, name: str, initial: ArrayLike) -> Name:
        """A part of the memory, and its value at the start."""
        self.memory[name] = Variable(np.array(initial, dtype=np.float64))
        return Name(f"memory->{name}", self.memory[name].initial.shape)

    def counter(self, name: str, initial: int = 0) -> Name:
        """A whole number in the memory."""
        self.memory[name] = Variable(np.array(float(initial)), counter=True)
        return Name(f"memory->{name}")

    def local(self, name: str, shape: Shape = ()) -> Name:
        """A variable of the step, or of the function that assigns it."""
        self._locals[name] = shape
        return Name(name, shape)

    # --- Statements ---

    def line(self, text: str) -> None:
        """A line of C, broken where it is too long."""
        for part in wrap(text, WIDTH, **margins("    " * self._depth)):
            self._block.lines.append(f"{part}\n")

    def let(self, target: Name, value: Operand, symmetric: bool = False) -> Name:
        """``target`` becomes ``value``, which may read it.

        Of a ``symmetric`` value the lower half is computed, and copied.
        """
        self._assigned(target)
        terms = [
            (sign, term.mapped(self._as_name) if isinstance(term, Product) else self._simple(term))
            for sign, term in signed(of(value))
        ]
        # Entries that are overwritten may be read again by products and transposed matrices.
        again = any(_reads_again(term, target.name) for _, term in terms)
        into = self._temporary(target.shape) if again and target.shape else target
        with self.entries(target.shape, symmetric) as at:
            self._entry(into, terms, at)
            if symmetric:
                self.line(f"{into[at[::-1]]} = {into[at]};")
        if into is not target:
            with self.entries(target.shape) as at:
                self.line(f"{target[at]} = {into[at]};")
        return target

    def flag(self, target: Name, condition: str) -> Name:
        """``target`` becomes 1 where a condition in C holds, else 0."""
        self._assigned(target)
        self.line(f"{target} = ({condition}) ? 1.0 : 0.0;")
        return target

    def estimate(self, name: str, value: Expression, size: float = 0.0) -> None:
        """Report the value of an estimate (see `Variable`)."""
        self.estimates[name] = Variable(np.zeros(value.shape), size=size)
        self.let(Name(f"estimate->{name}", value.shape), value)

    def estimate_part(self, name: str, values: Name, first: int, last: int) -> None:
        """Report a part of a vector as an estimate."""
        if (first, last) == (0, values.shape[0]):
            self.estimate(name, values)
            return
        part = self.local(f"{name}_part", (last - first,))
        for place in range(first, last):
            self.let(part[place - first], values[place])
        self.estimate(name, part)

    def apply(self, target: Name, function: str, *arguments: Name) -> Name:
        """``target`` becomes the value of one of the functions."""
        self._assigned(target)
        self.line(f"{function}({', '.join(map(str, (*arguments, target)))});")
        return target

    def cholesky(self, L: Name, S: Name, least: float = 0.0) -> None:
        """``L`` becomes the lower factor of a symmetric matrix, NAN if it is not definite.

        Of each diagonal entry of ``S`` more than the part ``least`` must be left.
        """
        self.code(L, _CHOLESKY, L=L, S=S, m=S.shape[0], least=least)

    def solve_right(self, K: Name, C: Name, L: Name) -> None:
        """``K`` becomes C (L L')^-1."""
        n, m = C.shape
        self.code(K, _SOLVE_RIGHT, K=K, C=C, L=L, n=n, m=m, last=m - 1)

    def solve_lower(self, w: Name, L: Name, e: Name) -> None:
        """``w`` becomes L^-1 e, for a lower triangular L."""
        self.code(w, _SOLVE_LOWER, w=w, L=L, e=e, m=e.shape[0])

    def code(self, target: Name, template: str, **parts: Name | int | float) -> None:
        """Add lines of C that assign a target, a template whose places names and numbers take."""
        self._assigned(target)
        space = "    " * self._depth
        text = template.format(**parts)
        self._block.lines += [f"{space}{line}\n" for line in text.splitlines()]

    def advance(self, counter: Name, period: int | None = None) -> None:
        """A counter goes on by one, and starts again at ``period``."""
        self.line(f"{counter} += 1;")
        if period is not None:
            with self.when(f"{counter} >= {period}"):
                self.line(f"{counter} = 0;")

    @contextmanager
    def when(self, condition: str) -> Iterator[None]:
        """Statements under a condition, in C."""
        with self._braces(f"if ({condition}) {{"):
            yield

    @contextmanager
    def otherwise(self) -> Iterator[None]:
        """Statements for when the condition right before does not hold."""
        self._block.lines.pop()
        with self._braces("} else {"):
            yield

    @contextmanager
    def for_each(self, variable: str, count: int | str) -> Iterator[str]:
        """Statements for each value of a variable from 0 to below ``count``."""
        with self._braces(f"for (int32_t {variable} = 0; {variable} < {count}; ++{variable}) {{"):
            yield variable

    @contextmanager
    def function(self, name: str, arguments: Sequence[Name], result: Name) -> Iterator[None]:
        """The body of a function."""
        outside = self._block, self._depth
        self._block, self._depth = Block(), 1
        self.functions.append(Function(name, tuple(arguments), result, self._block))
        yield
        self._block.variables.pop(result.name, None)
        self._block, self._depth = outside

    # --- Lines of C ---

    @contextmanager
    def _braces(self, head: str) -> Iterator[None]:
        space = "    " * self._depth
        self._block.lines.append(f"{space}{head}\n")
        self._depth += 1
        yield
        self._depth -= 1
        self._block.lines.append(f"{space}}}\n")

    def _assigned(self, target: Name) -> None:
        if target.name in self._locals:
            self._block.variables[target.name] = self._locals[target.name]

    def _temporary(self, shape: Shape) -> Name:
        self._block.temporaries += 1
        name = Name(f"part_{self._block.temporaries}", shape)
        self._block.variables[name.name] = shape
        return name

    @contextmanager
    def entries(self, shape: Shape, lower: bool = False) -> Iterator[tuple[str, ...]]:
        """Loops over all entries of an array, or over the lower half of a matrix."""
        if not shape:
            yield ()
            return
        index = _LOOPS[: len(shape)]
        counts: list[int | str] = [shape[0], "i + 1"] if lower else list(shape)
        with self._nested(list(zip(index, counts, strict=True))):
            yield index

    @contextmanager
    def _nested(self, loops: list[tuple[str, int | str]]) -> Iterator[None]:
        if not loops:
            yield
            return
        with self.for_each(*loops[0]), self._nested(loops[1:]):
            yield

    def _entry(self, into: Name, terms: list[tuple[int, Expression]], at: tuple[str, ...]) -> None:
        """One entry: what is plain, then products by a loop each."""
        plain = [(sign, term.at(at)) for sign, term in terms if not isinstance(term, Product)]
        products = [(sign, term) for sign, term in terms if isinstance(term, Product)]
        start = joined(plain) if plain else "0.0"
        if not products:
            self.line(f"{into[at]} = {start};")
            return
        self.line(f"double total = {start};")
        for sign, product in products:
            left, right = product.parts
            row, column, k = at[: len(left.shape) - 1], at[len(left.shape) - 1 :], _LOOPS[len(at)]
            if left.shape[-1]:
                with self.for_each(k, left.shape[-1]):
                    factors = f"{left.at((*row, k))} * {right.at((k, *column))}"
                    self.line(f"total {'+' if sign > 0 else '-'}= {factors};")
        self.line(f"{into[at]} = total;")

    def _as_name(self, part: Expression) -> Expression:
        """A name, or one transposed, for any matrix."""
        if isinstance(part, Transposed):
            return part.mapped(self._as_name)
        return part if isinstance(part, Name) else self.let(self._temporary(part.shape), part)

    def _simple(self, part: Expression) -> Expression:
        """A term without products of matrices in it."""
        if isinstance(part, Product | Transposed):
            return self._as_name(part)
        return part.mapped(self._simple)


def _reads_again(term: Expression, name: str) -> bool:
    """True if a term reads an array at other entries than the one that it computes."""
    if isinstance(term, Product | Outer | Transposed):
        return _reads(term, name)
    return any(_reads_again(part, name) for part in term.parts)


def _reads(part: Expression, name: str) -> bool:
    return any(_reads(each, name) for each in part.parts) or getattr(part, "name", None) == name


def margins(space: str) -> dict[str, Any]:
    """Breaks of lines of C."""
    return {
        "initial_indent": space, "subsequent_indent": f"{space}    ", "break_long_words": False,
        "break_on_hyphens": False,
    }  # fmt: skip


ZERO, ONE = Number(0.0), Number(1.0)
