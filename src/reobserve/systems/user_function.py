"""Functions of a user's own, ``f(x, u, p)`` in Python, as compiled loops call them.

Loops hand them x and one vector of the inputs u and, behind them, the parameters p.

What numba can compile is compiled. Anything else is called back from the compiled loop, some
microseconds a call; the loop and its results are the same.
"""

from __future__ import annotations

import ctypes
import inspect
import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any

import numba
import numpy as np
from numba import types
from numba.extending import is_jitted
from numpy.typing import NDArray

from reobserve.core.errors import InputError, one_line, shown
from reobserve.core.frozen_function import FrozenFunction

Array = NDArray[np.float64]

_VECTOR = types.Array(types.float64, 1, "C")
_SIGNATURE = types.void(_VECTOR, _VECTOR, _VECTOR)  # that of vector fields
_POINTER = ctypes.c_void_p


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
    problems: list[BaseException] = field(default_factory=list, repr=False)

    def __post_init__(self) -> None:
        if not callable(self.function) or isinstance(self.function, type):
            raise InputError(self.name, f"{shown(self.function)} must be a function of x and u")
        self._check(np.ones(self.states), np.array([*[1.0] * self.inputs, *self.parameters]))

    @property
    def _python(self) -> Callable[..., Any]:
        given: Any = self.function
        return given.py_func if is_jitted(given) else given

    @cached_property
    def _arguments(self) -> int:
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
        with suppress(ArithmeticError, _DomainError):  # it may be defined elsewhere
            self(x, v)
        if not (np.array_equal(x, before[0]) and np.array_equal(v, before[1])):
            names = "x, u and p" if self._arguments == 3 else "x and u"
            raise InputError(self.name, f"changes the arrays it is given, must leave {names} alone")

    def __call__(self, x: Array, v: Array) -> Array:
        """The value at x and v = [u, p], an array of the shape.

        Raises
        ------
        InputError
            If it raises anything but an arithmetic error, or returns something else.
        """
        arguments = (x, v[: self.inputs], v[self.inputs :])[: self._arguments]
        try:
            with np.errstate(all="ignore"):
                value = self._python(*arguments)
        except ArithmeticError:
            raise
        except Exception as error:
            if isinstance(error, ValueError) and _outside(error):
                raise _DomainError from None
            said = one_line(f"{type(error).__name__}: {error}", 200)
            raise InputError(self.name, f"raises {said} at x = {shown(x.tolist())}") from None
        try:
            array = np.asarray(value)
            if array.dtype.kind not in "iufb":
                raise TypeError
        except Exception:
            wanted = _wanted(self.shape)
            problem = f"returns {shown(value)} at x = {shown(x.tolist())}, must return {wanted}"
            raise InputError(self.name, problem) from None
        if array.shape != self.shape and not (array.size == 1 and self.shape in ((), (1,), (1, 1))):
            raise InputError(
                self.name, f"returns an array of shape {array.shape}, must return "
                f"{_wanted(self.shape)}",
            )  # fmt: skip
        return array.astype(np.float64).reshape(self.shape)

    def compiled(self) -> tuple[Any, str]:
        """A function pointer ``(x, v, out)`` for compiled loops, and why numba refused, or ""."""
        inputs = self.inputs if self.parameters else None
        frozen = FrozenFunction(self.function)
        pointer, refusal = _by_numba(frozen, self._arguments, inputs, len(self.shape))
        return (self._called_back() if refusal else pointer), refusal

    def _called_back(self) -> Any:
        behind = self.inputs + len(self.parameters)
        number, sizes = ctypes.c_double, (self.states, behind, int(np.prod(self.shape)))

        def called(*addresses: int) -> None:
            x, v, out = (
                np.ctypeslib.as_array((number * size).from_address(address))
                if size
                else np.empty(0)
                for size, address in zip(sizes, addresses, strict=True)
            )
            out[:] = np.nan
            if self.problems:
                return
            try:
                out[:] = self(x.copy(), v.copy()).ravel()
            except (ArithmeticError, _DomainError):  # as nan or inf where it is compiled
                pass
            except BaseException as error:
                self.problems.append(error)

        callback = ctypes.CFUNCTYPE(None, _POINTER, _POINTER, _POINTER)(called)

        def write(x: Any, v: Any, out: Any) -> None:
            callback(x.ctypes, v.ctypes, out.ctypes)

        pointer: Any = numba.cfunc(_SIGNATURE)(write)
        pointer.keeps = callback  # alive as long as the pointer
        return pointer

    def raise_problem(self) -> None:
        """Raise what the function raised when a loop called it, if it did."""
        if self.problems:
            raise self.problems.pop()


@lru_cache(maxsize=256)
def _by_numba(
    frozen: FrozenFunction, arguments: int, inputs: int | None, dimensions: int
) -> tuple[Any, str]:
    """A pointer, and why numba refused, or "", from one compilation a process."""
    given, signature = frozen.function, (_VECTOR,) * arguments
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            inner: Any = given if is_jitted(given) else numba.njit(error_model="numpy")(given)
            inner.compile(signature)
            kind = inner.overloads[signature].signature.return_type
            writer = _writer(_of_vectors(inner, arguments, inputs), kind, dimensions)
            return numba.cfunc(_SIGNATURE, error_model="numpy")(writer), ""
        except Exception as error:
            lines = [line.strip() for line in str(error).splitlines() if line.strip()]
            reason = next((one for one in lines if not one.startswith("Failed in")), "")
            return None, one_line(reason or type(error).__name__, 160)


class _DomainError(Exception):
    """A function of ``math`` outside its domain."""


def _outside(error: ValueError) -> bool:
    return any(word in str(error) for word in ("domain", "expected a positive", "expected a non"))


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

    It is nan where the number of values is another one.
    """
    if isinstance(kind, types.Number | types.Boolean):

        def write(x: Any, v: Any, out: Any) -> None:
            out[:] = np.nan
            if len(out) == 1:
                out[0] = value(x, v)

    elif dimensions == 2:

        def write(x: Any, v: Any, out: Any) -> None:
            out[:] = np.nan
            found = value(x, v)
            n = len(x)
            if len(found) * n == len(out):
                for i in range(len(found)):
                    if len(found[i]) == n:
                        for j in range(n):
                            out[i * n + j] = found[i][j]

    elif isinstance(kind, types.BaseTuple):

        def write(x: Any, v: Any, out: Any) -> None:
            out[:] = np.nan
            found = np.array(value(x, v))
            if len(found) == len(out):
                for i in range(len(out)):
                    out[i] = found[i]

    else:

        def write(x: Any, v: Any, out: Any) -> None:
            out[:] = np.nan
            found = value(x, v)
            if len(found) == len(out):
                for i in range(len(out)):
                    out[i] = found[i]

    return write
