"""A design as its readers get it from the stage design: checked whole before anything is used."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from reobserve.core.errors import InputError
from reobserve.core.matrices import as_positive
from reobserve.papers.eso import keys
from reobserve.papers.eso.setup import augmented
from reobserve.synthesis.extended_state.design import Design
from reobserve.synthesis.extended_state.system import AugmentedSystem


def stored_design(plant: keys.Plant, values: Mapping[str, Any]) -> tuple[AugmentedSystem, Design]:
    """The system of a stored design, and the design.

    Raises
    ------
    InputError
        If a key is missing, unknown or of another type, or the gains do not fit the system.
    """
    rest = {name: value for name, value in values.items() if name != "filter_rate"}
    found = Design.from_dict(rest)
    if "filter_rate" not in values:
        raise InputError("design", "has no key 'filter_rate'")
    system = augmented(plant, as_positive("filter_rate", values["filter_rate"]))
    wanted = (system.size, len(system.C))
    for name, gain in (("L", found.gains.L), ("Ld", found.gains.Ld)):
        if gain.shape != wanted:
            raise InputError(f"design.{name}", f"has shape {gain.shape}, must be {wanted}")
    return system, found
