"""Keys of filters beside their model: angles, outliers, and a measurement noise to estimate."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from reobserve.core.errors import InputError, nearest, shown
from reobserve.core.matrices import as_positive
from reobserve.estimation.families.signals import NamedSignal, variances
from reobserve.polynomials.grammar import parse


def periods(system: Any) -> dict[str, Any]:
    """The periods of states and outputs, as a model takes them, from the key ``periods``.

    Raises
    ------
    InputError
        If a name is that of no state and no measurement, or a period is no number above zero.
    """
    states, outputs = list(system.states), list(system.measurements)
    known, numbers = dict.fromkeys([*states, *outputs]), dict[str, float]()
    for name, value in system.periods.items():
        if name not in known:
            raise InputError(
                f"periods.{name}", f"is no state and no measurement{nearest(name, known)}"
            )
        key, number = f"periods.{name}", value
        if isinstance(value, str):  # as 2*pi
            number = parse(key, value, {})
            if not number.is_real:
                raise InputError(key, f"{shown(value)} must be a number, or text of numbers and pi")
        numbers[name] = as_positive(key, float(number))
    if not system.periods:
        return {}
    return {
        "state_periods": [numbers.get(name) for name in states],
        "output_periods": [numbers.get(name) for name in outputs],
    }


def rules(system: Any) -> dict[str, Any]:
    """The gate and the memory of a filter, as far as they are stated."""
    values = {name: getattr(system, name) for name in ("gate", "noise_memory")}
    options = {name: value for name, value in values.items() if value is not None}
    if system.outliers is not None:
        if system.gate is None:
            raise InputError("outliers", "must be left out without a gate")
        options["outliers"] = system.outliers
    return options


def rule_estimates(
    system: Any, signals: tuple[NamedSignal, ...]
) -> Mapping[str, tuple[NamedSignal, ...]]:
    """The estimates that a gate and a memory add, of these measurements."""
    added = {}
    if getattr(system, "gate", None) is not None:
        added["outlier"] = tuple(NamedSignal(f"{signal.name}_outlier", "1") for signal in signals)
    if getattr(system, "noise_memory", None) is not None:
        added["noise_variance"] = tuple(
            NamedSignal(f"{signal.name.removesuffix('_variance')}_noise_variance", signal.unit)
            for signal in variances(signals)
        )
    return added
