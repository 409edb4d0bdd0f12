"""Names of the signals of a model."""

from __future__ import annotations

from typing import Any

from reobserve.core.errors import InputError, shown


def as_names(key: str, value: Any, size: int | None = None) -> tuple[str, ...] | None:
    """Different identifiers as a tuple, or None for None.

    Raises
    ------
    InputError
        If they are none, or there are not ``size`` of them.
    """
    if value is None:
        return None
    good = isinstance(value, list | tuple) and all(isinstance(name, str) for name in value)
    if not good or not all(name.isidentifier() for name in value) or len({*value}) < len(value):
        raise InputError(key, f"{shown(value)} must be different names, as those of variables")
    if size is not None and len(value) != size:
        raise InputError(key, f"are {len(value)}, must be {size}")
    return tuple(value)
