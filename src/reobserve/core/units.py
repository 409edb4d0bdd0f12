"""Units as they are written: products and quotients of known symbols, as ``N m s/rad``."""

from __future__ import annotations

import re

# Those of the SI that systems are described in, one for a number that has none, and y, the paper's
# velocity whose unit nobody states.
SYMBOLS = (
    "1", "%", "s", "min", "h", "m", "mm", "cm", "km", "kg", "g", "rad", "deg", "rpm", "Hz",
    "N", "kN", "Pa", "kPa", "MPa", "bar", "l", "J", "kJ", "W", "kW", "V", "mV", "kV", "A", "mA",
    "Ω", "H", "mH", "F", "C", "T", "mT", "uT", "Wb", "K", "°C", "mol", "cd", "dB", "y",
)  # fmt: skip

_POWER = rf"(?:{'|'.join(map(re.escape, SYMBOLS))})(?:\^[+-]?\d{{1,2}})?"
_PRODUCT = rf"{_POWER}(?: {_POWER}){{0,7}}"
_UNIT = rf"{_PRODUCT}(?:/(?:{_POWER}|\({_PRODUCT}\)))?"
_UNITS = re.compile(rf"{_UNIT}(?:, {_UNIT}){{0,99}}", re.ASCII)


def is_unit(text: str) -> bool:
    """True if text is a unit, or a list of them with commas for the components of one signal."""
    return len(text) <= 200 and _UNITS.fullmatch(text) is not None
