"""Refusal of results that are not finite, in place of numpy's warnings."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, TypeVar

import numpy as np

from reobserve.core.errors import InputError

P = ParamSpec("P")
Result = TypeVar("Result")


def finite(name: str) -> Callable[[Callable[P, Result]], Callable[P, Result]]:
    """Refuse a call whose result, a number, an array or a tuple or class of them, is not finite.

    The `InputError` says that the argument ``name`` leads beyond floating-point numbers.
    """

    def decorate(function: Callable[P, Result]) -> Callable[P, Result]:
        @wraps(function)
        def call(*args: P.args, **options: P.kwargs) -> Result:
            with np.errstate(all="ignore"):
                result = function(*args, **options)
            if not all(np.isfinite(part).all() for part in _components(result)):
                raise InputError(
                    name, "must keep results inside the range of floating-point numbers"
                )
            return result

        return call

    return decorate


def _components(result: Any) -> tuple[Any, ...]:
    parts = tuple(vars(result).values()) if hasattr(result, "__dict__") else result
    return parts if isinstance(parts, tuple) else (parts,)
