"""Packages that only some users have: the extras that bring each, and a sentence where one is not.

All names of `reobserve` itself do with numpy, scipy and numba. What else a call takes is imported
by the call, so that what one user needs another may lack.
"""

from __future__ import annotations

import importlib
import os
import sys
from importlib.util import find_spec
from typing import Any

from reobserve.core.errors import InputError

# By the name that is imported, the extras of pyproject.toml that bring a package. The first one is
# named unless the call says which one brings all that it takes.
EXTRAS = {
    "cvxpy": ("design", "papers"),
    "clarabel": ("design", "papers"),
    "flint": ("design", "symbolic", "data", "papers"),
    "sympy": ("symbolic", "design", "data", "papers"),
    "mpmath": ("symbolic", "design", "data", "papers"),
    "matplotlib": ("plot", "papers"),
    "pandas": ("data", "papers"),
    "pint": ("data", "papers"),
    "pyarrow": ("data", "papers"),
    "pydantic": ("data", "design", "papers"),
    "yaml": ("data", "design", "papers"),
    "PIL": ("papers",),
    "docutils": ("papers",),
    "jinja2": ("papers",),
    "pylatexenc": ("papers",),
    "rocrate": ("papers",),
    "typing_extensions": ("papers",),
}


class MissingPackageError(InputError, ImportError):
    """A package is not installed. The sentence ends with the command that installs it.

    Parameters
    ----------
    name
        As it is imported.
    purpose
        What takes it, as "draw a plot".
    extra
        The extra to install, if it brings the package.
    """

    def __init__(self, name: str, purpose: str, extra: str = "") -> None:
        extra = extra if extra in EXTRAS[name] else EXTRAS[name][0]
        command = f'pip install "reobserve[{extra}]"'
        super().__init__(
            name, f"is not installed, and is needed to {purpose}: `{command}` brings it"
        )
        self.name, self.purpose = name, purpose

    def renamed(self, parameter: str) -> MissingPackageError:
        """Itself: no key or file is wrong."""
        return self


def package(name: str, purpose: str, extra: str = "") -> Any:
    """An imported package, or a module of one, that only some users have.

    Raises
    ------
    MissingPackageError
        If it is not installed, with the command that installs it.
    """
    top = name.partition(".")[0]
    if top == "matplotlib" and "matplotlib" not in sys.modules:
        _import_matplotlib()
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name != top:
            raise
        raise MissingPackageError(top, purpose, extra) from None


def _import_matplotlib() -> None:
    """Import it also where MPLBACKEND names a backend that is not here, as of a notebook."""
    try:
        importlib.import_module("matplotlib")
    except ImportError:
        return  # which the caller sees again
    except ValueError:
        os.environ.pop("MPLBACKEND", None)
        for half_imported in [name for name in sys.modules if name.startswith("matplotlib.")]:
            del sys.modules[half_imported]


def require(name: str, purpose: str, extra: str = "") -> None:
    """Refuse to go on without a package, and do not import it (raises as `package`)."""
    try:
        installed = find_spec(name) is not None
    except ModuleNotFoundError:
        installed = False
    if not installed:
        raise MissingPackageError(name, purpose, extra)
