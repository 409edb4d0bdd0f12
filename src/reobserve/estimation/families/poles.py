"""Poles as YAML states them: numbers, or words like ``-1+2j``."""

from __future__ import annotations

import re
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.arguments import as_poles
from reobserve.core.errors import InputError, shown
from reobserve.core.validation import checked

_NUMBER = r"\d+\.?\d*(?:[eE][+-]?\d+)?|\.\d+(?:[eE][+-]?\d+)?"
_POLE = re.compile(rf"[+-]?(?:{_NUMBER})(?:[+-](?:{_NUMBER})[ij])?", re.ASCII)


def as_pole_list(place: str, value: list[Any]) -> list[complex]:
    """Poles as complex numbers."""
    if not isinstance(value, list | tuple):
        raise InputError(place, f"{shown(value)} must be a list of poles, as [-2, -3]")
    return [_pole(f"{place}.{index}", pole) for index, pole in enumerate(value)]


Poles = Annotated[list[Any], checked(as_pole_list)]


def stable_poles(name: str, value: list[Any]) -> list[complex]:
    """Poles of continuous time [1/s], all to the left of the imaginary axis."""
    poles = as_pole_list(name, value)
    for index, pole in enumerate(poles):
        if not pole.real < 0:
            problem = f"{shown(value[index])} is not stable: its real part must be below zero"
            raise InputError(f"{name}.{index}", problem)
    return poles


def sampled_poles(name: str, value: list[Any], period: float | None) -> NDArray[np.complex128]:
    """Poles of a sample, from stable ones [1/s] where a period [s] is given."""
    if period is not None:  # z = exp(s T)
        return np.exp(as_poles(name, stable_poles(name, value)) * period)
    poles = as_poles(name, as_pole_list(name, value))
    for index, pole in enumerate(poles):
        if not abs(pole) < 1:
            problem = f"{shown(value[index])} is not stable: its size must be below one"
            raise InputError(f"{name}.{index}", problem)
    return poles


def _pole(place: str, value: Any) -> complex:
    if isinstance(value, int | float) and not isinstance(value, bool):
        return complex(value)
    if not isinstance(value, str) or len(value) > 60 or not _POLE.fullmatch(value.strip()):
        raise InputError(place, f"{shown(value)} must be a number, or one like -1+2j")
    pole = complex(value.strip().replace("i", "j"))
    if not abs(pole) < float("inf"):
        raise InputError(place, f"{shown(value)} must be finite")
    return pole
