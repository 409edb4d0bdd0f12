"""Functions that compare equal if numba compiles the same code from them.

numba takes global variables, cells of closures and defaults for constants, with the values that
they have when a function is compiled.
"""

from __future__ import annotations

import builtins
import marshal
import warnings
from collections import ChainMap
from collections.abc import Hashable, Iterator
from dataclasses import dataclass, field
from hashlib import sha256
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np
from numba.extending import is_jitted

_MOST_OBJECTS = 300  # that one function names, also indirectly
_COPIED = 10**6  # bytes of a contiguous array; of others numba compiles the address
_PLAIN = (type(None), bool, int, float, complex, str, bytes)


@dataclass(frozen=True, eq=False)
class Same:
    """An object that is equal to itself alone, and kept alive."""

    value: Any

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Same) and other.value is self.value

    def __hash__(self) -> int:
        return id(self.value)


@dataclass(frozen=True)
class FrozenFunction:
    """A function and, as its key, all that numba compiles of it as it is now.

    Numbers, texts, tuples and arrays count by value, functions by what they name in turn, modules
    by the attributes that are named, and other objects by identity. A callable that is no function,
    or names very many objects, equals nothing else.
    """

    function: Any = field(compare=False)
    key: Hashable = field(init=False, repr=False)

    def __post_init__(self) -> None:
        key: Hashable = Same(object())
        if isinstance(self.function, FunctionType) or is_jitted(self.function):
            key = _Walk(self.function).key or key
        object.__setattr__(self, "key", key)


class _Walk:
    """Objects that a function names, also indirectly, with ``key`` None if they are too many.

    Objects are numbered in the order in which they are met, and the key has a part for each.
    """

    def __init__(self, function: Any) -> None:
        # By id, and for modules by the names of attributes that are looked at.
        self._numbers: dict[Any, int] = {}
        self._objects: list[tuple[Any, tuple[str, ...]]] = []  # which keeps their ids their own
        self._number(function, ())
        parts: list[Hashable] = []
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of attributes that are to be removed
            while len(parts) < len(self._objects) <= _MOST_OBJECTS:
                parts.append(self._part(*self._objects[len(parts)]))
        self.key = tuple(parts) if len(parts) == len(self._objects) else None

    def _number(self, value: Any, names: tuple[str, ...]) -> int:
        place = id(value), names if isinstance(value, ModuleType) else ()
        if place not in self._numbers:
            self._numbers[place] = len(self._objects)
            self._objects.append((value, names))
        return self._numbers[place]

    def _part(self, value: Any, names: tuple[str, ...]) -> Hashable:
        """The part of the key that stands for an object."""
        if isinstance(value, FunctionType):
            return self._of_function(value)
        if is_jitted(value):
            return Same(value), self._number(value.py_func, ())
        if isinstance(value, ModuleType):
            return Same(value), *self._attributes(value, names)
        return Same(value)

    def _of_function(self, function: FunctionType) -> Hashable:
        code = function.__code__
        names = tuple(dict.fromkeys(name for inner in _codes(code) for name in inner.co_names))
        known = ChainMap(function.__globals__, vars(builtins))
        values = [(name, self._of(known[name], names)) for name in names if name in known]
        cells: list[Hashable] = []
        for cell in function.__closure__ or ():
            try:
                cells.append(self._of(cell.cell_contents, names))
            except ValueError:  # it is still empty
                cells.append(None)
        defaults = function.__defaults__, tuple((function.__kwdefaults__ or {}).items())
        return code, tuple(values), tuple(cells), self._of(defaults, names)

    def _attributes(self, module: ModuleType, names: tuple[str, ...]) -> Iterator[Hashable]:
        for name in names:
            try:
                value = getattr(module, name)
            except Exception:  # it has none, or one that cannot be had
                continue
            yield name, self._of(value, names)

    def _of(self, value: Any, names: tuple[str, ...]) -> Hashable:
        """The part of the key for a value that a function of these names names."""
        kind = type(value)
        if kind in _PLAIN:
            return marshal.dumps(value, 2)  # nan is equal to nan, and 0.0 not to -0.0
        if isinstance(value, np.ndarray | np.generic):
            array = np.asarray(value)
            copied = array.flags.forc and array.nbytes <= _COPIED and not array.dtype.hasobject
            digest = sha256(array.tobytes()).digest()
            held = None if copied else Same(value)
            return kind, array.dtype, array.shape, array.strides, digest, held
        if isinstance(value, tuple):
            return kind, tuple(self._of(entry, names) for entry in value)
        return self._number(value, names)


def _codes(code: CodeType) -> Iterator[CodeType]:
    """A code object and those inside it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)
