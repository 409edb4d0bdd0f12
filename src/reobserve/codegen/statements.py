"""Statements on matrices, and the program that one step of an observer is made of."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.codegen.expressions import Expression, Name, Number, Operand, Shape, of

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Assign:
    """``target`` becomes ``value``; it may stand in it.

    Of what is ``symmetric`` the lower half is computed, and copied.
    """

    target: Name
    value: Expression
    symmetric: bool
    shown: bool


@dataclass(frozen=True, eq=False)
class Apply:
    """``target`` becomes the value of one of the program's functions."""

    target: Name
    function: str
    arguments: tuple[Name, ...]
    shown: bool


@dataclass(frozen=True, eq=False)
class Cholesky:
    """``target`` becomes the lower factor of a symmetric matrix, nan if it is not definite."""

    target: Name
    matrix: Name
    shown: bool


@dataclass(frozen=True, eq=False)
class SolveRight:
    """``target`` becomes ``right`` times the inverse of what ``factor`` is the lower factor of."""

    target: Name
    right: Name
    factor: Name
    shown: bool


@dataclass(frozen=True, eq=False)
class SolveLower:
    """``target`` becomes the inverse of a lower triangular matrix times a vector."""

    target: Name
    factor: Name
    right: Name
    shown: bool


@dataclass(frozen=True, eq=False)
class Advance:
    """A counter that is a state goes on by one, and starts again at ``period``."""

    target: Name
    period: int | None
    shown: bool


@dataclass(frozen=True, eq=False)
class SetCounter:
    """A counter that is a state becomes a whole number."""

    target: Name
    value: int
    shown: bool


@dataclass(frozen=True, eq=False)
class When:
    """Statements under a condition, a comparison as C and Python write it."""

    condition: str
    then: Sequence[Statement]
    otherwise: Sequence[Statement]
    said: str  # the condition in LaTeX
    shown: bool


@dataclass(frozen=True, eq=False)
class ForEach:
    """Statements for each value of a variable from 0 to below ``count``."""

    variable: str
    count: int
    body: Sequence[Statement]
    shown: bool


Statement: TypeAlias = (
    "Assign | Apply | Cholesky | SolveRight | SolveLower | Advance | SetCounter | When | ForEach"
)


@dataclass(frozen=True, eq=False)
class Constant:
    """A number or array that does not change; ``gain`` if a table of gains is to list it."""

    values: Array
    symbol: str
    gain: bool = False


@dataclass(frozen=True, eq=False)
class Variable:
    """What a step remembers, with its value at the start, or what it tells.

    ``size`` is what errors of an estimate are small against, if not its largest value.
    """

    initial: Array
    symbol: str
    counter: bool = False
    size: float = 0.0


@dataclass(frozen=True, eq=False)
class Function:
    """A function of vectors that the step applies more than once."""

    name: str
    arguments: tuple[Name, ...]
    result: Name
    body: Sequence[Statement]
    symbol: str


@dataclass(eq=False)
class Program:
    """One step: from ``y`` and ``u`` of a row, and what is remembered, to the estimates.

    A builder adds constants, memory and estimates by name, and statements in their order.
    ``symbols`` are those of names in LaTeX; ``notes`` sentences on what the equations leave out.
    """

    title: str
    measurements: int
    inputs: int
    constants: dict[str, Constant] = field(default_factory=dict)
    memory: dict[str, Variable] = field(default_factory=dict)
    estimates: dict[str, Variable] = field(default_factory=dict)
    locals: dict[str, Shape] = field(default_factory=dict)
    functions: list[Function] = field(default_factory=list)
    body: list[Statement] = field(default_factory=list)
    symbols: dict[str, str] = field(default_factory=lambda: {"y": "y_k", "u": "u_k"})
    notes: list[str] = field(default_factory=list)
    _places: list[list[Statement]] = field(default_factory=list)
    _hidden: bool = False

    def __post_init__(self) -> None:
        self._places = [self.body]
        self.y, self.u = Name("y", (self.measurements,)), Name("u", (self.inputs,))

    # --- What there is ---

    def constant(self, name: str, values: ArrayLike, symbol: str = "", gain: bool = False) -> Name:
        """A constant; `Name` to be used in expressions."""
        array = np.array(values, dtype=np.float64)
        self.constants[name] = Constant(array, symbol or name, gain)
        return self._named(name, array.shape, symbol)

    def remember(self, name: str, initial: ArrayLike, symbol: str = "") -> Name:
        """A part of the state, and what it starts from."""
        array = np.array(initial, dtype=np.float64)
        self.memory[name] = Variable(array, symbol or name)
        return self._named(name, array.shape, symbol)

    def counter(self, name: str, initial: int = 0, symbol: str = "") -> Name:
        """A whole number among the state."""
        self.memory[name] = Variable(np.array(float(initial)), symbol or name, counter=True)
        return self._named(name, (), symbol)

    def estimate(self, name: str, value: Expression, symbol: str = "", size: float = 0.0) -> None:
        """Tell the value of an estimate; see `Variable`."""
        self.estimates[name] = Variable(np.zeros(value.shape), symbol or name, size=size)
        target = Name(estimate_name(name), value.shape)
        self._add(Assign(target, value, symmetric=False, shown=False))

    def local(self, name: str, shape: Shape, symbol: str = "") -> Name:
        """A variable of the step itself, or of one of its functions."""
        self.locals[name] = shape
        return self._named(name, shape, symbol)

    def _named(self, name: str, shape: Shape, symbol: str) -> Name:
        self.symbols.setdefault(name, symbol or name)
        return Name(name, shape)

    # --- What is done ---

    def _add(self, statement: Any) -> None:
        self._places[-1].append(statement)

    def let(self, target: Name, value: Operand, symmetric: bool = False) -> Name:
        """``target`` becomes ``value``; see `Assign`."""
        self._add(Assign(target, of(value), symmetric, shown=not self._hidden))
        return target

    def apply(self, target: Name, function: str, *arguments: Name) -> Name:
        """``target`` becomes the value of a function of the program."""
        self._add(Apply(target, function, arguments, shown=not self._hidden))
        return target

    def cholesky(self, target: Name, matrix: Name) -> None:
        """See `Cholesky`."""
        self._add(Cholesky(target, matrix, shown=not self._hidden))

    def solve_right(self, target: Name, right: Name, factor: Name) -> None:
        """See `SolveRight`."""
        self._add(SolveRight(target, right, factor, shown=not self._hidden))

    def solve_lower(self, target: Name, factor: Name, right: Name) -> None:
        """See `SolveLower`."""
        self._add(SolveLower(target, factor, right, shown=not self._hidden))

    def advance(self, counter: Name, period: int | None = None) -> None:
        """See `Advance`."""
        self._add(Advance(counter, period, shown=not self._hidden))

    def set_counter(self, counter: Name, value: int) -> None:
        """See `SetCounter`; never among the equations."""
        self._add(SetCounter(counter, value, shown=False))

    @contextmanager
    def when(self, condition: str, said: str = "") -> Iterator[list[Statement]]:
        """Statements under a condition; what is yielded takes those for when it does not hold."""
        then: list[Statement] = []
        otherwise: list[Statement] = []
        self._add(When(condition, then, otherwise, said, shown=not self._hidden))
        with self._inside(then):
            yield otherwise

    @contextmanager
    def otherwise(self, place: list[Statement]) -> Iterator[None]:
        """The statements for when the condition does not hold."""
        with self._inside(place):
            yield

    @contextmanager
    def for_each(self, variable: str, count: int) -> Iterator[str]:
        """Statements for each value of a variable."""
        body: list[Statement] = []
        with self._inside(body):
            yield variable
        self._add(ForEach(variable, count, body, shown=not self._hidden))

    @contextmanager
    def function(
        self, name: str, arguments: Sequence[Name], result: Name, symbol: str = ""
    ) -> Iterator[None]:
        """The body of a function."""
        body: list[Statement] = []
        with self._inside(body):
            yield
        self.functions.append(Function(name, tuple(arguments), result, body, symbol or name))

    @contextmanager
    def hidden(self) -> Iterator[None]:
        """Statements that the equations leave out."""
        before, self._hidden = self._hidden, True
        yield
        self._hidden = before

    @contextmanager
    def _inside(self, place: list[Statement]) -> Iterator[None]:
        self._places.append(place)
        yield
        self._places.pop()


def estimate_name(name: str) -> str:
    """What statements call an estimate, so that it is not taken for a variable."""
    return f"estimate_{name}"


ZERO, ONE = Number(0.0), Number(1.0)
