"""The files in which numba keeps machine code: one that cannot be read or written only costs time.

Nothing notices a file whose machine code was changed in the middle: numba calls what it finds.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import RLock
from typing import Any

import numba

compiling = RLock()
"""Held while settings of the whole process are changed to compile, such as where to cache."""

# numba's class of caches, of kernels and of functions with a signature; where numba compiles
# nothing it has none to be found.
_CACHE: Any = getattr(type(numba.njit(lambda: 0)), "enable_caching", None)
_CACHE = getattr(_CACHE, "__globals__", {}).get("FunctionCache", object)
_INIT = _CACHE.__init__


class _Lenient(_CACHE):  # type: ignore[misc]
    """A cache of one function in which nothing wrong with files is an error."""

    def load_overload(self, *what: Any) -> Any:
        """The compiled function, or None if it has to be compiled."""
        try:
            return super().load_overload(*what)
        except Exception:  # a damaged pickle raises whatever it likes
            with suppress(OSError):
                self.flush()  # or it could not be saved, either
            return None

    def save_overload(self, *what: Any) -> None:
        """Save a compiled function, if that can be done."""
        with suppress(Exception):
            super().save_overload(*what)


@contextmanager
def cache_in(folder: Path | None) -> Iterator[bool]:
    """Have numba cache in a folder what is decorated meanwhile, and say if there is one."""
    if folder is None or _CACHE is object:
        yield False
        return

    def lenient(self: Any, function: Any) -> None:
        _INIT(self, function)
        # numba's own path has the folder of the source in it.
        self._cache_path = str(folder)
        name = f"{function.__module__}.{self._impl.filename_base}"
        stamp = self._impl.locator.get_source_stamp()
        self._cache_file = type(self._cache_file)(self._cache_path, name, stamp)
        self.__class__ = _Lenient

    config: Any = numba.config
    with compiling:
        before = config.CACHE_DIR, _CACHE.__init__
        config.CACHE_DIR, _CACHE.__init__ = str(folder), lenient
        try:
            yield True
        finally:
            config.CACHE_DIR, _CACHE.__init__ = before


def own_folder(place: Path, name: str) -> Path | None:
    """A folder for code that this user alone has written, or None if there can be none.

    Who owns a folder may put any code into it. A place that is not absolute would be another one
    in each current folder.
    """
    folder = place / name
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        owner = folder.stat().st_uid
    except OSError:
        return None
    is_own = not hasattr(os, "getuid") or owner == os.getuid()
    return folder if is_own and os.access(folder, os.W_OK) else None
