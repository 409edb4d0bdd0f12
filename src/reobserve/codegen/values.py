"""Numbers and arrays of C, as the translator of kernels handles them."""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
Reads = frozenset[Hashable]
Bounds = tuple[float, float]

# How strongly operators of C bind.
TERNARY, OR, AND, COMPARED, SUM, PRODUCT, SIGN, ATOM = range(8)

LARGEST = 2**31 - 1
NOTHING: Reads = frozenset()

# From where to where whole numbers are, of which some are not negative, and some 0 or 1.
ANYWHERE, NATURAL, TRUTH = (-math.inf, math.inf), (0.0, math.inf), (0.0, 1.0)


@dataclass(eq=False)
class Variable:
    """A number of a function, ``double`` or ``int32_t``, or several in a structure."""

    name: str
    kind: str
    parameter: bool = False


@dataclass(frozen=True)
class Number:
    """An expression of C, what it reads, and the least and greatest whole number it may be."""

    text: str
    kind: str
    level: int = ATOM
    reads: Reads = NOTHING
    bounds: Bounds = ANYWHERE

    @property
    def natural(self) -> bool:
        """True if it is known not to be negative."""
        return self.bounds[0] >= 0

    @property
    def truth(self) -> bool:
        """True if it is known to be 0 or 1."""
        return self.natural and self.bounds[1] <= TRUTH[1]

    @property
    def range(self) -> Bounds:
        """The narrowest of a few bounds that it keeps, for which functions are made."""
        return TRUTH if self.truth else NATURAL if self.natural else ANYWHERE

    def within(self, level: int) -> str:
        """The expression as a part of one of this level."""
        return self.text if self.level >= level else f"({self.text})"


@dataclass(eq=False)
class Storage:
    """An array of C: a field of a structure, a constant, local, or handed over by a pointer.

    ``where`` is memory, estimate, work, constant, given, local or parameter. The entries of a
    constant are ``data``; ``uniform`` is the value that all entries have, or None.
    """

    name: str
    where: str
    shape: tuple[int, ...]
    integer: bool = False
    data: Array | None = None
    uniform: float | None = None
    scalar: bool = False

    def __post_init__(self) -> None:
        self.key = self.name  # which stays when it is named otherwise

    @property
    def kind(self) -> str:
        """The type of an entry."""
        return "int32_t" if self.integer else "double"

    @property
    def root(self) -> str:
        """The name of the pointer by which it is reached."""
        return self.name if self.where == "given" else self.where

    @property
    def path(self) -> str:
        """The array as code names it."""
        held = self.where in ("memory", "estimate", "work")
        return f"{self.where}->{self.name}" if held else self.name

    def view(self) -> View:
        """All of it."""
        return View(self, self.shape, row_strides(self.shape))


@dataclass(frozen=True)
class View:
    """A part of an array with steps between its entries, along each axis.

    It begins ``start`` entries and for each of the ``terms``, a text and its factor, so many more
    behind the first of the storage.
    """

    storage: Storage
    shape: tuple[int, ...]
    strides: tuple[int, ...]
    start: int = 0
    terms: tuple[tuple[Number, int], ...] = field(default=())

    def moved(self, axis: int, index: int | Number) -> View:
        """The view that begins at an index of an axis."""
        stride = self.strides[axis]
        if isinstance(index, Number):
            return replace(self, terms=(*self.terms, (index, stride)))
        return replace(self, start=self.start + stride * index)

    def without(self, axis: int) -> View:
        """The view without an axis."""
        shape = self.shape[:axis] + self.shape[axis + 1 :]
        return replace(self, shape=shape, strides=self.strides[:axis] + self.strides[axis + 1 :])

    @property
    def span(self) -> int:
        """The number of entries from its first one to behind its last."""
        return 1 + sum(s * max(n - 1, 0) for n, s in zip(self.shape, self.strides, strict=True))

    @property
    def reads(self) -> Reads:
        """All that its place depends on."""
        return union(index.reads for index, _ in self.terms)

    @property
    def uniform(self) -> float | None:
        """The value of all its entries, if they are known to be the same."""
        storage = self.storage
        if storage.data is None or not math.prod(self.shape):
            return storage.uniform
        data = storage.data.reshape(-1)
        if not self.terms:
            steps = [data.itemsize * stride for stride in self.strides]
            data = np.lib.stride_tricks.as_strided(data[self.start :], self.shape, steps).ravel()
        first = data[0]
        alike = (data == first).all() and (np.signbit(data) == np.signbit(first)).all()
        return first.item() if alike else None

    def entry(self) -> Number:
        """A view of no axis as a number."""
        storage = self.storage
        text = storage.path if storage.scalar else storage.path + self._index()
        reads = self.reads | {storage}
        data, bounds = storage.data, NATURAL if storage.integer else ANYWHERE
        if storage.integer and data is not None:
            bounds = np.min(data, initial=0).item(), np.max(data, initial=0).item()
        return Number(text, storage.kind, ATOM, reads, bounds)

    def pointer(self) -> str:
        """The address of its first entry."""
        whole = not self.terms and not self.start and not self.storage.scalar
        if whole and len(self.storage.shape) == 1:
            return self.storage.path
        return f"&{self.entry().text}"

    def _index(self) -> str:
        left, terms, text = self.start, list(self.terms), ""
        for stride in row_strides(self.storage.shape):
            # As often as an index moves along this axis; the rest moves along the next ones.
            counted = [(index, *divmod(step, stride)) for index, step in terms]
            terms = [(index, rest) for index, _, rest in counted if rest]
            parts = [
                index.within(SUM) if times == 1 else f"{index.within(PRODUCT)} * {times}"
                for index, times, _ in counted if times
            ]  # fmt: skip
            constant, left = divmod(left, stride)
            text += f"[{' + '.join(parts + [str(constant)] * (constant > 0 or not parts))}]"
        return text


def row_strides(shape: tuple[int, ...]) -> tuple[int, ...]:
    """The steps along each axis of an array row by row."""
    return tuple(math.prod(shape[axis + 1 :]) for axis in range(len(shape)))


def joint(first: Bounds, second: Bounds) -> Bounds:
    """Bounds of what is within one of two."""
    return min(first[0], second[0]), max(first[1], second[1])


def union(parts: Iterable[Reads]) -> Reads:
    """All that is read."""
    return frozenset().union(*parts)


def literal(value: Any) -> str:
    """A number as C writes it, where those of math.h may be of any type."""
    if isinstance(value, bool | np.bool_ | int | np.integer):
        return str(int(value))
    if math.isnan(value):
        return "(double)NAN"
    if math.isinf(value):
        return "(double)INFINITY" if value > 0 else "-(double)INFINITY"
    return repr(float(value))


def number(value: Any) -> Number:
    """A constant as a number."""
    whole = isinstance(value, bool | int | np.bool_ | np.integer)
    if whole and abs(value) > LARGEST:
        raise OverflowError(f"{value}, a whole number of more than 32 bits")
    text = literal(value)
    level = SIGN if text[0] in "-(" else ATOM
    bounds = (int(value), int(value)) if whole else ANYWHERE
    return Number(text, "int32_t" if whole else "double", level, NOTHING, bounds)


def negated(condition: Number) -> Number:
    """The condition that does not hold where this one does."""
    text, reads = condition.text, condition.reads
    if not condition.truth:
        zero = "0" if condition.kind == "int32_t" else "0.0"
        return Number(f"{condition.within(SUM)} == {zero}", "int32_t", COMPARED, reads, TRUTH)
    if text.startswith("!") and condition.level == SIGN:
        return replace(condition, text=text[1:], level=ATOM if text[1] != "(" else TERNARY)
    return Number(f"!{condition.within(SIGN)}", "int32_t", SIGN, reads, TRUTH)


def double(value: Any) -> Number:
    """A number as a double."""
    if not isinstance(value, Number):
        return number(float(value))
    if value.kind == "double":
        return value
    return Number(f"(double){value.within(SIGN)}", "double", SIGN, value.reads)


def as_number(value: Any) -> Number:
    """A number or a constant as a number."""
    return value if isinstance(value, Number) else number(value)
