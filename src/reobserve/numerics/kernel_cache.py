"""Machine code of kernels on disk: what cannot be kept or is damaged costs time, never an error."""

from __future__ import annotations

import hashlib
import os
import pickle
import stat
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import (
    CompileResultCacheImpl,
    FunctionCache,
    IndexDataCacheFile,
    NullCache,
    UserProvidedCacheLocator,
)

_DIGEST = hashlib.sha256().digest_size
_PACKAGE = Path(__file__).parents[1]


def usable_folder(package: Path, name: str) -> Path | None:
    """The first folder of this name that can be written, or None.

    It is looked for where the user said (``NUMBA_CACHE_DIR``), beside the package, among the user's
    caches and among the temporary files.
    """
    for base in _bases(package):
        folder = base / name
        try:
            folder.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
        except OSError:
            continue
        return folder
    return None


def _bases(package: Path) -> Iterator[Path]:
    chosen: Any = numba.config
    if chosen.CACHE_DIR:
        yield Path(chosen.CACHE_DIR)
    else:
        yield package / "__pycache__"
        home = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
        if os.path.isabs(home):
            yield Path(home) / "reobserve"
    private = Path(tempfile.gettempdir()) / f"reobserve-{getattr(os, 'getuid', int)()}"
    if _is_mine(private):
        yield private


def _is_mine(folder: Path) -> bool:
    """Whether only this user can have put code into a folder that everybody could have made."""
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        about = os.lstat(folder)
    except OSError:
        return False
    mine = not hasattr(os, "getuid") or about.st_uid == os.getuid()
    return mine and stat.S_ISDIR(about.st_mode) and not about.st_mode & 0o022


def cache_for(function: Callable[..., Any], folder: Path | None) -> Any:
    """What numba asks for the machine code of a function, kept in ``folder`` if there is one."""
    if folder is None:
        return _Nothing()
    config: Any = numba.config
    before = config.CACHE_DIR
    config.CACHE_DIR = str(folder)
    try:
        cache = _KernelCache(function)
    except (RuntimeError, OSError):  # no part of the folder can be made for this file
        return _Nothing()
    finally:
        config.CACHE_DIR = before
    # Where numba chose another folder, it may hold the code of other sources.
    return cache if folder in Path(cache.cache_path).parents else _Nothing()


class _Nothing(NullCache):
    """Keeps nothing, and says that it compiles."""

    def load_overload(self, signature: Any, context: Any) -> None:
        _tell("and again at every start: there is no folder to keep the code in")


class _Locator(UserProvidedCacheLocator):
    """Where the code of a module is kept: of this package by its name, wherever the package is.

    So copies of the package share what is compiled; what has changed is in another folder.
    """

    @classmethod
    def get_suitable_cache_subpath(cls, py_file: str) -> str:
        """The name of a folder in the cache."""
        path = Path(py_file)
        if _PACKAGE in path.parents:
            return ".".join(path.relative_to(_PACKAGE.parent).with_suffix("").parts)
        return str(super().get_suitable_cache_subpath(py_file))  # type: ignore[no-untyped-call]


class _Implementation(CompileResultCacheImpl):
    _locator_classes = (_Locator,)  # type: ignore[assignment]


class _KernelCache(FunctionCache):
    """numba's cache, over files that are checked."""

    _impl_class = _Implementation

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)  # type: ignore[no-untyped-call]
        stamp = self._impl.locator.get_source_stamp()
        self._cache_file = _CheckedFiles(self._cache_path, self._impl.filename_base, stamp)  # type: ignore[no-untyped-call]

    def load_overload(self, signature: Any, context: Any) -> Any:
        """The code of a signature, or None if it has to be compiled."""
        found = None
        with suppress(OSError):
            found = super().load_overload(signature, context)  # type: ignore[no-untyped-call]
        if found is None:
            _tell(f"once; the code is kept in {Path(self.cache_path).parent}")
        return found

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Keep the code of a signature, if the disk takes it."""
        with suppress(OSError):
            super().save_overload(signature, compiled)  # type: ignore[no-untyped-call]


class _CheckedFiles(IndexDataCacheFile):
    """numba's index and code of a function, each with a digest; what does not fit it is removed.

    Two processes with two signatures can choose one name for their code. So the code carries the
    signature that it is of, and what is of another one is compiled anew.
    """

    def load(self, key: Any) -> Any:
        """The code of a signature, or None."""
        of, code = super().load(key) or (None, None)  # type: ignore[no-untyped-call]
        return code if of == key else None

    def save(self, key: Any, code: Any) -> None:
        """Keep the code of a signature."""
        super().save(key, (key, code))  # type: ignore[no-untyped-call]

    def _load_index(self) -> Any:
        stamp, index = self._checked(self._index_path) or (None, {})
        return index if stamp == (self._version, self._source_stamp) else {}

    def _save_index(self, index: Any) -> None:
        self._put(self._index_path, ((self._version, self._source_stamp), index))

    def _load_data(self, name: str) -> Any:
        return self._checked(self._data_path(name))  # type: ignore[no-untyped-call]

    def _save_data(self, name: str, code: Any) -> None:
        self._put(self._data_path(name), code)  # type: ignore[no-untyped-call]

    def _put(self, path: str, content: Any) -> None:
        body = self._dump(content)  # type: ignore[no-untyped-call]
        with self._open_for_write(path) as stream:
            stream.write(hashlib.sha256(body).digest() + body)

    def _checked(self, path: str) -> Any:
        try:
            content = Path(path).read_bytes()
        except OSError:
            return None
        digest, body = content[:_DIGEST], content[_DIGEST:]
        if hashlib.sha256(body).digest() == digest:
            return pickle.loads(body)
        with suppress(OSError):
            os.unlink(path)
        return None


_told: list[str] = []


def _tell(how_often: str) -> None:
    """Say to somebody at a terminal, once, why it takes so long."""
    if not _told and sys.stderr is not None and sys.stderr.isatty():
        _told.append(how_often)
        print(
            "reobserve: compiling loops for this machine, up to a minute, " + how_often,
            file=sys.stderr,
        )
