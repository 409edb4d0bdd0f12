"""Functions of a user's own, ``f(x, u, p)`` in Python, as compiled loops call them.

Loops hand them x and one vector of the inputs u and, behind them, the parameters p.

What numba can compile is compiled, with a check of every index. Anything else is called back from
the compiled loop, some microseconds a call; the loop and its results are the same, and so is what
the function raises (`reobserve.core.loop_function`).
"""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable, Hashable
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, partial
from types import CellType, FunctionType, ModuleType
from typing import Any

import numba
import numpy as np
from numba import types
from numba.extending import is_jitted
from numpy.typing import NDArray

from reobserve.core.errors import InputError, one_line, shown
from reobserve.core.frozen_function import FrozenFunction, names_in
from reobserve.core.kernel_cache import compiling
from reobserve.core.loop_function import in_its_words, loop_pointer
from reobserve.core.vector_field import VECTOR_FIELD

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class UserFunction:
    """A function ``(x,)``, ``(x, u)`` or ``(x, u, p)`` that returns numbers of one shape.

    ``shape`` is () for one number, (n,) or (m, n). Where one number is asked for, a list of one
    will do, and the other way round. It is called with x and u if it can be, else with x, else with
    x, u and p: an argument that has a default is never p.

    Raises
    ------
    InputError
        If it is no such function, or returns something else at x = (1, ..., 1), u = (1, ..., 1)
        and p = ``parameters``, its values.
    """

    name: str
    function: Callable[..., Any]
    states: int
    inputs: int
    shape: tuple[int, ...]
    parameters: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not callable(self.function) or isinstance(self.function, type):
            raise InputError(self.name, f"{shown(self.function)} must be a function of x and u")
        self._check(np.ones(self.states), np.array([*[1.0] * self.inputs, *self.parameters]))

    @property
    def _python(self) -> Callable[..., Any]:
        given: Any = self.function
        return given.py_func if is_jitted(given) else given

    @cached_property
    def arguments(self) -> int:
        """The number of arguments, of x, u and p, that it is called with."""
        for count in (2, 1, 3):
            try:
                inspect.signature(self._python).bind(*range(count))
            except TypeError:
                continue
            except ValueError:  # a built-in function that does not tell
                pass
            if count == 3 and not self.parameters:
                raise InputError(self.name, "takes p, but the model has no parameters")
            return count
        problem = "must be a function of x and u, or of x alone"
        raise InputError(self.name, problem + (", or of x, u and p" if self.parameters else ""))

    def _check(self, x: Array, v: Array) -> None:
        before = x.copy(), v.copy()
        with suppress(_NoValueError):  # it may be defined elsewhere
            self(x, v)
        if not (np.array_equal(x, before[0]) and np.array_equal(v, before[1])):
            names = "x, u and p" if self.arguments == 3 else "x and u"
            raise InputError(self.name, f"changes the arrays it is given, must leave {names} alone")

    def __call__(self, x: Array, v: Array) -> Array:
        """The value at x and v = [u, p], an array of the shape.

        Raises
        ------
        InputError
            If it raises anything but an arithmetic error, or returns something else.
        """
        return self._value(self._python, x, v)

    def _value(self, function: Callable[..., Any], x: Array, v: Array) -> Array:
        arguments = (x, v[: self.inputs], v[self.inputs :])[: self.arguments]
        try:
            with np.errstate(all="ignore"):
                value = function(*arguments)
        except Exception as error:
            problem = in_its_words(self.name, error, x)
            raise (_NoValueError if problem is None else problem) from None
        try:
            array = np.asarray(value)
            if array.dtype.kind not in "iufb":
                raise TypeError
        except Exception:
            wanted = _wanted(self.shape)
            said = f"returns {shown(value)} at x = {shown(x.tolist())}, must return {wanted}"
            raise InputError(self.name, said) from None
        if array.shape != self.shape and not (array.size == 1 and self.shape in ((), (1,), (1, 1))):
            raise InputError(
                self.name, f"returns an array of shape {array.shape}, must return "
                f"{_wanted(self.shape)}",
            )  # fmt: skip
        return array.astype(np.float64).reshape(self.shape)

    def _again(self, function: Callable[..., Any], x: Array, v: Array, out: Array) -> None:
        with suppress(_NoValueError):  # nan, as where it is compiled
            out[:] = self._value(function, x, v).ravel()

    def compiled(self) -> tuple[Any, str]:
        """A function pointer ``(x, v, out)`` for compiled loops, and why numba refused, or ""."""
        behind = self.inputs, len(self.parameters)
        key = FrozenFunction(self.function), self.name, self.states, *behind, self.shape
        with compiling:
            if key not in _COMPILED:
                if len(_COMPILED) >= 256:
                    _COMPILED.clear()
                _COMPILED[key] = _by_numba(self)
            pointer, refusal = _COMPILED[key]
        if refusal:
            pointer = loop_pointer(VECTOR_FIELD, None, partial(self._again, self._python))
        return pointer, refusal


# Pointers, and why numba refused, or "": each function is compiled once a process.
_COMPILED: dict[Hashable, tuple[Any, str]] = {}


def _by_numba(user: UserFunction) -> tuple[Any, str]:
    """A pointer, and why numba refused, or ""."""
    given = user.function
    arguments = user.arguments
    inputs = user.inputs if user.parameters else None
    signature = (VECTOR_FIELD.args[0],) * arguments
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            value = _copied(given, {}, _with_bounds)
            value.compile(signature)
            kind = value.overloads[signature].signature.return_type
            writer = _writer(_of_vectors(value, arguments, inputs), kind, len(user.shape))
            alone: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
            inner: Any = numba.njit(error_model="numpy", **alone)(writer)
            inner.compile(VECTOR_FIELD.args)
            again = partial(user._again, _copied(given, {}, lambda function, _: function))
            return loop_pointer(VECTOR_FIELD, inner, again), ""
        except Exception as error:
            lines = [line.strip() for line in str(error).splitlines() if line.strip()]
            reason = next((line for line in lines if not line.startswith("Failed in")), "")
            return None, one_line(reason or type(error).__name__, 160)


def _with_bounds(function: Any, given: Any) -> Any:
    """The function compiled by numba with checked indices and the options of ``given``."""
    options: dict[str, Any] = {"error_model": "numpy"}
    if is_jitted(given):
        options = {name: value for name, value in given.targetoptions.items() if name != "nopython"}
    return numba.njit(**(options | {"boundscheck": True, "cache": False}))(function)


def _copied(given: Any, seen: dict[Any, Any], make: Callable[[Any, Any], Any]) -> Any:
    """``make`` of a copy of a function and the function, so for those of numba that it names."""
    if given in seen:
        return seen[given]
    function = given.py_func if is_jitted(given) else given
    copy = FunctionType(
        function.__code__, dict(function.__globals__), function.__name__, function.__defaults__,
        tuple(CellType() for _ in function.__closure__ or ()) or None,
    )  # fmt: skip
    copy.__kwdefaults__, copy.__module__ = function.__kwdefaults__, function.__module__
    made = seen[given] = make(copy, given)
    names, known = names_in(function.__code__), copy.__globals__
    for name in names & known.keys():
        known[name] = _copied_value(known[name], names, seen, make)
    for cell, old in zip(copy.__closure__ or (), function.__closure__ or (), strict=True):
        with suppress(ValueError):  # it is still empty
            cell.cell_contents = _copied_value(old.cell_contents, names, seen, make)
    return made


def _copied_value(value: Any, names: set[str], seen: dict[Any, Any], make: Any) -> Any:
    """A copy of a function of numba, and of a module in which such functions have these names."""
    if is_jitted(value):
        return _copied(value, seen, make)
    if not isinstance(value, ModuleType):
        return value
    inside = {name: vars(value)[name] for name in names & vars(value).keys()}
    copies = {name: _copied_value(old, names - {name}, seen, make) for name, old in inside.items()}
    if all(copies[name] is old for name, old in inside.items()):
        return value
    module = ModuleType(value.__name__)
    vars(module).update(vars(value) | copies)
    return module


class _NoValueError(Exception):
    """A function of arithmetic outside its domain."""


def _wanted(shape: tuple[int, ...]) -> str:
    if not shape:
        return "one number"
    if len(shape) == 1:
        return f"{shape[0]} number{'s' if shape[0] != 1 else ''}"
    return f"{shape[0]} rows of {shape[1]} numbers"


def _of_vectors(inner: Any, arguments: int, inputs: int | None) -> Any:
    """``inner``, of x, u and p or fewer, as a function of x and v = [u, p], or None if v is u."""
    if arguments == 1:

        @numba.njit
        def value(x: Any, v: Any) -> Any:
            return inner(x)

    elif arguments == 3:

        @numba.njit
        def value(x: Any, v: Any) -> Any:
            return inner(x, v[:inputs], v[inputs:])

    elif inputs is not None:

        @numba.njit
        def value(x: Any, v: Any) -> Any:
            return inner(x, v[:inputs])

    else:
        value = inner
    return value


def _writer(value: Any, kind: Any, dimensions: int) -> Callable[..., None]:
    """The function ``(x, v, out)`` that writes what ``value`` returns, of numba's kind.

    It raises where the number of values is another one, which Python then says.
    """
    if isinstance(kind, types.Number | types.Boolean):

        def write(x: Any, v: Any, out: Any) -> None:
            if len(out) != 1:
                raise ValueError
            out[0] = value(x, v)

    elif dimensions == 2:

        def write(x: Any, v: Any, out: Any) -> None:
            result = value(x, v)
            n = len(x)
            if len(result) * n != len(out):
                raise ValueError
            for i in range(len(result)):
                if len(result[i]) != n:
                    raise ValueError
                for j in range(n):
                    out[i * n + j] = result[i][j]

    elif isinstance(kind, types.BaseTuple):

        def write(x: Any, v: Any, out: Any) -> None:
            result = np.array(value(x, v))
            if len(result) != len(out):
                raise ValueError
            for i in range(len(out)):
                out[i] = result[i]

    else:

        def write(x: Any, v: Any, out: Any) -> None:
            result = value(x, v)
            if len(result) != len(out):
                raise ValueError
            for i in range(len(out)):
                out[i] = result[i]

    return write
