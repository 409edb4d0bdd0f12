"""The files in which numba keeps machine code: checked when they are read, written if they can be.

numba takes what it finds. A file that a crash or a full disk has damaged would end every later
program, or be called as if it were the code of the function.
"""

from __future__ import annotations

import hashlib
import os
import pickle
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import RLock
from typing import Any

import numba

compiling = RLock()
"""Held while settings of the whole process are changed to compile, such as where to cache."""


class _CheckedFile:
    """Files of one function, each result with its key and the digest of both."""

    def __init__(self, file: Any) -> None:
        self._file, self.flush = file, file.flush

    def load(self, key: Any) -> Any:
        """The result that was saved with a key, or None if there is none, or no longer."""
        entry = self._file.load(key)
        if entry is None or hashlib.sha256(entry[1]).digest() != entry[0]:
            return None
        saved, data = pickle.loads(entry[1])
        return data if saved == key else None  # a damaged index names the file of another key

    def save(self, key: Any, data: Any) -> None:
        """Save a result."""
        content = self._file._dump((key, data))
        self._file.save(key, (hashlib.sha256(content).digest(), content))


class _Checked:
    """A cache of numba for one function in which nothing wrong with files is an error.

    ``used`` is false if numba went elsewhere, as it does where it cannot write; what it finds
    there is not to be trusted.
    """

    _cache_file: Any
    used: bool

    def load_overload(self, *what: Any) -> Any:
        """The compiled function, or None if it has to be compiled."""
        with suppress(Exception):  # a damaged pickle raises whatever it likes
            return super().load_overload(*what) if self.used else None  # type: ignore[misc]
        return None

    def save_overload(self, *what: Any) -> None:
        """Save a compiled function, if that can be done, with a new index if that is damaged."""
        for _ in range(2 * self.used):
            with suppress(OSError):
                try:
                    return super().save_overload(*what)  # type: ignore[misc, no-any-return]
                except OSError:
                    return None
                except Exception:
                    self._cache_file.flush()
        return None


# numba's class of caches, of kernels and of functions with a signature.
_CACHE: Any = getattr(type(numba.njit(_Checked.load_overload)), "enable_caching", None)
_CACHE = getattr(_CACHE, "__globals__", {}).get("FunctionCache", _Checked)
_INIT = _CACHE.__init__
_CheckedCache = type("_CheckedCache", (_Checked, _CACHE), {}) if _CACHE is not _Checked else _CACHE


@contextmanager
def cache_in(folder: Path | None) -> Iterator[bool]:
    """Have numba cache in a folder what is decorated meanwhile, and say if there is one."""
    if folder is None:
        yield False
        return

    def checked(self: Any, function: Any) -> None:
        _INIT(self, function)
        self.used = Path(self.cache_path).is_relative_to(folder)
        file = self._cache_file
        if self.used:  # whose path has the folder of the source in it
            self._cache_path = str(folder)
            name = f"{function.__module__}.{self._impl.filename_base}"
            file = type(file)(self._cache_path, name, self._impl.locator.get_source_stamp())
        self._cache_file = _CheckedFile(file)
        self.__class__ = _CheckedCache

    config: Any = numba.config
    with compiling:
        before = config.CACHE_DIR, _CACHE.__init__
        config.CACHE_DIR, _CACHE.__init__ = str(folder), checked
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
