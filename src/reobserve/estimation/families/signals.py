"""Signals of a system by name and unit, as a model's file states them: ``{angle: rad}``."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Annotated, NamedTuple

from reobserve.core.errors import InputError, nearest, shown
from reobserve.core.units import check_unit, readings
from reobserve.core.validation import checked

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,39}", re.ASCII)
_MOST = 100
_FACTOR = re.compile(r"([^\s/()^]+)(?:\^([+-]?\d+))?")
_WRITTEN_FACTOR = r"(?:1|%|[°%]?[^\W\d_²³¹⁰⁴-⁹]+)(?:\^[+-]?\d{1,2})?"
_WRITTEN_PRODUCT = rf"{_WRITTEN_FACTOR}(?: {_WRITTEN_FACTOR})*"
_WRITTEN = re.compile(rf"{_WRITTEN_PRODUCT}(?:/(?:{_WRITTEN_FACTOR}|\({_WRITTEN_PRODUCT}\)))?")


class NamedSignal(NamedTuple):
    """One number of a row: what it is called, and its unit, empty if nobody said."""

    name: str
    unit: str


def check_signals(place: str, value: Mapping[str, str]) -> None:
    """Names of letters, digits and ``_``, each with a unit that `check_unit` accepts."""
    if len(value) > _MOST:
        raise InputError(place, f"names {len(value)} signals, must be {_MOST} or fewer")
    for name, unit in value.items():
        if not _NAME.fullmatch(name):
            problem = f"{shown(name)} must be letters, digits and _, from a letter on"
            raise InputError(place, problem)
        check_unit(f"{place}.{name}", unit)


Signals = Annotated[dict[str, str], checked(check_signals)]


def check_keys(place: str, texts: Mapping[str, object], signals: Mapping[str, str]) -> None:
    """Refuse ``texts`` that are not one for each signal."""
    for key in texts:
        if key not in signals:
            raise InputError(f"{place}.{key}", f"is of no signal{nearest(key, signals)}")
    for key in signals:
        if key not in texts:
            raise InputError(f"{place}.{key}", "is missing; each signal needs one")


@contextmanager
def named(**lists: tuple[str, Iterable[str]]) -> Iterator[None]:
    """Let an `InputError` of ``f[0]`` name the key of the first of the signals of f."""
    keys = {
        f"{name}[{i}]": f"{key}.{signal}"
        for name, (key, signals) in lists.items() for i, signal in enumerate(signals)
    }  # fmt: skip
    try:
        yield
    except InputError as error:
        place = re.sub(r"\w+\[\d+\]", lambda at: keys.get(at[0], at[0]), error.parameter)
        raise error.renamed(place) from None


def listed(signals: Mapping[str, str]) -> tuple[NamedSignal, ...]:
    """The signals in the order of their columns."""
    return tuple(NamedSignal(name, unit) for name, unit in signals.items())


def numbered(name: str, count: int, unit: str = "") -> tuple[NamedSignal, ...]:
    """Signals without names of their own: ``name_1`` to ``name_n``, or ``name`` for a single one.

    A single state or fault is numbered, too.
    """
    if count == 1 and name not in ("state", "fault"):
        return (NamedSignal(name, unit),)
    return tuple(NamedSignal(f"{name}_{place + 1}", unit) for place in range(count))


def variances(signals: Iterable[NamedSignal]) -> tuple[NamedSignal, ...]:
    """The variance of each."""
    return tuple(NamedSignal(f"{name}_variance", product(unit, unit)) for name, unit in signals)


def covariances(signals: Iterable[NamedSignal]) -> tuple[NamedSignal, ...]:
    """The covariance matrix of signals, row by row."""
    among = tuple(signals)
    return tuple(
        NamedSignal(f"{row.name}_{column.name}_covariance", product(row.unit, column.unit))
        for row in among
        for column in among
    )


def product(*units: str) -> str:
    """The unit of a product, of ``rad/s`` and ``rad`` ``rad^2/s``, or empty if one is."""
    if not all(units):
        return ""
    if not all(map(_WRITTEN.fullmatch, units)):
        unit = math.prod((readings(unit)[0] for unit in units[1:]), start=readings(units[0])[0])
        return f"{unit:~C}".replace("**", "^").replace("*", " ") or "1"
    powers: dict[str, int] = {}
    for unit in units:
        above, _, below = unit.partition("/")
        for part, sign in ((above, 1), (below, -1)):
            for symbol, power in _FACTOR.findall(part):
                powers[symbol] = powers.get(symbol, 0) + sign * int(power or 1)
    powers.pop("1", None)
    above = _written({symbol: power for symbol, power in powers.items() if power > 0})
    below = _written({symbol: -power for symbol, power in powers.items() if power < 0})
    if not below:
        return above or "1"
    return f"{above or '1'}/({below})" if " " in below else f"{above or '1'}/{below}"


def _written(powers: Mapping[str, int]) -> str:
    return " ".join(s if power == 1 else f"{s}^{power}" for s, power in powers.items())
