"""One step of an observer: what it remembers, reads and estimates, and the function that takes it.

The function is one of Python, in the subset that `reobserve.codegen.translator` knows: it calls the
kernels that the library's own loops are made of.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import count
from typing import Any

import numpy as np
from numpy.lib.array_utils import byte_bounds
from numpy.typing import NDArray

from reobserve.codegen.statements import Needed, Text
from reobserve.codegen.translator import Translator
from reobserve.codegen.values import Bounds, Storage, View, row_strides
from reobserve.observers.gaussian_state import Rules

Array = NDArray[Any]


@dataclass(frozen=True, eq=False)
class Program:
    """One step of an observer.

    ``step`` is called with the ``arguments``. It reads the row in the arrays ``y`` and ``u``,
    changes those of the ``memory``, which hold its start, writes those of the ``estimates`` and of
    ``scratch``, and returns 0, or 1 if it has left the range of numbers. All other arrays of
    the arguments are constants. ``least`` are sizes below which no error of an estimate counts.
    """

    title: str
    step: Callable[..., int]
    arguments: tuple[Any, ...]
    y: Array
    u: Array
    memory: Mapping[str, Array]
    estimates: Mapping[str, Array]
    scratch: Mapping[str, Array] = field(default_factory=dict)
    least: Mapping[str, float] = field(default_factory=dict)

    @property
    def measurements(self) -> int:
        """The number of measurements in a row."""
        return self.y.size

    @property
    def inputs(self) -> int:
        """The number of known inputs in a row."""
        return self.u.size

    @cached_property
    def code(self) -> Code:
        """The step in C."""
        return Code(self)


class Code:
    """The step in C: its functions, and the arrays that it uses by where they are."""

    def __init__(self, program: Program) -> None:
        self._known: list[tuple[int, int, Storage]] = []  # the memory of arrays, first and behind
        self.storages: dict[str, list[Storage]] = {}
        self._add("given", {"y": program.y, "u": program.u})
        self._add("estimate", program.estimates)
        self._add("memory", program.memory)
        self._add("work", program.scratch)
        known, found, before = [*self._known], (dict[Any, set[int]](), dict[Any, Bounds]()), None
        while found != before:
            self._known, before = [*known], found
            self.translator = translator = Translator(self._view, *found)
            self.step = translator.entry(program.step, program.arguments)
            found = translator.alone(), translator.widened()
        self.storages["constant"] = translator.constants
        self._routines = translator.routines
        self.needed = Needed(self._routines, {*self.storages["estimate"]})
        for where in ("memory", "work", "constant"):
            used = [one for one in self.storages[where] if one in self.needed.keys]
            self.storages[where] = used

    def _add(self, where: str, arrays: Mapping[str, Array]) -> None:
        found = self.storages[where] = []
        for name, array in arrays.items():
            begin, end = byte_bounds(array)
            if any(begin >= first and end <= last for first, last, _ in self._known):
                continue
            shape = array.shape if where == "estimate" else [n for n in array.shape if n != 1]
            whole = array.dtype.kind == "i"
            scalar = array.ndim == 0 or (whole and array.size == 1)
            storage = Storage(name, where, tuple(shape) or (1,), whole, scalar=scalar)
            found.append(storage)
            if array.size:
                self._known.append((begin, end, storage))

    def _view(self, array: Array, path: str) -> View:
        """The view of an array: of one that is known, or of a constant."""
        begin, end = byte_bounds(array)
        strides = tuple(stride // array.itemsize for stride in array.strides)
        for first, last, storage in self._known:
            if array.size and begin >= first and end <= last:
                return View(storage, array.shape, strides, (begin - first) // array.itemsize)
        storage = self.translator.constant(path, array)
        if array.size and array.flags.c_contiguous:
            self._known.append((begin, end, storage))
        return View(storage, array.shape, row_strides(array.shape))

    def functions(self, structures: Mapping[str, str], head: str) -> tuple[str, str]:
        """The functions that the step calls with the types of their results, and the step."""
        writer = Text(self.needed, structures)
        used = {call.routine for call in self.needed.calls.values() if call.live}
        functions = "".join(writer.function(one) for one in self._routines if one in used)
        roots = writer.roots(self.step)
        unread = [one for one in self.storages["given"] if one.name not in roots and all(one.shape)]
        begin = "".join(f"    (void){one.name};\n" for one in unread)
        if "work" in roots:
            begin += f"    {structures['work']} scratch, *const work = &scratch;\n"
        step = writer.function(self.step, head, begin)
        helpers = self.translator.helpers.items()
        needed = [text for name, text in helpers if re.search(rf"\b{name}[( ]", functions + step)]
        return "".join([*needed, functions]), step


def leaves(**trees: Any) -> dict[str, Array]:
    """The arrays in tuples in tuples, by the last of the names that lead to them."""
    found: dict[str, Array] = {}
    for path, array in (leaf for name, tree in trees.items() for leaf in _leaves(tree, name)):
        free = next(name for name in _numbered(path) if name not in found)
        found[free] = array
    return found


def _numbered(name: str) -> Iterator[str]:
    yield name
    yield from (f"{name}_{number}" for number in count(2))


def _leaves(tree: Any, path: str) -> Iterator[tuple[str, Array]]:
    if isinstance(tree, np.ndarray):
        yield path, tree
    elif isinstance(tree, tuple) and not isinstance(tree, Rules):
        names = getattr(tree, "_fields", [path] * len(tree))
        for name, part in zip(names, tree, strict=True):
            yield from _leaves(part, name)


def reported(found: Mapping[str, Array], rows: Any) -> tuple[dict[str, Array], Any]:
    """Arrays of estimates: those where they are found, or others, and what is copied to these."""
    estimates, copies = dict[str, Array](), []
    whole = {(byte_bounds(array), array.size) for array in leaves(rows=rows).values()}
    for name, array in found.items():
        estimates[name], place = array, (byte_bounds(array), array.size)
        if place in whole:
            whole.remove(place)
        else:
            estimates[name] = np.empty(array.shape)
            copies.append(tuple(one[(None,) * (2 - one.ndim)] for one in (array, estimates[name])))
    return estimates, tuple(copies)


def report(copies: tuple[tuple[Array, Array], ...]) -> None:
    """Copy estimates from where they are found, as matrices."""
    for source, target in copies:
        for i in range(len(target)):
            for j in range(target.shape[1]):
                target[i, j] = source[i, j]


def finite(arrays: tuple[Array, ...]) -> bool:
    """True if all numbers of vectors are finite."""
    for array in arrays:
        for value in array:
            if not math.isfinite(value):
                return False
    return True
