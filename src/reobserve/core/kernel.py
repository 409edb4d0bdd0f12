"""Compilation of hot loops by numba: three decorators, so that all kernels have the same rules."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from functools import cache, cached_property, update_wrapper
from pathlib import Path
from types import FunctionType, ModuleType, SimpleNamespace
from typing import Any, TypeVar, cast

import numba

from reobserve.core import compile_notice
from reobserve.core.import_closure import closure_digest, source
from reobserve.core.kernel_cache import cache_in, compiling, own_folder

# Division by zero gives inf or nan, as in numpy. Sums are never reordered and products never fused
# (no ``fastmath``), so that stepping and batch runs are bitwise identical.
_OPTIONS: dict[str, Any] = {"error_model": "numpy", "fastmath": False, "nogil": True}

Function = TypeVar("Function", bound=Callable[..., object])


def _uncounted() -> dict[str, Any]:
    """The option by which numba counts no references to arrays, or none if it does not know it."""
    options = getattr(getattr(numba.njit(_uncounted), "targetdescr", None), "options", None)
    return {"_nrt": False} if hasattr(options, "_nrt") else {}


_UNCOUNTED = _uncounted()
compile_notice.install()


def kernel(function: Function) -> Function:
    """Compile a function of scalars and arrays, with its machine code cached on disk.

    It makes no arrays and returns none: to count references to them, which their owners hold
    anyway, may take a short loop longer than its work. See `allocating_kernel`.
    """
    return cast(Function, _cached(function, numba.njit, **_UNCOUNTED, **_OPTIONS))


def allocating_kernel(function: Function) -> Function:
    """Compile as `kernel` does a function that makes arrays or lists, or returns arrays.

    Only another one may call it: nobody else would free what it returns.
    """
    counted = dict.fromkeys(_UNCOUNTED, True)
    return cast(Function, _cached(function, numba.njit, **counted, **_OPTIONS))


def _compiler_of_inlined() -> dict[str, Any]:
    """The option of a compiler that makes no machine code, or none if numba has no such thing.

    Code that others inline is never called by itself.
    """
    usual: Any = getattr(getattr(numba.njit(_uncounted), "_compiler", None), "pipeline_class", None)
    if not isinstance(usual, type):
        return {}

    def begin(self: Any, types: Any, target: Any, library: Any, *rest: Any) -> None:
        library = library or _inlined_library(target.codegen())
        usual.__init__(self, types, target, library, *rest)  # type: ignore[misc]

    return {"pipeline_class": type("_OfInlined", (usual,), {"__init__": begin})}


def _inlined_library(codegen: Any) -> Any:
    """A library of numba's that is linked into others and never run, None for an unknown numba."""
    kind: Any = getattr(codegen, "_library_class", None)
    if not {"_finalize_final_module", "_finalize_dynamic_globals", "codegen"} <= {*dir(kind)}:
        return None

    def finalize(self: Any) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True

    methods = {
        "_finalize_final_module": finalize,
        "get_pointer_to_function": lambda *_: 0,
        "codegen": SimpleNamespace(set_env=lambda *_: None),
    }
    return type("_Inlined", (kind,), methods)(codegen, "inlined")


_INLINED: dict[str, Any] = {
    "forceinline": True, "no_cpython_wrapper": True, "no_cfunc_wrapper": True,
    **_compiler_of_inlined(),
}  # fmt: skip


class InlinedKernel:
    """A function that is inlined into the kernels that call it, and that Python may call as well.

    The code to be inlined is compiled without the wrapper through which Python calls kernels, which
    takes as long to compile as the code itself. For Python it is compiled a second time.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        update_wrapper(self, function)
        self._inlined: Any = numba.njit(**_INLINED, **_UNCOUNTED, **_OPTIONS)(function)
        self._function = function

    @property
    def _numba_type_(self) -> Any:
        """The type by which numba knows it in kernels."""
        return self._inlined._numba_type_

    @cached_property
    def _called(self) -> Any:
        """The function that Python calls, which numba finds in its cache by the qualified name."""
        it = self._function
        code, closure = it.__code__, it.__closure__
        copy = FunctionType(code, it.__globals__, it.__name__, it.__defaults__, closure)
        copy.__module__, copy.__qualname__ = it.__module__, f"{it.__qualname__}.called"
        return _cached(copy, numba.njit, **_UNCOUNTED, **_OPTIONS)

    def __call__(self, *arguments: Any) -> Any:
        """Call it from Python."""
        return self._called(*arguments)


def inlined_kernel(function: Function) -> Function:
    """Compile as `kernel` does, and inline the code into the kernels that call it.

    For short functions of many arrays: passing an array costs as much as a few products.
    """
    return cast(Function, InlinedKernel(function))


def compiled_with_signature(signature: Any, function: Callable[..., Any]) -> Any:
    """Compile a function with one signature, which kernels take as an argument."""
    return _cached(function, numba.cfunc, signature, error_model="numpy")


def cached_inner(signature: Any, function: Callable[..., Any], **options: Any) -> Any:
    """Compile what compiled code alone calls, without wrappers for Python and C, cached on disk.

    The result is None where numba compiles nothing.
    """
    alone = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "error_model": "numpy"}
    inner = _cached(function, numba.njit, **alone, **options)
    if inner is function:
        return None
    with compiling:
        inner.compile(signature.args)
    return inner


class FunctionPointer:
    """A function that is an argument of kernels, compiled on first use, not on import."""

    def __init__(self, signature: Any, function: Callable[..., Any]) -> None:
        self._signature, self._function = signature, function

    @cached_property
    def compiled(self) -> Any:
        """The result of `compiled_with_signature`, or the function where numba compiles nothing."""
        config: Any = numba.config
        if config.DISABLE_JIT:
            return self._function
        return compiled_with_signature(self._signature, self._function)


def _cached(function: Callable[..., Any], decorator: Any, *arguments: Any, **options: Any) -> Any:
    """Apply a decorator of numba, with its cache in `_cache_folder` if that can be written."""
    with cache_in(_cache_folder(_modules_behind(function))) as cached:
        try:
            return decorator(*arguments, cache=cached, **options)(function)
        except RuntimeError as error:  # numba found no folder for the module of this function
            if "cannot cache" not in str(error):
                raise
    return decorator(*arguments, **options)(function)


def _modules_behind(function: Callable[..., Any]) -> frozenset[str]:
    """The modules of a function and of the kernels that it calls, also indirectly."""
    seen: dict[Any, None] = {}
    waiting: list[Any] = [function]
    while waiting:
        one = waiting.pop()
        if not isinstance(one, FunctionType) or one in seen:
            continue
        seen[one] = None
        names = one.__code__.co_names
        used = [one.__globals__.get(name) for name in names]
        used += [
            getattr(each, name, None)
            for each in used
            if isinstance(each, ModuleType)
            for name in names
        ]
        with suppress(ValueError):  # a cell that is still empty
            used += [cell.cell_contents for cell in one.__closure__ or ()]
        waiting += [getattr(each, "py_func", getattr(each, "_function", None)) for each in used]
    return frozenset(one.__module__ or "" for one in seen)


@cache
def _cache_folder(modules: frozenset[str]) -> Path | None:
    """The folder for the machine code of functions in modules, or None if there can be none.

    numba looks at the file that defines a function, not at the functions it calls in other files,
    nor at constants from there. So the name of the folder is a digest of all that the modules
    import: an edit of any of it begins a new one.
    """
    if None in map(source, modules):
        return None
    chosen: Any = numba.config
    if chosen.CACHE_DIR:
        places = [Path(chosen.CACHE_DIR).absolute()]
    else:
        places = [Path(__file__).parents[1] / "__pycache__", *_caches_of_user()]
    digest = closure_digest([__name__, *modules])
    name = f"reobserve-kernels-{numba.__version__}-{digest}"
    return next(filter(None, (own_folder(place, name) for place in places)), None)


def _caches_of_user() -> list[Path]:
    """The user's folder for caches, None without a home. Relative ones are none (XDG says so)."""
    found = (os.environ.get("XDG_CACHE_HOME", ""), os.path.expanduser("~/.cache"))
    return [Path(one) for one in found if os.path.isabs(one)][:1]
