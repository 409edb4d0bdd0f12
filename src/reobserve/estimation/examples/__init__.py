"""One example for each observer: a specification, and the record that it is for."""

from __future__ import annotations

from functools import cache
from importlib import resources

from reobserve.core.errors import InputError, nearest, shown
from reobserve.estimation import example_records
from reobserve.estimation.example_records import Simulated

# The specification stands in the file of this name; the record comes from the plant.
_PLANTS = {
    "ilo-sampled": "satellite",
    "ilo-continuous": "satellite",
    "ilo-forgetting": "satellite",
    "adaptive": "satellite",
    "pi": "satellite",
    "normal-form-constant": "pendulum",
    "normal-form-identity": "pendulum",
    "normal-form-transformed": "pendulum",
    "high-gain": "driven_pendulum",
    "extended-high-gain": "lag",
    "delay-adaptive": "lag",
    "delay-least-squares": "lag",
    "delay-variable-structure": "lag",
    "levant": "signal",
    "kalman": "motor",
    "augmented-kalman": "weak_motor",
    "sensor-bias": "biased_motor",
    "svsf": "motor",
    "imm-kalman": "worn_motor",
    "imm-svsf": "worn_motor",
    "eso": "faulty_motor",
    "fixed-gain": "motor",
    "luenberger": "motor",
    "steady-kalman": "motor",
}
NAMES = tuple(_PLANTS)


@cache
def specification_text(name: str) -> str:
    """The specification of an example, with comments.

    Raises
    ------
    InputError
        If there is no such example.
    """
    _check(name)
    return resources.files(__package__).joinpath(f"{name}.yaml").read_text(encoding="utf-8")


def simulated(name: str) -> Simulated:
    """The plant of an example, followed over its record.

    Raises
    ------
    InputError
        If there is no such example.
    """
    _check(name)
    made: Simulated = getattr(example_records, _PLANTS[name])()
    return made


def _check(name: str) -> None:
    if name not in _PLANTS:
        raise InputError("example", f"there is no {shown(name)}{nearest(name, NAMES)}")
