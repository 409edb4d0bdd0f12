"""The kernels of a package, and the machine code that numba has kept of them."""

from __future__ import annotations

import importlib
import pkgutil
import re
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any, get_args, get_type_hints

import numba
import numpy as np
from numba.core.dispatcher import Dispatcher

from reobserve.core.kernel import FunctionPointer

_DECORATED = re.compile(r"^@(\w+_)?kernel$", re.MULTILINE)
_ALLOCATION = re.compile(rb"NRT_MemInfo_(alloc|new)")


def kernels(package: str) -> dict[str, Any]:
    """All functions of a package that a decorator of kernels compiles, by module and name."""
    root = importlib.import_module(package)
    modules = [importlib.import_module(name) for name in _modules(root)]
    found = {}
    for module in modules:
        own = {f"{module.__name__}.{one.py_func.__name__}": one for one in _own(module)}
        assert len(own) == len(_DECORATED.findall(_source(module))), module.__name__
        found.update(own)
    assert found
    return found


def _modules(root: ModuleType) -> Iterator[str]:
    for module in pkgutil.walk_packages(root.__path__, f"{root.__name__}."):
        if not module.name.endswith("__main__"):
            yield module.name


def _source(module: ModuleType) -> str:
    return Path(str(module.__file__)).read_text(encoding="utf-8")


def _own(module: ModuleType) -> Iterator[Any]:
    """The kernels of a module, those that another decorator wraps included."""
    for thing in vars(module).values():
        cells = thing.__closure__ if isinstance(thing, FunctionType) else None
        for one in (thing, *(cell.cell_contents for cell in cells or ())):
            kernel = dispatcher(one)
            if kernel is not None and kernel.py_func.__module__ == module.__name__:
                yield kernel


def dispatcher(thing: Any) -> Any:
    """What numba compiles of a kernel, None of anything else."""
    kernel = getattr(thing, "_inlined", thing)
    return kernel if isinstance(kernel, Dispatcher) else None


def machine_code(kernel: Any) -> list[bytes]:
    """All machine code of a kernel in numba's cache, by this process or another one.

    The folder is of this source and this numba alone, see `reobserve.core.kernel`. Of what a kernel
    calls, the process has nothing to show where the kernel came from the cache. One that others
    inline has none of its own.
    """
    if kernel.stats.cache_path is None:
        return []
    function = kernel.py_func
    line = function.__code__.co_firstlineno
    name = f"{function.__module__}.*.{function.__qualname__}-{line}.py*.nbc"
    return [path.read_bytes() for path in Path(kernel.stats.cache_path).glob(name)]


def marked_wrongly(found: Mapping[str, Any]) -> list[str]:
    """Kernels that are not marked and count references, or are marked and make no arrays.

    Machine code names the functions of numba's runtime that it calls.
    """
    if not hasattr(numba.njit(_own).targetdescr.options, "_nrt"):
        return []  # this numba always counts
    return [
        name
        for name, kernel in found.items()
        if allocates(kernel) != any(_ALLOCATION.search(code) for code in machine_code(kernel))
        or (not allocates(kernel) and any(b"NRT_" in code for code in machine_code(kernel)))
    ]


def leaking(found: Mapping[str, Any]) -> list[str]:
    """Kernels that are not marked, but return arrays or call one that is: nobody frees those.

    numba refuses neither.
    """
    return [
        name
        for name, kernel in found.items()
        if not allocates(kernel)
        and (any(map(allocates, callees(kernel))) or returns_arrays(kernel))
    ]


def allocates(kernel: Any) -> bool:
    """Whether it is marked as a kernel that makes arrays."""
    return kernel.targetoptions.get("_nrt") is True


def inlined(found: Mapping[str, Any]) -> set[int]:
    """The ids of kernels that others name, or functions that loops call by a pointer."""
    modules = {sys.modules[one.py_func.__module__] for one in found.values()}
    things = [thing for module in modules for thing in vars(module).values()]
    pointers = [thing for thing in things if isinstance(thing, FunctionPointer)]
    return {id(called) for one in (*found.values(), *pointers) for called in callees(one)}


def callees(kernel: Any) -> Iterator[Any]:
    """The kernels that one names."""
    function = getattr(kernel, "py_func", None) or kernel._function
    names = function.__code__.co_names
    used = [function.__globals__.get(name) for name in names]
    for each in used:
        own = [getattr(each, name, None) for name in names] if isinstance(each, ModuleType) else []
        yield from filter(None, map(dispatcher, (each, *own)))


def returns_arrays(kernel: Any) -> bool:
    """Whether its annotation has arrays in what it returns."""
    return _has_arrays(get_type_hints(kernel.py_func)["return"])


def _has_arrays(kind: Any) -> bool:
    fields = get_type_hints(kind).values() if hasattr(kind, "_fields") else ()
    inner = (*get_args(kind), *fields)
    return getattr(kind, "__origin__", kind) is np.ndarray or any(map(_has_arrays, inner))
