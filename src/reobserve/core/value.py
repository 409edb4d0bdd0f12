"""The base class of models, observers and states: fields that are checked once and stay so."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import one_line, shown

Array = NDArray[np.float64]

_SMALL = 12  # entries of an array that a repr lists
_NESTED = 300  # letters of what stands in a field


def converter(convert: Callable[..., Any], *arguments: Any) -> dict[str, Any]:
    """Metadata of a dataclass field whose value is ``convert(name, value, *arguments)``."""
    return {"converter": (convert, arguments)}


class Value:
    """A frozen dataclass whose fields are converted, and its arrays read-only.

    Fields with a `converter` are converted first; a class that checks more calls this
    ``__post_init__`` before. Objects are equal to nothing but themselves: a comparison of arrays
    would be an array, and a model's functions cannot be compared.
    """

    def __post_init__(self) -> None:
        kind: Any = type(self)
        for name, convert, arguments in _conversions(kind):
            self._set(name, convert(name, getattr(self, name), *arguments))
        values = self.__dict__
        for name, value in values.items():
            if type(value) is np.ndarray:  # as `read_only`; each step of an observer comes here
                values[name] = view = value[...]
                view.setflags(write=False)

    @classmethod
    def _made(cls, **values: Any) -> Self:
        """One of values that are right: not converted or copied, arrays read-only."""
        made = object.__new__(cls)
        for value in values.values():
            if type(value) is np.ndarray:
                value.setflags(write=False)
        made.__dict__.update(values)
        return made

    def _set(self, name: str, value: Any) -> None:
        """Replace the value of a field while the object is made."""
        self.__dict__[name] = read_only(value) if type(value) is np.ndarray else value

    def _with(self, **changed: Any) -> Self:
        """A copy with other values of fields, which are not converted: faster than `replace`."""
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        for name, value in changed.items():
            other._set(name, value)
        return other

    def __getstate__(self) -> dict[str, Any]:
        """The content of a pickle: the fields, and nothing that was cached."""
        return {each.name: getattr(self, each.name) for each in fields(self)}  # type: ignore[arg-type]

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Set copies and pickles, whose arrays are writable, and compute again what was cached."""
        for each in fields(self):  # type: ignore[arg-type]
            self._set(each.name, state[each.name])

    def __repr__(self) -> str:
        return _with_fields(self)


def read_only(array: NDArray[Any]) -> NDArray[Any]:
    """A view that cannot be written to, of an array that its owner may go on writing to."""
    view = array[...]
    view.setflags(write=False)
    return view


def for_loop(array: Array) -> Array:
    """A read-only array as compiled loops take it, which they must not write to.

    Loops are compiled again for read-only arrays. It is the array that `read_only` made a view of,
    or a copy.
    """
    base = array.base
    if array.flags.writeable:
        return array
    if type(base) is np.ndarray and base.flags.carray and _layout(base) == _layout(array):
        return base
    return array.copy()


def _layout(array: Array) -> tuple[Any, ...]:
    return array.dtype, array.shape, array.strides


@cache
def _conversions(kind: Any) -> tuple[tuple[str, Callable[..., Any], tuple[Any, ...]], ...]:
    return tuple(
        (each.name, *each.metadata["converter"])
        for each in fields(kind)
        if "converter" in each.metadata
    )


def represented(value: Any) -> str:
    """A value inside a repr: the numbers of small arrays, the shapes of others, on one line."""
    kind: Any = type(value)
    if isinstance(value, np.ndarray):
        text = _array(value)
    elif isinstance(value, float):
        text = f"{value:g}"
    elif isinstance(value, tuple | list) and len(value) <= _SMALL:
        inside = ", ".join(map(represented, value))
        text = f"({inside})" if isinstance(value, tuple) else f"[{inside}]"
    elif is_dataclass(value) and (isinstance(value, Value) or kind.__dataclass_params__.repr):
        text = _with_fields(value)  # the repr that dataclasses are given spells arrays out
    elif isinstance(value, Mapping) or kind.__repr__ is object.__repr__:
        text = shown(value)
    else:
        text = repr(value)
    return one_line(text, _NESTED)


def _array(value: NDArray[Any]) -> str:
    if value.size > _SMALL or value.dtype.kind not in "biufc":
        return f"array of shape {value.shape}"
    if value.ndim == 2 and len(value) == value.shape[1] > 1:
        diagonal = value.diagonal()
        if diagonal.any() and np.array_equal(value, np.diag(diagonal)):
            return f"diag({', '.join(map(_numbers, diagonal.tolist()))})"
    return _numbers(value.tolist())


def _with_fields(value: Any) -> str:
    every = [each for each in fields(value) if each.repr and getattr(value, each.name) is not None]
    every.sort(key=lambda each: bool(each.kw_only) or not each.init)  # a base class has them first
    parts = (f"{each.name}={represented(getattr(value, each.name))}" for each in every)
    return f"{type(value).__name__}({', '.join(parts)})"


def _numbers(numbers: Any) -> str:
    if isinstance(numbers, list):
        return f"[{', '.join(map(_numbers, numbers))}]"
    return f"{numbers:g}" if isinstance(numbers, float) else str(numbers)
