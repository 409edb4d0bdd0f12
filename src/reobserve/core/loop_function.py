"""Functions that compiled loops call by a pointer, and what becomes of their errors.

Such a function is given copies of what it reads, so that it cannot change the loop's own arrays.
If it raises an error it is called again from Python, with the same arguments: what that returns is
the result. What that raises is kept for the thread, once, and raised when the loop has ended
(`RaisedAfterLoop`); the outputs are nan until then, which ends a loop.
"""

from __future__ import annotations

import copyreg
import ctypes
import dis
import itertools
import threading
import weakref
from collections.abc import Callable
from functools import cached_property
from pickle import PicklingError
from typing import Any

import llvmlite.binding
import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from reobserve.core.errors import InputError, one_line, shown
from reobserve.core.kernel import FunctionPointer, cached_inner
from reobserve.core.kernel_cache import compiling

Array = NDArray[np.float64]

# Called with arrays that are copies, flat, but for the last one: it writes to that.
Again = Callable[..., None]

_SYMBOL = "reobserve_loop_function_failed"
_WORD = ir.IntType(64)
_RAISE = dis.opmap["RAISE_VARARGS"]
_NUMBERS = itertools.count(1)
_AGAIN: dict[int, Again] = {}  # by the number that is compiled into the pointer


class _OfThread(threading.local):
    """The error that a function raised in a loop of this thread."""

    problem: BaseException | None = None


_OF_THREAD = _OfThread()


class RaisedAfterLoop:
    """A context around compiled loops: what a function raised in them is raised after it."""

    def __enter__(self) -> None:
        self._before, _OF_THREAD.problem = _OF_THREAD.problem, None

    def __exit__(self, kind: Any, error: Any, trace: Any) -> None:
        problem, _OF_THREAD.problem = _OF_THREAD.problem, self._before
        if problem is not None and error is None:
            raise problem from None


def _failed(number: int, addresses: int, sizes: int, count: int) -> None:
    """Call a function again, from Python."""
    arrays = []
    for k in range(count):
        size = ctypes.c_int64.from_address(sizes + 8 * k).value
        address = ctypes.c_int64.from_address(addresses + 8 * k).value
        kind = ctypes.c_double * size
        arrays.append(np.ctypeslib.as_array(kind.from_address(address)) if size else np.empty(0))
    *given, out = arrays
    out[:] = np.nan
    if _OF_THREAD.problem is not None:
        return
    try:
        _AGAIN[number](*(array.copy() for array in given), out)
    except BaseException as error:  # raised after the loop
        out[:] = np.nan
        # Where the state is nan already the loop ends for that.
        if not isinstance(error, Exception) or not any(np.isnan(array).any() for array in given):
            _OF_THREAD.problem = error


_CALLED = ctypes.CFUNCTYPE(None, ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64)(
    _failed
)
llvmlite.binding.add_symbol(_SYMBOL, ctypes.cast(_CALLED, ctypes.c_void_p).value)


def loop_pointer(
    signature: Any, inner: Any, again: Again, *, copies: bool = True, pickled: Any = None
) -> Any:
    """A function pointer of a signature of arrays, the last of which is written.

    Parameters
    ----------
    inner
        A function that numba has compiled for the signature; None calls ``again`` every time.
    again
        The same in Python, called where ``inner`` raises an error.
    copies
        Whether ``inner`` is called with copies of what it reads.
    pickled
        A function and its arguments, which make the pointer of a pickle or of a copy.
    """
    number = next(_NUMBERS)
    _AGAIN[number] = again
    parameters = ", ".join(f"a{k}" for k in range(len(signature.args)))
    namespace = {"call": _call_guarded, "inner": inner, "number": number, "copies": copies}
    code = f"def function({parameters}):\n    call(inner, number, copies, ({parameters},))\n"
    exec(code, namespace)
    with compiling:
        pointer: Any = numba.cfunc(signature, error_model="numpy")(namespace["function"])
    namespace["call"] = lambda inner, number, copies, given: again(*given)  # for Python
    pointer.pickled = pickled
    weakref.finalize(pointer, _AGAIN.pop, number, None)
    copyreg.pickle(type(pointer), _pickled)
    return pointer


def _pickled(pointer: Any) -> tuple[Any, Any]:
    """Pickle a pointer by what makes it."""
    how = getattr(pointer, "pickled", None)
    if how is None:
        raise PicklingError("a compiled function that has no place in a module")
    recipe: tuple[Any, Any] = how() if callable(how) else how
    return recipe


def in_its_words(name: str, error: Exception, x: Array) -> InputError | None:
    """The error that a function raised at x, as one for its author.

    None for errors of arithmetic, such as a division by zero or the root of a negative number, that
    no statement raises: compiled code has inf or nan there.
    """
    arithmetic = isinstance(error, ArithmeticError) or (
        isinstance(error, ValueError)
        and any(word in str(error) for word in ("domain", "expected a positive", "expected a non"))
    )
    if arithmetic and not _by_statement(error):
        return None
    said = one_line(f"{type(error).__name__}: {error}", 200)
    return InputError(name, f"raises {said} at x = {shown(x.tolist())}")


def _by_statement(error: Exception) -> bool:
    """True if an error comes of a ``raise``."""
    last = error.__traceback__
    while last is not None and last.tb_next is not None:
        last = last.tb_next
    if last is None or last.tb_lasti < 0:
        return False
    return last.tb_frame.f_code.co_code[last.tb_lasti] == _RAISE


@intrinsic(prefer_literal=True)
def _call_guarded(_: Any, inner: Any, number: Any, copies: Any, arguments: Any) -> Any:
    """Compile a call of ``inner``, and of `_failed` if it raises."""
    compiled = None
    if isinstance(inner, types.Dispatcher):
        compiled = inner.dispatcher.overloads[tuple(arguments)]
    copied = bool(copies.literal_value)

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        kinds = list(arguments)
        given = [builder.extract_value(args[3], k) for k in range(len(kinds))]
        if compiled is not None:
            passed = [
                _copy(context, builder, kind, value) if copied and k < len(kinds) - 1 else value
                for k, (kind, value) in enumerate(zip(kinds, given, strict=True))
            ]
            context.active_code_library.add_linking_library(compiled.library)
            status, _ = context.call_internal_no_propagate(
                builder, compiled.fndesc, compiled.signature, passed
            )
            with builder.if_then(status.is_error, likely=False):
                _call_failed(context, builder, number.literal_value, kinds, given)
        else:
            _call_failed(context, builder, number.literal_value, kinds, given)
        return context.get_dummy_value()

    return types.void(inner, number, copies, arguments), generate


def _call_failed(context: Any, builder: Any, number: int, kinds: Any, given: Any) -> None:
    """Call `_failed` with the addresses and the sizes of arrays."""
    count = _WORD(len(kinds))
    addresses, sizes = (builder.alloca(_WORD, size=count) for _ in range(2))
    for k, (kind, value) in enumerate(zip(kinds, given, strict=True)):
        array = context.make_helper(builder, kind, value=value)
        address = builder.ptrtoint(array.data, _WORD)
        builder.store(address, builder.gep(addresses, [_WORD(k)]))
        builder.store(array.nitems, builder.gep(sizes, [_WORD(k)]))
    pointer = _WORD.as_pointer()
    kind = ir.FunctionType(ir.VoidType(), [_WORD, pointer, pointer, _WORD])
    known = builder.module.globals
    function = known[_SYMBOL] if _SYMBOL in known else ir.Function(builder.module, kind, _SYMBOL)
    builder.call(function, [_WORD(number), addresses, sizes, count])


def _copy(context: Any, builder: Any, kind: Any, given: Any) -> Any:
    """A copy of an array on the stack, which lives as long as the call."""
    copy = context.make_helper(builder, kind, value=given)
    memory = builder.alloca(copy.data.type.pointee, size=copy.nitems)
    kinds = [memory.type, copy.data.type, _WORD]
    transfer = builder.module.declare_intrinsic("llvm.memcpy", kinds)
    size = builder.mul(copy.nitems, copy.itemsize)
    builder.call(transfer, [memory, copy.data, size, ir.IntType(1)(0)])
    copy.data, copy.meminfo = memory, ir.Constant(copy.meminfo.type, None)
    return copy._getvalue()


class GuardedPointer(FunctionPointer):
    """A user's function of arrays as an argument of kernels, compiled on first use.

    ``shaped`` gives flat arrays their shapes, to call the function from Python.
    """

    def __init__(
        self, signature: Any, function: Callable[..., Any], shaped: Callable[..., Any]
    ) -> None:
        self._signature, self._function, self._shaped = signature, function, shaped

    @cached_property
    def compiled(self) -> Any:
        """The pointer, as `loop_pointer` makes it."""
        inner = cached_inner(self._signature, self._function, boundscheck=True)
        return loop_pointer(self._signature, inner, self._again)

    def _again(self, *given: Array) -> None:
        try:
            with np.errstate(all="ignore"):
                self._function(*self._shaped(*given))
        except Exception as error:
            given[-1][:] = np.nan
            problem = in_its_words(self._function.__name__, error, given[0])
            if problem is not None:
                raise problem from None
