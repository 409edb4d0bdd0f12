"""Poles as a model's file or the command line tells them: numbers, or words like ``-1+2j``."""

from __future__ import annotations

import re
from typing import Any

from reobserve.core.errors import InputError, shown

_NUMBER = r"\d+\.?\d*(?:[eE][+-]?\d+)?|\.\d+(?:[eE][+-]?\d+)?"
_POLE = re.compile(rf"[+-]?(?:{_NUMBER})(?:[+-](?:{_NUMBER})[ij])?", re.ASCII)


def check_poles(place: str, value: list[Any]) -> None:
    """Refuse what is no list of poles."""
    as_pole_list(place, value)


def as_pole_list(place: str, value: list[Any]) -> list[complex]:
    """Poles as complex numbers.

    Raises
    ------
    InputError
        If one is neither a number nor written like ``-1+2j``.
    """
    return [_pole(f"{place}.{index}", one) for index, one in enumerate(value)]


def parse_poles(text: str, place: str = "poles") -> list[complex]:
    """Poles in one text, with commas or spaces in between; `InputError` as `as_pole_list`."""
    if not isinstance(text, str):
        raise InputError(place, f"{shown(text)} must be a text, as '-2, -1+3j, -1-3j'")
    return as_pole_list(place, text.replace(",", " ").split())


def _pole(place: str, value: Any) -> complex:
    if isinstance(value, int | float) and not isinstance(value, bool):
        return complex(value)
    if not isinstance(value, str) or len(value) > 60 or not _POLE.fullmatch(value.strip()):
        raise InputError(place, f"{shown(value)} must be a number, or one like -1+2j")
    found = complex(value.strip().replace("i", "j"))
    if not abs(found) < float("inf"):
        raise InputError(place, f"{shown(value)} must be finite")
    return found
