"""Packages that only some users have: the extra that brings each, and a sentence where one is not.

All names of `reobserve` itself do with numpy, scipy and numba. What else a call takes is imported
by the call, so that what one user needs another may lack.
"""

from __future__ import annotations

import importlib
from typing import Any

from reobserve.core.errors import InputError

# By the name that is imported, the smallest extra of pyproject.toml that brings a package.
EXTRAS = {
    "cvxpy": "design",
    "clarabel": "design",
    "flint": "design",
    "pylatexenc": "design",
    "sympy": "symbolic",
    "mpmath": "symbolic",
    "matplotlib": "plot",
    "pandas": "data",
    "pint": "data",
    "pydantic": "data",
    "pyarrow": "data",
    "yaml": "data",
    "PIL": "pipeline",
    "docutils": "pipeline",
    "jinja2": "pipeline",
    "rocrate": "pipeline",
}


def missing(name: str, purpose: str, extra: str | None = None) -> InputError:
    """The error that says that a package is not installed, and how to get it.

    Parameters
    ----------
    name
        As it is imported.
    purpose
        What takes it, as "draw a plot".
    extra
        The extra to install, where several bring it.
    """
    command = f'pip install "reobserve[{extra or EXTRAS[name]}]"'
    return InputError(name, f"is not installed, and is needed to {purpose}: `{command}` brings it")


def package(name: str, purpose: str, extra: str | None = None) -> Any:
    """An imported package, or a module of one, that only some users have.

    Raises
    ------
    InputError
        If it is not installed, with the command that installs it.
    """
    top = name.partition(".")[0]
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name != top:
            raise
        raise missing(top, purpose, extra) from None
