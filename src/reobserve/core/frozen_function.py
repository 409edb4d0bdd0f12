"""Functions that compare equal if numba compiles the same code from them.

numba takes global variables, cells of closures and defaults for constants, with the values that
they have when a function is compiled.
"""

from __future__ import annotations

import marshal
import warnings
from collections.abc import Hashable
from contextlib import suppress
from hashlib import sha256
from types import CellType, CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np
from numba.extending import is_jitted

_COPIED = 10**6  # bytes of a contiguous array; of others numba compiles the address
_PLAIN = (type(None), bool, int, float, complex, str, bytes)


class FrozenFunction:
    """A function and, as its key, all that numba compiles of it as it is now.

    Numbers, texts, tuples and arrays count by value, functions by what they name in turn, modules
    by the attributes that are named, and other objects by identity. Very long chains of functions
    equal nothing else.
    """

    def __init__(self, function: Any) -> None:
        # What was met, which keeps its ids, and modules also by the attributes that are named.
        self._met: dict[Any, tuple[int, Any]] = {}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of attributes that are to be removed
            try:
                key = self._of(function, ())
            except RecursionError:
                key = object()
        self._key: Hashable = key

    def __eq__(self, other: object) -> bool:
        return isinstance(other, FrozenFunction) and other._key == self._key

    def __hash__(self) -> int:
        return hash(self._key)

    def _of(self, value: Any, names: tuple[str, ...]) -> Hashable:
        """The part of the key for a value that a function of these names names."""
        kind = type(value)
        if kind in _PLAIN:
            return marshal.dumps(value, 2)  # nan is equal to nan, and 0.0 not to -0.0
        if isinstance(value, tuple):
            return kind, *(self._of(entry, names) for entry in value)
        place: Any = id(value), names if isinstance(value, ModuleType) else ()
        if isinstance(value, np.ndarray | np.generic):
            array = np.asarray(value)
            place = id(value), kind, array.dtype, array.shape, array.strides
            if array.flags.forc and array.nbytes <= _COPIED and not array.dtype.hasobject:
                return *place[1:], sha256(array.tobytes()).digest()
        if place in self._met:  # as where a function calls itself
            return self._met[place][0]
        self._met[place] = len(self._met), value
        if isinstance(value, FunctionType):
            return self._of_function(value)
        inside: list[Any] = [value.py_func] if is_jitted(value) else []
        for name in names if isinstance(value, ModuleType) else ():
            with suppress(Exception):  # it has none, or one that cannot be had
                inside.append((name, getattr(value, name)))
        return place, self._of(tuple(inside), names)

    def _of_function(self, function: FunctionType) -> Hashable:
        code = function.__code__
        names = tuple(sorted(names_in(code)))
        known = function.__globals__
        cells = enumerate(function.__closure__ or ())
        inside = (
            *((name, known[name]) for name in names if name in known),
            *((k, cell.cell_contents) for k, cell in cells if cell != CellType()),
            (function.__defaults__, *(function.__kwdefaults__ or {}).items()),
        )
        return code, self._of(inside, names)


def names_in(code: CodeType) -> set[str]:
    """Names of globals and of attributes in a code object and in those inside it."""
    inner = (names_in(constant) for constant in code.co_consts if isinstance(constant, CodeType))
    return set(code.co_names).union(*inner)
