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
import threading
from collections.abc import Callable
from functools import cached_property, partial
from pickle import PicklingError
from typing import Any

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

_WORD = ir.IntType(64)
_RAISE = dis.opmap["RAISE_VARARGS"]


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


def _failed(again: Again, *places: int) -> None:
    """Call a function again, from Python, with arrays at addresses, each followed by the size."""
    arrays = []
    for address, size in zip(places[::2], places[1::2], strict=True):
        kind = ctypes.c_double * size
        arrays.append(np.ctypeslib.as_array(kind.from_address(address)) if size else np.empty(0))
    *given, out = arrays
    out[:] = np.nan
    if _OF_THREAD.problem is not None:
        return
    try:
        again(*(array.copy() for array in given), out)
    except BaseException as error:  # raised after the loop
        out[:] = np.nan
        # Where the state is nan already the loop ends for that.
        if not isinstance(error, Exception) or not any(np.isnan(array).any() for array in given):
            _OF_THREAD.problem = error


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
    count = len(signature.args)
    failed = ctypes.CFUNCTYPE(None, *[ctypes.c_int64] * 2 * count)(partial(_failed, again))
    address = ctypes.cast(failed, ctypes.c_void_p).value
    parameters = ", ".join(f"a{k}" for k in range(count))
    namespace = {"call": _call_guarded, "inner": inner, "address": address, "copies": copies}
    code = f"def function({parameters}):\n    call(inner, address, copies, ({parameters},))\n"
    exec(code, namespace)
    with compiling:
        pointer: Any = numba.cfunc(signature, error_model="numpy")(namespace["function"])
    namespace["call"] = lambda inner, address, copies, given: again(*given)  # for Python
    pointer.pickled, pointer.failed = pickled, failed
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
def _call_guarded(_: Any, inner: Any, address: Any, copies: Any, arguments: Any) -> Any:
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
                _call_failed(context, builder, address.literal_value, kinds, given)
        else:
            _call_failed(context, builder, address.literal_value, kinds, given)
        return context.get_dummy_value()

    return types.void(inner, address, copies, arguments), generate


def _call_failed(context: Any, builder: Any, failed: int, kinds: Any, given: Any) -> None:
    """Call `_failed` at an address with the addresses and the sizes of arrays."""
    words = []
    for kind, value in zip(kinds, given, strict=True):
        array = context.make_helper(builder, kind, value=value)
        words += [builder.ptrtoint(array.data, _WORD), array.nitems]
    function = ir.FunctionType(ir.VoidType(), [_WORD] * len(words))
    builder.call(builder.inttoptr(_WORD(failed), function.as_pointer()), words)


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
        pointer = loop_pointer(self._signature, inner, self._again)
        pointer.source = self._function  # for those who translate it
        return pointer

    def _again(self, *given: Array) -> None:
        try:
            with np.errstate(all="ignore"):
                self._function(*self._shaped(*given))
        except Exception as error:
            given[-1][:] = np.nan
            problem = in_its_words(self._function.__name__, error, given[0])
            if problem is not None:
                raise problem from None
